"""What a page needs of one figure."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ReportFigure:
    """One figure, ready to be put into a page.

    Attributes
    ----------
    name : str
        Of ASCII letters, digits, ``-`` and ``_``: for ids and file names, unique in the report.
    title : str
        Plain text, to be escaped by the page.
    svg : str
        Markup, to be put into the page as it is: one ``<div>`` with an ``<svg>`` for each panel,
        beside each other where there is room and below each other on a phone. Ids begin with
        `name`. Text, axes and grid are in ``currentColor``, in the page's font; nothing is
        loaded from anywhere. Empty: there was nothing to draw, and `caption` says why.
    alternative : str
        What the figure shows, with the key numbers, for those who do not see it: plain text, to
        be escaped by the page. Empty where `svg` is.
    caption : str
        How to read it, plain text, to be escaped by the page; of a figure that is not drawn, the
        sentence that says why.
    """

    name: str
    title: str
    svg: str
    alternative: str
    caption: str

    @property
    def is_drawn(self) -> bool:
        """Whether there is anything to see."""
        return bool(self.svg)


def make_missing_figure(name: str, title: str, reason: str) -> ReportFigure:
    """Return what stands in the place of a figure for which there is nothing to draw."""
    return ReportFigure(name, title, svg="", alternative="", caption=reason)
