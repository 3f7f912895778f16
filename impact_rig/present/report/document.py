"""The parts of a page; `page.py` has its look."""

from dataclasses import dataclass

from impact_rig.present.figures.picture import Picture
from impact_rig.results.remarks import Remark
from impact_rig.results.tables import Table


@dataclass(frozen=True)
class Paragraph:
    """Text of one paragraph."""

    text: str


@dataclass(frozen=True)
class Remarks:
    """A list of remarks."""

    items: tuple[Remark, ...]
    is_warning: bool = False


@dataclass(frozen=True)
class Facts:
    """Names and values."""

    rows: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Listing:
    """Preformatted text."""

    title: str
    text: str


@dataclass(frozen=True)
class Folded:
    """Contents that unfold on a click, and are always printed."""

    title: str
    parts: tuple["Part", ...]


Part = Paragraph | Remarks | Facts | Table | Picture | Listing | Folded


@dataclass(frozen=True)
class Section:
    """A heading with its parts, and sections one level deeper."""

    title: str
    parts: tuple[Part, ...] = ()
    sections: tuple["Section", ...] = ()
    is_page: bool = False


@dataclass(frozen=True)
class Document:
    """A whole page."""

    title: str
    subtitle: str
    name: str
    banner: str
    is_warning: bool
    facts: tuple[tuple[str, str], ...]
    sections: tuple[Section, ...]


def drop_empty(*sections: Section | None) -> tuple[Section, ...]:
    """Return the sections that are not empty."""
    return tuple(
        section for section in sections if section and (section.parts or section.sections)
    )
