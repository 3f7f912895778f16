"""Tables and texts in a terminal: one look for every command, plain when piped.

Nothing is wider than the terminal, and no number is cut: what does not fit side by side stands
line by line. What is piped has no width: its tables are as wide as they need.
"""

import os
import sys
from collections.abc import Iterable, Sequence
from typing import TextIO

from rich import box
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from impact_rig.reporting.terminal.columns import (
    COLUMN_GAP,
    Column,
    choose_columns,
    make_printable,
    share_width,
)
from impact_rig.results.palette import GREEN, VERMILION, format_hex

TITLE = "bold"
NOTE = "dim"
ALARM = f"bold {format_hex(VERMILION)}"
"""What a person must look at."""
WARNING = format_hex(VERMILION)
GOOD = format_hex(GREEN)
"""What is as it should be. The two are told apart by colour-blind readers, and read well on dark
and on light."""
EASY_LINE = 100
"""Width of a paragraph where there is more room [characters], our choice: longer lines are hard
to read."""
UNLIMITED = 10_000
"""Width of what is no terminal [characters], our choice: no table needs as much."""
NO_ESCAPES = ("dumb", "unknown")
"""What TERM says of terminals that can write and nothing else."""


def make_console(*, stderr: bool = False) -> Console:
    """Return a console on standard output or standard error.

    It colours on terminals only, honours NO_COLOR, FORCE_COLOR, TERM and COLUMNS, and takes names
    and messages as they are: brackets in them are no markup. `Console.is_interactive` tells
    whether a person looks at it.
    """
    stream = sys.stderr if stderr else sys.stdout
    can_move = stream.isatty() and os.environ.get("TERM", "").lower() not in NO_ESCAPES
    return Console(
        stderr=stderr,
        markup=False,
        highlight=False,
        emoji=False,
        width=_find_width(stream, can_move=can_move),
        # A pipe that is to be coloured is still a pipe.
        force_interactive=None if can_move else False,
    )


def _find_width(stream: TextIO, *, can_move: bool) -> int | None:
    """Return how wide a stream is [characters]; None: rich finds that out, time and again."""
    if can_move or os.environ.get("COLUMNS", "").isdigit():
        return None
    try:
        return os.get_terminal_size(stream.fileno()).columns or None
    except (OSError, ValueError):
        return UNLIMITED


def print_table(
    console: Console, title: str, columns: Sequence[Column], notes: Iterable[str] = ()
) -> None:
    """Print a title, a table, notes below it, and an empty line.

    Optional columns that the terminal is too narrow for are left out, and named. Where the others
    do not fit side by side either, every row stands line by line.

    Parameters
    ----------
    console : Console
        Where to.
    title : str
        Above the table.
    columns : sequence of Column
        All with as many cells; the first names the rows.
    notes : iterable of str
        Paragraphs below the table.
    """
    shown, left_out = choose_columns(columns, console.width)
    print_text(console, title, TITLE)
    widths = share_width(shown, console.width)
    if widths is None:
        _print_rows(console, shown)
    else:
        console.print(_make_table(shown, widths))
    for note in (*notes, *(column.note for column in shown if column.note)):
        print_text(console, note, NOTE)
    if left_out:
        names = ", ".join(column.name for column in left_out)
        print_text(console, f"A wider terminal shows {names} as well.", NOTE)
    console.print()


def print_text(console: Console, text: str | Text, style: str = "") -> None:
    """Print a paragraph, in lines that are easily read."""
    shown = Text(make_printable(text), style) if isinstance(text, str) else text
    console.print(shown, width=min(console.width, EASY_LINE))


def print_warning(text: str) -> None:
    """Print on standard error what a person must know, in one line."""
    console = make_console(stderr=True)
    console.print(Text.assemble(("warning: ", ALARM), make_printable(text)), soft_wrap=True)


def print_item(console: Console, text: str, style: str = "") -> None:
    """Print an item of a list, its lines below each other."""
    table = Table.grid(padding=(0, 1, 0, 0))
    table.add_row(Text("-", style), Text(make_printable(text), style, overflow="fold"))
    console.print(table, width=min(console.width, EASY_LINE))


def _make_table(columns: Sequence[Column], widths: Sequence[int]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)
    for column, width in zip(columns, widths, strict=True):
        table.add_column(
            Text(column.header),
            width=width,
            justify="left" if column.is_text else "right",
            overflow="fold",
        )
    for cells in zip(*map(_make_cells, columns), strict=True):
        table.add_row(*cells)
    return table


def _print_rows(console: Console, columns: Sequence[Column]) -> None:
    """Print the rows one below the other: each cell has a line of its own."""
    names, *others = map(_make_cells, columns)
    for name, *cells in zip(names, *others, strict=True):
        if name:
            console.print(name)
        table = Table.grid(padding=(0, len(COLUMN_GAP), 0, 0))
        table.add_column(overflow="fold")
        table.add_column(overflow="fold")
        for column, cell in zip(columns[1:], cells, strict=True):
            if cell:
                table.add_row(column.name, cell)
        console.print(Padding(table, (0, 0, 0, len(COLUMN_GAP)), expand=False))


def _make_cells(column: Column) -> list[Text]:
    styles = column.styles or [""] * len(column.cells)
    return [
        Text(make_printable(cell), style) for cell, style in zip(column.cells, styles, strict=True)
    ]
