"""Columns of a table in a terminal, and which of them a terminal has room for."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from rich.cells import cell_len

from impact_rig.results.numbers import MISSING

COLUMN_GAP = "  "
NARROWEST_TEXT = 10
"""Down to where words may wrap so that numbers stay whole [characters], our choice."""
EASY_TEXT = 30
"""Down to where words wrap before a column is left out for them [characters], our choice: five
words or so."""


@dataclass(frozen=True)
class Column:
    """One column of a table.

    Attributes
    ----------
    header : str
        A new line in it starts its second line.
    cells : sequence of str
        One per row.
    is_text : bool
        Words: on the left, free to wrap. Numbers stand on the right and stay whole.
    is_optional : bool
        Left out where the terminal is too narrow for it.
    styles : sequence of str
        How the cells look, one per row; empty: plain. What a colour says, the cell says too.
    note : str
        A sentence on what the column is; stands below the table if the column is shown.
    """

    header: str
    cells: Sequence[str]
    is_text: bool = False
    is_optional: bool = False
    styles: Sequence[str] = ()
    note: str = ""

    @property
    def name(self) -> str:
        """The header in one line."""
        return re.sub(r"(?<=[-/])\n", "", self.header).replace("\n", " ")

    @cached_property
    def width(self) -> int:
        """Width at which no cell wraps [characters]."""
        return max(cell_len(line) for text in self._texts for line in text.split("\n"))

    @cached_property
    def narrowest(self) -> int:
        """Width down to which words may wrap [characters]: hardly any is broken."""
        longest = max(cell_len(word) for text in self._texts for word in (*text.split(), ""))
        return min(max(NARROWEST_TEXT, longest), EASY_TEXT)

    @property
    def _texts(self) -> list[str]:
        return [make_printable(text) for text in (self.header, *self.cells)]


def make_optional(
    header: str, cells: Sequence[str], note: str = "", styles: Sequence[str] = ()
) -> Column:
    """Return a column of numbers that a narrow terminal leaves out."""
    return Column(header, cells, is_optional=True, note=note, styles=styles)


def make_printable(text: str) -> str:
    """Return a text without what would move the cursor: names may come from anywhere."""
    return "".join(letter if letter.isprintable() or letter == "\n" else "�" for letter in text)


def leave_out_repeated(cells: Sequence[str]) -> list[str]:
    """Return the cells, empty where the row above has the same."""
    return ["" if index and cells[index - 1] == cell else cell for index, cell in enumerate(cells)]


def choose_columns(columns: Sequence[Column], width: int) -> tuple[list[Column], list[Column]]:
    """Return the columns that are shown, and those that there is no room for.

    Optional columns without a single number are in neither. Further ones are left out from the
    right until the others fit.

    Parameters
    ----------
    columns : sequence of Column
        All.
    width : int
        Of the terminal [characters].
    """
    shown = [
        column
        for column in columns
        if not column.is_optional or any(cell not in ("", MISSING) for cell in column.cells)
    ]
    left_out: list[Column] = []
    while _add_widths(_find_widths(shown, EASY_TEXT)) > width:
        optional = [column for column in shown if column.is_optional]
        if not optional:
            break
        shown.remove(optional[-1])
        left_out.insert(0, optional[-1])
    return shown, left_out


def share_width(columns: Sequence[Column], width: int) -> list[int] | None:
    """Return the widths of columns side by side [characters]: words share what numbers leave.

    None: there is no room for them side by side.
    """
    for text_width in range(max(column.width for column in columns), 0, -1):
        widths = _find_widths(columns, text_width)
        if _add_widths(widths) <= width:
            return widths
    return None


def _find_widths(columns: Sequence[Column], text_width: int) -> list[int]:
    """Return the widths where texts take so much, as far as they can do with it."""
    return [
        min(column.width, max(text_width, column.narrowest)) if column.is_text else column.width
        for column in columns
    ]


def _add_widths(widths: Sequence[int]) -> int:
    return sum(widths) + len(COLUMN_GAP) * (len(widths) - 1)
