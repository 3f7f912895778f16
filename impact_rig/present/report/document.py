"""What a page is made of, without a word on how it looks."""

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
    """A list of things to know.

    Attributes
    ----------
    items : tuple of Remark
        In their order.
    is_warning : bool
        They change how the numbers are to be read.
    """

    items: tuple[Remark, ...]
    is_warning: bool = False


@dataclass(frozen=True)
class Facts:
    """Names and what belongs to them."""

    rows: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Listing:
    """Text whose lines stay as they are."""

    title: str
    text: str


@dataclass(frozen=True)
class Folded:
    """What is shown when asked for, and always in print."""

    title: str
    parts: tuple["Part", ...]


Part = Paragraph | Remarks | Facts | Table | Picture | Listing | Folded


@dataclass(frozen=True)
class Section:
    """A heading with what belongs to it.

    Attributes
    ----------
    title : str
        The heading.
    parts : tuple of Part
        In their order.
    sections : tuple of Section
        Below it, one level deeper.
    is_page : bool
        On paper it begins a page.
    """

    title: str
    parts: tuple[Part, ...] = ()
    sections: tuple["Section", ...] = ()
    is_page: bool = False


@dataclass(frozen=True)
class Document:
    """A whole page.

    Attributes
    ----------
    title, subtitle, name : str
        Heading, subject, and the name of the run.
    banner : str
        Where the numbers come from, before all else.
    is_warning : bool
        The banner is coloured as a warning.
    facts : tuple of (str, str)
        The few that belong beside the title.
    sections : tuple of Section
        In their order.
    """

    title: str
    subtitle: str
    name: str
    banner: str
    is_warning: bool
    facts: tuple[tuple[str, str], ...]
    sections: tuple[Section, ...]


def drop_empty(*sections: Section | None) -> tuple[Section, ...]:
    """Return the sections that have anything to say."""
    return tuple(
        section for section in sections if section and (section.parts or section.sections)
    )
