"""A table: its columns, cells and notes, before anything shows it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any

from impact_rig.core.given.quantity import Quantity
from impact_rig.results.numbers import MISSING, SCALES, format_number, format_quantity

LONGEST_UNBROKEN = 24
"""Rows of a table that are kept on one page of paper [-], our choice: a third of it."""
LONGEST_LABEL = 28
"""Characters of words in a cell that stay on one line [-], our choice."""


@dataclass(frozen=True)
class Column:
    """One column of a table."""

    header: str  # with its unit in brackets, if it has one
    cells: Sequence[str]  # one per row
    is_text: bool = False  # words stand on the left and may wrap; numbers do neither
    is_optional: bool = False  # left out where there is too little room for it
    note: str = ""  # an explanation below the table, if the column is shown

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
    """A table whose first column names the rows."""

    caption: str
    columns: tuple[Column, ...]  # all with as many cells
    notes: tuple[str, ...] = ()
    marked: frozenset[int] = frozenset()  # rows that stand out, from 0; a word in them, too

    @property
    def explanations(self) -> tuple[str, ...]:
        """Its notes, and in one more what its columns say."""
        by_columns = " ".join(dict.fromkeys(filter(None, (it.note for it in self.columns))))
        return (*self.notes, by_columns) if by_columns else self.notes

    @property
    def is_short(self) -> bool:
        """Whether it is kept on one page of paper."""
        return len(self.rows) <= LONGEST_UNBROKEN

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """The cells row by row."""
        return list(zip(*(column.cells for column in self.columns), strict=True))


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


def list_table(
    caption: str,
    columns: Sequence[Column | None],
    notes: Sequence[str] = (),
    marked: Sequence[int] = (),
) -> list[Table]:
    """Return a table as `make_table`; none if nothing stands beside the names of its rows."""
    table = make_table(caption, columns, notes, marked)
    return [table] if table.rows and len(table.columns) > 1 else []


def make_optional(header: str, cells: Sequence[str], *, is_text: bool = False) -> Column:
    """Return a column that is left out where there is no room."""
    return Column(header, tuple(cells), is_text=is_text, is_optional=True)


def make_text_column(header: str, cells: Sequence[str]) -> Column:
    """Return a column of words."""
    return Column(header, tuple(cells), is_text=True)


def read_column(
    header: str, bodies: Sequence[Any], name: str, digits: int, note: str = ""
) -> Column:
    """Return a column of one attribute of every body, a quantity or a number.

    Parameters
    ----------
    header : str
        Its unit in brackets says the scale.
    name : str
        Of the attribute; with dots that of an attribute's.
    digits : int
        Decimals where there is no uncertainty.
    """
    column = Column(header, (), note=note)
    scale = SCALES[column.unit.strip("[]")]
    cells = (
        format_quantity(value, digits, scale)
        if isinstance(value, Quantity)
        else format_number(value * scale, digits)
        for value in map(attrgetter(name), bodies)
    )
    return replace(column, cells=tuple(cells))


def read_optional(
    header: str, bodies: Sequence[Any], name: str, digits: int, note: str = ""
) -> Column:
    """Return a column as `read_column`, left out where there is no room."""
    return replace(read_column(header, bodies, name, digits, note), is_optional=True)
