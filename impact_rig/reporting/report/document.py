"""What a page is made of, without a word on how it looks."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from impact_rig.reporting.figures.figure import ReportFigure
from impact_rig.results.numbers import MISSING

LONGEST_UNBROKEN = 24
"""Rows of a table that are kept on one page of paper [-], our choice: a third of it."""
LONGEST_LABEL = 28
"""Characters of words in a cell that stay on one line [-], our choice."""


@dataclass(frozen=True)
class Paragraph:
    """Text of one paragraph."""

    kind: ClassVar[str] = "paragraph"
    text: str


@dataclass(frozen=True)
class Remark:
    """One thing to know, and whom it is about; empty: everything."""

    text: str
    about: str = ""


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

    kind: ClassVar[str] = "remarks"
    items: tuple[Remark, ...]
    is_warning: bool = False


@dataclass(frozen=True)
class Facts:
    """Names and what belongs to them."""

    kind: ClassVar[str] = "facts"
    rows: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Column:
    """One column of a table.

    Attributes
    ----------
    header : str
        With its unit in brackets, if it has one.
    cells : tuple of str
        One for each row.
    is_text : bool
        Words: on the left. Numbers stand on the right and stay whole.
    """

    header: str
    cells: tuple[str, ...]
    is_text: bool = False

    @property
    def label(self) -> str:
        """The header without its unit."""
        return self.header.partition(" [")[0]

    @property
    def unit(self) -> str:
        """The unit in brackets, or nothing; it stays on one line."""
        return "".join(self.header.partition(" [")[1:]).strip()

    @property
    def style(self) -> str:
        """How it is set: "number", "text", or "prose", which wraps."""
        if not self.is_text:
            return "number"
        is_long = any(len(cell) > LONGEST_LABEL or "\n" in cell for cell in self.cells)
        return "prose" if is_long else "text"


@dataclass(frozen=True)
class Table:
    """A table whose first column names the rows.

    Attributes
    ----------
    caption : str
        Above it.
    columns : tuple of Column
        All with as many cells.
    notes : tuple of str
        Below it.
    marked : frozenset of int
        Rows that stand out, from 0; a word or sign in them says the same.
    """

    kind: ClassVar[str] = "table"
    caption: str
    columns: tuple[Column, ...]
    notes: tuple[str, ...] = ()
    marked: frozenset[int] = frozenset()

    @property
    def is_short(self) -> bool:
        """Whether it is kept on one page of paper."""
        return len(self.rows) <= LONGEST_UNBROKEN

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """The cells row by row."""
        return list(zip(*(column.cells for column in self.columns), strict=True))


@dataclass(frozen=True)
class Picture:
    """A figure of the report."""

    kind: ClassVar[str] = "picture"
    figure: ReportFigure


@dataclass(frozen=True)
class Listing:
    """Text whose lines stay as they are."""

    kind: ClassVar[str] = "listing"
    title: str
    text: str


@dataclass(frozen=True)
class Folded:
    """What is shown when asked for, and always in print."""

    kind: ClassVar[str] = "folded"
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
    facts : tuple of (str, str)
        The few that belong beside the title.
    sections : tuple of Section
        In their order.
    """

    title: str
    subtitle: str
    name: str
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


def make_table(
    caption: str,
    columns: Sequence[Column | None],
    notes: Sequence[str] = (),
    marked: Sequence[int] = (),
) -> Table:
    """Return a table without the columns that are None or have nothing to say."""
    kept = tuple(
        column
        for place, column in enumerate(columns)
        if column is not None
        and (place == 0 or any(cell not in ("", MISSING) for cell in column.cells))
    )
    return Table(caption, kept, tuple(notes), frozenset(marked))


def make_column(header: str, cells: Sequence[str]) -> Column:
    """Return a column of numbers."""
    return Column(header, tuple(cells))


def make_text_column(header: str, cells: Sequence[str]) -> Column:
    """Return a column of words."""
    return Column(header, tuple(cells), is_text=True)


def drop_empty(*sections: Section | None) -> tuple[Section, ...]:
    """Return the sections that have anything to say."""
    return tuple(
        section for section in sections if section and (section.parts or section.sections)
    )
