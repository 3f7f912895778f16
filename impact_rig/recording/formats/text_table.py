"""Lines of numbers, and the columns that they make."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from impact_rig.core.errors import FileError
from impact_rig.core.signals.record import FloatArray

LINE_ENDS = re.compile(r"\r\n|\r|\n")
WIDE_MARKS = (b"\xff\xfe", b"\xfe\xff")
"""Beginnings of text in two bytes for each letter, as LabVIEW and spreadsheets write it, too."""
SHOWN_LETTERS = 40
"""Of a cell that is no number, in a message; our choice."""


class Line(NamedTuple):
    """A line that is not blank, and its number in the file, counted from 1."""

    number: int
    text: str


class Style(NamedTuple):
    """How a file parts its columns (None: by blanks), and whether its decimal sign is a comma."""

    delimiter: str | None = None
    has_decimal_comma: bool = False

    def split(self, line: str) -> list[str]:
        """Return the cells of a line, without blanks around them."""
        if self.delimiter is None:
            return line.split()
        return [cell.strip(' \t"') for cell in line.split(self.delimiter)]

    def is_number(self, cell: str) -> bool:
        """Tell whether a cell holds a number."""
        try:
            float(self.make_point(cell))
        except ValueError:
            return False
        return True

    def make_point(self, cell: str) -> str:
        """Return a cell with a decimal point."""
        return cell.replace(",", ".") if self.has_decimal_comma else cell


def read_lines(path: Path) -> list[Line]:
    """Return the lines of a text file that are not blank.

    Raises
    ------
    FileError
        If it is no text.
    """
    data = path.read_bytes()
    try:
        text = data.decode("utf-16" if data.startswith(WIDE_MARKS) else "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    if "\0" in text:
        raise FileError(f"{path} is no text: it holds bytes of zero")
    # The last sign of old text files is one that ends the file.
    texts = (line.strip(" \x1a") for line in LINE_ENDS.split(text))
    lines = (Line(number, line) for number, line in enumerate(texts, start=1))
    return [line for line in lines if line.text.strip()]


def parse_columns(
    path: Path, lines: Sequence[Line], style: Style, width: int
) -> tuple[FloatArray, ...]:
    """Make columns of lines of numbers.

    Parameters
    ----------
    path : Path
        Of the file, for messages.
    lines : sequence of Line
        Those of the numbers.
    style : Style
        How the columns are parted.
    width : int
        Number of columns; cells beyond must be blank.

    Returns
    -------
    tuple of ndarray, each shape (points,)
        As many as `width`; a column may end before the others do.

    Raises
    ------
    FileError
        If a line has more or fewer cells, or a cell above a column's end is no number.
    """
    rows = []
    for number, text in lines:
        cells = style.split(text)
        if len(cells) < width or any(cells[width:]):
            count = len(cells) - (len(cells) > 1 and not cells[-1])
            raise FileError(f"{path}, line {number}: {count} columns, above there are {width}")
        rows.append(cells)
    return tuple(
        _parse_column(path, lines, style, [row[index] for row in rows]) for index in range(width)
    )


def _parse_column(path: Path, lines: Sequence[Line], style: Style, cells: list[str]) -> FloatArray:
    count = len(cells)
    while count and not cells[count - 1]:
        count -= 1
    try:
        return np.array([float(style.make_point(cell)) for cell in cells[:count]], np.float64)
    except ValueError:
        index = next(i for i, cell in enumerate(cells) if not style.is_number(cell))
        shown = cells[index][:SHOWN_LETTERS]
        raise FileError(f"{path}, line {lines[index].number}: {shown!r} is no number") from None
