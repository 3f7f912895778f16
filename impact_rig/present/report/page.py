"""A document as one HTML file that needs nothing else."""

from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from impact_rig import __version__
from impact_rig.present.report.document import Document, Identifiers, Section

if TYPE_CHECKING:
    import jinja2

TEMPLATES = "templates"
"""Folder beside this module."""
PAGE = "page.html.jinja"
STYLE = "style.css"
RESERVED_ID = "report"
"""Of the main part of the page."""


def render_page(document: Document, *, is_unfolded: bool = False) -> str:
    """Return the HTML of a document.

    Everything in it is escaped but the figures' own markup. The same document gives the same
    characters.

    Parameters
    ----------
    document : Document
        What to say.
    is_unfolded : bool
        Show what is folded: for paper.
    """
    identifiers = Identifiers({RESERVED_ID})
    anchors: dict[int, str] = {}

    def anchor(section: Section) -> str:
        """Return the id of a section's heading."""
        if id(section) not in anchors:
            anchors[id(section)] = identifiers.make(section.title)
        return anchors[id(section)]

    template = _make_environment().get_template(PAGE)
    page = template.render(
        document=document,
        anchor=anchor,
        identifiers=identifiers,
        is_unfolded=is_unfolded,
        style=_mark_safe(_read_template(STYLE)),
        version=__version__,
    )
    return page.lstrip()


@cache
def _make_environment() -> "jinja2.Environment":
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(_read_template),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["markup"] = _mark_safe
    environment.filters["kind"] = lambda part: type(part).__name__
    return environment


def _read_template(name: str) -> str:
    return (files(__package__) / TEMPLATES / name).read_text(encoding="utf-8")


def _mark_safe(text: str) -> Any:
    """Return text of our own making that is not to be escaped."""
    from markupsafe import Markup

    return Markup(text)  # noqa: S704 - style sheet and figures, never words of a file
