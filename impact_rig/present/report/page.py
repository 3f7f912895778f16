"""A document as one HTML file that needs no other file."""

from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from impact_rig import __version__
from impact_rig.present.report.document import Document, Section

if TYPE_CHECKING:
    import jinja2

TEMPLATES = "templates"
"""Folder beside this module."""
PAGE = "page.html.jinja"
STYLE = "style.css"


def render_page(document: Document) -> str:
    """Return the HTML of a document.

    Everything in it is escaped. The same document gives the same characters.
    """
    numbers: dict[int, int] = {}

    def anchor(section: Section) -> str:
        """Return the id of a section's heading."""
        return f"section-{numbers.setdefault(id(section), len(numbers) + 1)}"

    template = _make_environment().get_template(PAGE)
    page = template.render(
        document=document,
        anchor=anchor,
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
    environment.filters["kind"] = lambda part: type(part).__name__
    return environment


def _read_template(name: str) -> str:
    return (files(__package__) / TEMPLATES / name).read_text(encoding="utf-8")


def _mark_safe(text: str) -> Any:
    """Return our own HTML, which is not escaped."""
    from markupsafe import Markup

    return Markup(text)  # noqa: S704 - our style sheet, never words of a file
