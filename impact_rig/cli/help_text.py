"""Help that is never wider than the terminal."""

import re
import shutil
import textwrap
from collections.abc import Iterable
from itertools import groupby

import click

WIDEST = 80
"""Of help, also on a wider terminal [characters]; click's default."""
NARROWEST = 20
"""No help is made for narrower terminals [characters], our choice."""
WIDEST_NAMES = 30
"""Of the column of options [characters]; click's default."""
HANGING_INDENT = 2
"""Of the second line of what was one, as an example [characters]."""

_GAP = re.compile(r" {2,}")
"""Between an example and what it is for."""


class HelpFormatter(click.HelpFormatter):
    """click's formatter, for terminals of any width.

    click makes no help narrower than 50, and leaves lines as they are that are not to be
    filled, as those of the examples.
    """

    def __init__(self) -> None:
        columns = shutil.get_terminal_size().columns
        super().__init__(width=max(min(columns, WIDEST), NARROWEST) - 1)

    def write_text(self, text: str) -> None:
        """Write paragraphs; break what click leaves too long."""
        inner = self._make_inner()
        inner.write_text(text)
        for is_outer, group in groupby(inner.getvalue().splitlines(), key=self._is_outer):
            lines = list(group)
            self._write_lines(self._fill(lines) if is_outer else lines)

    def write_dl(
        self,
        rows: Iterable[tuple[str, str]],
        col_max: int = WIDEST_NAMES,
        col_spacing: int = 2,
    ) -> None:
        """Write a list of names and explanations; names take two fifths at most."""
        inner = self._make_inner()
        room = self.width - self.current_indent
        inner.write_dl(rows, min(col_max, 2 * room // 5), col_spacing)
        self._write_lines(inner.getvalue().splitlines())

    def _make_inner(self) -> click.HelpFormatter:
        inner = click.HelpFormatter(width=self.width)
        inner.current_indent = self.current_indent
        return inner

    def _write_lines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write("".join(f"{piece}\n" for piece in self._break(line)))

    def _is_outer(self, line: str) -> bool:
        """Whether a line is prose: examples and lists are indented further."""
        return line.startswith(" " * self.current_indent) and not line[
            self.current_indent :
        ].startswith(" ")

    def _fill(self, lines: list[str]) -> list[str]:
        """Return prose, filled anew if a line of it is too long."""
        if all(len(line) <= self.width for line in lines):
            return lines
        indent = " " * self.current_indent
        return self._wrap(indent + " ".join(line.strip() for line in lines), indent)

    def _break(self, line: str) -> list[str]:
        """Return a line, or what it breaks into: what stands apart in it gets its own line."""
        if len(line) <= self.width:
            return [line]
        indent = " " * (len(line) - len(line.lstrip()))
        hanging = indent + " " * HANGING_INDENT
        first, *others = _GAP.split(line.strip())
        pieces = self._wrap(indent + first, hanging)
        return pieces + [
            piece for other in others for piece in self._wrap(hanging + other, hanging)
        ]

    def _wrap(self, text: str, indent: str) -> list[str]:
        return textwrap.wrap(text, self.width, subsequent_indent=indent, break_on_hyphens=False)


class HelpContext(click.Context):
    """A context whose help is written by `HelpFormatter`."""

    def make_formatter(self) -> click.HelpFormatter:
        """Return a formatter for the terminal at hand."""
        return HelpFormatter()
