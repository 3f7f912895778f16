"""Tables and texts in a terminal, alike in every command, plain in a pipe.

Nothing is wider than the terminal, and no number is cut: a table that does not fit is printed line
by line. Tables in a pipe are as wide as they need.
"""

import os
import sys
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from io import StringIO
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TextIO

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType
from rich.measure import Measurement
from rich.padding import Padding
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from impact_rig.results.palette import GREEN, VERMILION, format_hex
from impact_rig.results.table import Column
from impact_rig.results.table import Table as ResultTable

if TYPE_CHECKING:
    from impact_rig.core.given.records import RawArray

TITLE = "bold"
NOTE = "dim"
ALARM = f"bold {format_hex(VERMILION)}"
"""Style of things that a person must look at."""
WARNING = format_hex(VERMILION)
GOOD = format_hex(GREEN)
"""Style of a good state. Colour-blind readers can tell the two apart on dark and light ground."""
EASY_LINE = 100
"""Largest width of a paragraph [characters]: longer lines are hard to read."""
LONGEST_HEADER = 12
"""Width at which the header of a column wraps [characters]."""
UNLIMITED = 10_000
"""Width of a pipe [characters]: no table needs as much."""
COLUMN_GAP = "  "
NARROWEST_TEXT = 10
"""Smallest width of a column of texts [characters]."""
EASY_TEXT = 30
"""Width of texts below which a column is left out [characters]: about five words."""
TRACE_LINES = 8
"""Height of a drawn trace [lines]."""
NO_ESCAPES = ("dumb", "unknown")
"""TERM of terminals without escape sequences."""


class _SafeConsole(Console):
    """A console on which no text is markup or moves the cursor: names may come from files."""

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, highlight=False, emoji=False, **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterator[Segment]:
        """Yield what is written: rich's own control codes, and printable text."""
        for segment in super().render(renderable, options):
            yield (
                segment if segment.control else segment._replace(text=make_printable(segment.text))
            )


def make_console(*, stderr: bool = False) -> Console:
    """Return a console on standard output or standard error.

    It colours on terminals only, and honours NO_COLOR, FORCE_COLOR, TERM and COLUMNS. Brackets in
    texts are no markup. `Console.is_interactive` says whether it is a terminal.
    """
    stream = sys.stderr if stderr else sys.stdout
    can_move = stream.isatty() and os.environ.get("TERM", "").lower() not in NO_ESCAPES
    return _SafeConsole(
        stderr=stderr,
        width=_measure_stream(stream, can_move=can_move),
        # A pipe that is to be coloured is still a pipe.
        force_interactive=None if can_move else False,
    )


def _measure_stream(stream: TextIO, *, can_move: bool) -> int | None:
    """Return the width of a stream [characters]; None: rich measures it again and again."""
    if can_move or os.environ.get("COLUMNS", "").isdigit():
        return None
    try:
        return os.get_terminal_size(stream.fileno()).columns or None
    except (OSError, ValueError):
        return UNLIMITED


def print_table(console: Console, table: "ResultTable") -> None:
    """Print a table below its caption, notes below it, and an empty line.

    Rows that stand out are coloured. Optional columns that the terminal is too narrow for are left
    out, and named. Where the others do not fit side by side either, every row stands line by line.
    """
    styles = [WARNING if place in table.marked else "" for place in range(len(table.rows))]
    shown = list(table.columns)
    optional = [column for column in shown if column.is_optional]
    left_out: list[Column] = []
    while optional and not _has_room(console, _make_table(shown, styles, EASY_TEXT)):
        left_out.insert(0, optional.pop())
        shown.remove(left_out[0])
    print_text(console, table.caption, TITLE)
    grid = _make_table(shown, styles, NARROWEST_TEXT)
    if _has_room(console, grid):
        console.print(grid)
    else:
        _print_rows(console, shown, styles)
    for note in (*table.notes, *(column.note for column in shown if column.note)):
        print_text(console, note, NOTE)
    if left_out:
        names = ", ".join(column.header for column in left_out)
        print_text(console, f"A wider terminal shows {names} as well.", NOTE)
    console.print()


