"""A document as one HTML file that needs nothing else."""

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from impact_rig import __version__
from impact_rig.reporting.report.document import Document, Identifiers, Section

if TYPE_CHECKING:
    import jinja2

TEMPLATES = "templates"
"""Folder beside this module."""
PAGE = "page.html.jinja"
STYLE = "style.css"
TOP_LEVEL = 2
"""Of the sections' headings: the title has the first."""
RESERVED_ID = "report"
"""Of the main part of the page."""


@dataclass(frozen=True)
class _Heading:
    """A section with its place in the page."""

    section: Section
    identifier: str
    level: int
    is_listed: bool
    inner: tuple["_Heading", ...]


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
    environment = _make_environment()
    identifiers = Identifiers({RESERVED_ID})
    page = environment.get_template(PAGE).render(
        document=document,
        headings=[_place(section, TOP_LEVEL, identifiers) for section in document.sections],
        identifiers=identifiers,
        is_unfolded=is_unfolded,
        style=_mark_safe(_read_template(STYLE)),
        version=__version__,
    )
    return page.lstrip()


def _place(section: Section, level: int, identifiers: Identifiers) -> _Heading:
    return _Heading(
        section=section,
        identifier=identifiers.make(section.title),
        level=level,
        is_listed=section.is_listed,
        inner=tuple(_place(inner, level + 1, identifiers) for inner in section.sections),
    )


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
    return environment


def _read_template(name: str) -> str:
    return (files(__package__) / TEMPLATES / name).read_text(encoding="utf-8")


def _mark_safe(text: str) -> Any:
    """Return text of our own making that is not to be escaped."""
    from markupsafe import Markup

    return Markup(text)  # noqa: S704 - style sheet and figures, never words of a file
