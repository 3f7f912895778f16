"""A figure as a page needs it: markup with the page's ink and font, and what it says in words.

matplotlib writes a document of its own: black ink, its own font, ids that every figure has. In a
page the ink is the page's, the font is the page's, and ids are unique.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import StringIO
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from impact_rig.present.figures.panels import INK, drawing_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SVG = "http://www.w3.org/2000/svg"
LINK = "{http://www.w3.org/1999/xlink}href"
PANELS_STYLE = (
    "display:flex;flex-wrap:wrap;gap:.5rem .75rem;justify-content:center;align-items:flex-start"
)
PANEL_STYLE = "flex:1 1 18rem;min-width:0;max-width:28rem;height:auto;stroke-linejoin:round"
"""As wide as there is room, two beside each other from some 37 rem, our choice: the ticks' text
is then never below 8 px, nor larger than the page's."""
_REFERENCE = re.compile(r"#([\w.-]+)")
_GIVEN_ID = re.compile(r"[a-z0-9]+(-[a-z0-9]+)+")
"""Ids that were given with set_gid have a hyphen, matplotlib's own have none."""
_NO_METADATA = {"Creator": None, "Date": None, "Format": None, "Type": None}


@dataclass(frozen=True)
class ReportFigure:
    """One figure, ready to be put into a page.

    Attributes
    ----------
    name : str
        Of ASCII letters, digits, ``-`` and ``_``: for ids; those of several runs may be alike.
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

    def rename(self, name: str) -> str:
        """Return the markup with another name in every id: a page may have two of one name."""
        return re.sub(rf"(?<=[\"#]){re.escape(self.name)}-", f"{name}-", self.svg)


def make_missing_figure(name: str, title: str, reason: str) -> ReportFigure:
    """Return what stands in the place of a figure for which there is nothing to draw."""
    return ReportFigure(name, title, svg="", alternative="", caption=reason)


def make_figure(
    name: str,
    title: str,
    draw: "Callable[[], Sequence[Figure]]",
    alternative: str,
    caption: str,
) -> ReportFigure:
    """Return a figure with the panels that `draw` returns, in the report's style."""
    with drawing_style():
        svg = render_panels(name, draw())
    return ReportFigure(name, title, svg, alternative, caption)


def make_name(*parts: str) -> str:
    """Return a name for ids and files, different for different parts.

    Letters and digits of ASCII stay, a blank becomes a hyphen, any other character its code
    point between underscores; the parts are joined by two hyphens.
    """
    return "--".join("".join(map(_encode, part)) for part in parts if part)


def _encode(character: str) -> str:
    if character.isascii() and character.isalnum():
        return character
    return "-" if character == " " else f"_{ord(character):x}_"


def render_panels(name: str, panels: "Sequence[Figure]") -> str:
    """Return the markup of a figure's panels.

    Parameters
    ----------
    name : str
        Of the figure; every id begins with it.
    panels : sequence of matplotlib.figure.Figure
        Drawn in `drawing_style`.

    Returns
    -------
    str
        Well-formed as XML and as HTML. The same panels give the same characters.
    """
    svgs = (_render(f"{name}-{place}", panel) for place, panel in enumerate(panels, start=1))
    return f'<div class="panels" style="{PANELS_STYLE}">{"".join(svgs)}</div>'


def _render(prefix: str, panel: "Figure") -> str:
    stream = StringIO()
    panel.savefig(stream, format="svg", metadata=_NO_METADATA)
    root = ET.fromstring(stream.getvalue())  # noqa: S314 (our own text)
    _remove_surplus(root)
    needed = _list_references(root)
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
        element.text = element.text and element.text.strip()
        element.tail = None
        _adapt_attributes(element, prefix, needed)
    del root.attrib["width"], root.attrib["height"], root.attrib["version"]
    root.set("xmlns", SVG)
    root.set("style", PANEL_STYLE)
    return ET.tostring(root, encoding="unicode")


def _remove_surplus(root: ET.Element) -> None:
    """Remove the style sheet, which would hold for the whole page, and what draws nothing."""
    for parent in list(root.iter()):
        for child in list(parent):
            is_sheet = child.tag == f"{{{SVG}}}style"
            if is_sheet or child.get("style") == "fill: none":
                parent.remove(child)


def _list_references(root: ET.Element) -> set[str]:
    """Return the ids that something in the drawing refers to."""
    texts = (element.get(name, "") for element in root.iter() for name in (LINK, "clip-path"))
    return {match[1] for text in texts for match in _REFERENCE.finditer(text)}


def _adapt_attributes(element: ET.Element, prefix: str, needed: set[str]) -> None:
    attributes = element.attrib
    if LINK in attributes:
        attributes["href"] = attributes.pop(LINK)
    identifier = attributes.pop("id", "")
    if identifier in needed or _GIVEN_ID.fullmatch(identifier):
        attributes["id"] = f"{prefix}-{identifier}"
    for name in ("href", "clip-path"):
        if name in attributes:
            attributes[name] = attributes[name].replace("#", f"#{prefix}-")
    if "style" in attributes:
        attributes["style"] = _adapt_style(attributes["style"])


def _adapt_style(style: str) -> str:
    """Take the page's font, and its ink in place of the stand-in."""
    parts = (part.strip() for part in style.split(";"))
    kept = (part for part in parts if not part.startswith("font-family"))
    return ";".join(kept).replace(INK, "currentColor")