def format_tables(tables: "Iterable[ResultTable]") -> str:
    """Return tables as text, as wide as they need."""
    stream = StringIO()
    console = _SafeConsole(file=stream, width=UNLIMITED, color_system=None, force_jupyter=False)
    for table in tables:
        print_table(console, table)
    return "\n".join(line.rstrip() for line in stream.getvalue().splitlines()).rstrip()


def make_printable(text: str) -> str:
    """Return a text without characters that would move the cursor."""
    return "".join(letter if letter.isprintable() or letter == "\n" else "�" for letter in text)


def print_text(console: Console, text: str | Text, style: str = "") -> None:
    """Print a paragraph in lines of a readable length."""
    shown = Text(text, style) if isinstance(text, str) else text
    console.print(shown, width=min(console.width, EASY_LINE))


def print_warning(text: str) -> None:
    """Print a warning on standard error, in one line."""
    console = make_console(stderr=True)
    console.print(Text.assemble(("warning: ", ALARM), text), soft_wrap=True)


def print_item(console: Console, text: str) -> None:
    """Print an item of a list, indented."""
    table = Table.grid(padding=(0, 1, 0, 0))
    table.add_row("-", Text(make_printable(text), overflow="fold"))
    console.print(table, width=min(console.width, EASY_LINE))


def print_trace(console: Console, title: str, values: "RawArray") -> None:
    """Draw a trace below its title: in each column stands what its points reach over."""
    import numpy as np  # most commands need it not

    width = min(console.width, EASY_LINE)
    pieces = np.array_split(values.astype(np.float64), min(width, values.size))
    low, high = float(values.min()), float(values.max())
    print_text(console, f"{title}: {low:.4g} to {high:.4g}, {values.size} points", NOTE)
    edges = np.linspace(high, low, TRACE_LINES + 1)
    for above, below in pairwise(edges.tolist()):
        cells = ("█" if p.max() >= below and p.min() <= above else " " for p in pieces)
        console.print("".join(cells).rstrip())


def print_facts(console: Console, rows: Iterable[Sequence[str | Text]]) -> None:
    """Print rows without a header, and an empty line; long texts are folded."""
    table = Table.grid(padding=(0, len(COLUMN_GAP), 0, 0))
    for row in rows:
        cells = [item if isinstance(item, Text) else Text(make_printable(item)) for item in row]
        cells[-1].overflow = "fold"
        table.add_row(*cells)
    console.print(table)
    console.print()


def _make_table(columns: "Sequence[Column]", styles: Sequence[str], narrowest: int) -> Table:
    """Return a table whose texts wrap down to a width, whose numbers never do."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)
    for column in columns:
        header = "\n".join([*textwrap.wrap(column.label, LONGEST_HEADER), column.unit]).strip()
        texts = [make_printable(text) for text in (header, *column.cells)]
        word = max(cell_len(word) for text in texts for word in (*text.split(), ""))
        line = max(cell_len(line) for text in texts for line in text.split("\n"))
        table.add_column(
            Text(header),
            justify="left" if column.is_text else "right",
            overflow="fold",
            width=None if column.is_text else line,
            min_width=min(max(narrowest, min(word, EASY_TEXT)), line) if column.is_text else None,
        )
    rows = zip(*map(_make_cells, columns), strict=True)
    for style, cells in zip(styles, rows, strict=True):
        table.add_row(*cells, style=style)
    return table


def _has_room(console: Console, table: Table) -> bool:
    """Return whether a table's numbers and longest words have room side by side."""
    options = console.options.update(width=UNLIMITED)
    return Measurement.get(console, options, table).minimum <= console.width


def _print_rows(console: Console, columns: "Sequence[Column]", styles: Sequence[str]) -> None:
    """Print each cell in a line, row by row."""
    rows = zip(*map(_make_cells, columns), strict=True)
    for style, (name, *cells) in zip(styles, rows, strict=True):
        if name:
            console.print(name, style=style)
        table = Table.grid(padding=(0, len(COLUMN_GAP), 0, 0))
        table.add_column(overflow="fold")
        table.add_column(overflow="fold")
        for column, cell in zip(columns[1:], cells, strict=True):
            if cell:
                table.add_row(Text(column.header), cell, style=style)
        console.print(Padding(table, (0, 0, 0, len(COLUMN_GAP)), expand=False))


def _make_cells(column: "Column") -> list[Text]:
    return [Text(make_printable(cell)) for cell in column.cells]
