"""What a page is made of, without a word on how it looks."""

import re
from dataclasses import dataclass, field

from impact_rig.present.figures.markup import ReportFigure
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
class Picture:
    """A figure of the report."""

    figure: ReportFigure


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
    is_listed : bool
        The table of contents names it.
    """

    title: str
    parts: tuple[Part, ...] = ()
    sections: tuple["Section", ...] = ()
    is_listed: bool = True


@dataclass(frozen=True)
class Document:
    """A whole page.

    Attributes
    ----------
    title, subtitle, name : str
        The heading of all, what it is about, and what tells it from other reports.
    banner : str
        Where the numbers come from, before all else.
    is_warning : bool
        The banner is one that nobody may overlook.
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


@dataclass
class Identifiers:
    """Gives out the ids of a page: readable, and each once.

    Attributes
    ----------
    taken : set of str
        Those that are in use.
    """

    taken: set[str] = field(default_factory=set)

    def make(self, text: str) -> str:
        """Return an id made of the words of a text."""
        words = "-".join(re.findall(r"[a-z0-9]+", text.lower())) or "part"
        name, number = words, 1
        while name in self.taken:
            number += 1
            name = f"{words}-{number}"
        self.taken.add(name)
        return name


def drop_empty(*sections: Section | None) -> tuple[Section, ...]:
    """Return the sections that have anything to say."""
    return tuple(
        section for section in sections if section and (section.parts or section.sections)
    )
