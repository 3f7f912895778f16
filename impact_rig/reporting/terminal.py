"""Tables in a terminal: one look for every command, plain when piped, never wider than it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from impact_rig.results.numbers import MISSING

COLUMN_GAP = "  "
NARROWEST_TEXT = 10
"""Down to where words may wrap so that numbers stay whole [characters]."""


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
    """

    header: str
    cells: Sequence[str]
    is_text: bool = False
    is_optional: bool = False


def make_optional(header: str, cells: Sequence[str]) -> Column:
    """Return a column of numbers that a narrow terminal leaves out."""
    return Column(header, cells, is_optional=True)


def make_console(*, stderr: bool = False) -> Console:
    """Return a console on standard output or standard error.

    It colours on terminals only, honours NO_COLOR, and takes names and messages as they are:
    brackets in them are no markup.
    """
    return Console(stderr=stderr, markup=False, highlight=False, emoji=False)


def print_table(
    console: Console, title: str, columns: Sequence[Column], notes: Iterable[str] = ()
) -> None:
    """Print a title, a table, notes below it, and an empty line.

    Optional columns without a single number are left out, and then further ones from the right
    until the table fits.

    Parameters
    ----------
    console : Console
        Where to.
    title : str
        Above the table.
    columns : sequence of Column
        All with as many cells.
    notes : iterable of str
        Paragraphs below the table.
    """
    table = _make_table(_choose_columns(console, list(columns)), console.width)
    console.print(Text(title, style="bold"))
    console.print(table)
    for note in notes:
        console.print(Text(note, style="dim"))
    console.print()


def _choose_columns(console: Console, columns: list[Column]) -> list[Column]:
    columns = [
        column
        for column in columns
        if not column.is_optional or any(cell not in ("", MISSING) for cell in column.cells)
    ]
    while _find_natural_width(columns) > console.width:
        optional = [column for column in columns if column.is_optional]
        if not optional:
            break
        columns.remove(optional[-1])
    return columns


def _find_natural_width(columns: Sequence[Column]) -> int:
    """Return the width at which no cell wraps [characters]."""
    return sum(map(_find_column_width, columns)) + len(COLUMN_GAP) * (len(columns) - 1)


def _find_column_width(column: Column) -> int:
    lines = [line for text in (column.header, *column.cells) for line in text.split("\n")]
    return max(map(cell_len, lines))


def _make_table(columns: Sequence[Column], width: int) -> Table:
    # Where even narrow words leave no room for numbers, these wrap rather than lose digits.
    narrowest = [
        Column("w" * min(NARROWEST_TEXT, _find_column_width(column)), ())
        if column.is_text
        else column
        for column in columns
    ]
    keep_whole = _find_natural_width(narrowest) <= width
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)
    for column in columns:
        table.add_column(
            Text(column.header),
            justify="left" if column.is_text else "right",
            no_wrap=keep_whole and not column.is_text,
            overflow="fold",
        )
    for cells in zip(*(column.cells for column in columns), strict=True):
        table.add_row(*(Text(cell) for cell in cells))
    return table
