"""Columns of numbers in text, read however they were written, and written exactly."""

import csv
import math
import re
from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple

import numpy as np

from impact_rig.core.errors import FileError
from impact_rig.core.signals.record import FloatArray
from impact_rig.recordings.formats.measurement import MeasuredChannel, Measurement

LINE_ENDS = re.compile(r"\r\n|\r|\n")
WIDE_MARKS = (b"\xff\xfe", b"\xfe\xff")
"""Beginnings of text in two bytes for each letter, as LabVIEW and spreadsheets write it, too."""
SHOWN_LETTERS = 40
"""Of a cell that is no number, in a message; our choice."""
COMMENT_MARKS = ("#", "%", "//")
"""Beginnings of lines that are no numbers."""
BLANKS_AND_MARKS = " \t#%/"

HEADING = re.compile(r"(?P<name>.*?)\s*(?:\[(?P<unit>[^\[\]]*)\]|\((?P<other>[^()]*)\))")
"""A column's name and unit: `hammer [m/s^2]` or `hammer (m/s^2)`."""
UNIT = re.compile(r"\[[^\[\]]*\]|\([^()]*\)")
"""A unit in a line of its own below the names."""
QUOTED = re.compile(r'"(?P<text>[^"]*)"')
STATED = re.compile(r"\W*(?P<key>sampling rate \[Hz\]|start \[s\]): (?P<value>\S+)\s*")
"""What files written here state above the names, since times as printed may not tell."""
RATE, START = "sampling rate [Hz]", "start [s]"
TIME = "time"


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

    def parse(self, path: Path, cells: Sequence[str], lines: Sequence[int]) -> FloatArray:
        """Return the numbers in some cells, each in the line of a number; raises `FileError`."""
        try:
            return np.array([float(self.make_point(cell)) for cell in cells], np.float64)
        except ValueError:
            line, cell = next(
                item for item in zip(lines, cells, strict=True) if not self.is_number(item[1])
            )
            raise FileError(
                f"{path}, line {line}: {cell[:SHOWN_LETTERS]!r} is no number"
            ) from None

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
    numbers = [number for number, _ in lines]
    return tuple(
        _parse_column(path, numbers, style, [row[index] for row in rows]) for index in range(width)
    )


def _parse_column(path: Path, lines: list[int], style: Style, cells: list[str]) -> FloatArray:
    while cells and not cells[-1]:
        cells.pop()
    return style.parse(path, cells, lines[: len(cells)])


def read_text(path: Path) -> Measurement:
    """Read the columns of a text file.

    Columns are parted by semicolon, tab, comma or blanks, with a decimal point or (not beside
    commas) a decimal comma. Names and units are taken from the lines above the numbers. A column
    may end before the others do. A column of times is a channel like the others, unless the file
    states its sampling rate beside it, as those of `write_text` do.

    Parameters
    ----------
    path : Path
        Of the file.

    Returns
    -------
    Measurement

    Raises
    ------
    FileError
        If the file is not of numbers in columns.
    """
    lines = read_lines(path)
    plain = [
        Line(number, QUOTED.sub(_take_out, text))
        for number, text in lines
        if not text.startswith(COMMENT_MARKS)
    ]
    first, style = _find_first(path, plain)
    cells = style.split(plain[first].text)
    above = [line.text for line in lines if line.number < plain[first].number]
    headings = _read_headings(above, style, len(cells))
    has_last = bool(cells[-1] or headings[-1][0])
    columns = parse_columns(path, plain[first:], style, len(cells) - (not has_last))
    stated = {
        match["key"]: _read_number(path, match["value"])
        for match in map(STATED.fullmatch, above)
        if match
    }
    channels = tuple(
        MeasuredChannel(
            name=name or f"column {number}",
            values=values,
            sampling_rate=stated.get(RATE, math.nan),
            unit=unit,
            start=stated.get(START, 0.0),
        )
        for number, ((name, unit), values) in enumerate(zip(headings, columns, strict=False), 1)
    )
    has_time = RATE in stated and channels[0].name == TIME and len(channels) > 1
    return Measurement(path, channels[1:] if has_time else channels)


def _take_out(match: re.Match[str]) -> str:
    """Return what is in quotes if it may be a number; a name could have delimiters in it."""
    return match["text"] if Style(None, has_decimal_comma=True).is_number(match["text"]) else ""


def _find_first(path: Path, lines: Sequence[Line]) -> tuple[int, Style]:
    """Return the index of the first line of numbers, and how their columns are parted."""
    with_numbers = []
    for index, line in enumerate(lines):
        style = _guess_style(line.text.strip())
        cells = [style.is_number(cell) for cell in style.split(line.text) if cell]
        if cells and all(cells):
            return index, style
        if any(cells):
            with_numbers.append((index, style))
    if not with_numbers:
        raise FileError(f"{path} holds no numbers: it should have columns of them")
    return with_numbers[0]


def _guess_style(line: str) -> Style:
    """Return how the columns of a line of numbers are parted."""
    for delimiter in (";", "\t"):
        if delimiter in line:
            return Style(delimiter, "," in line and "." not in line)
    if "," not in line:
        return Style()
    commas, blanks = Style(","), Style(None, has_decimal_comma=True)
    if all(map(commas.is_number, filter(None, commas.split(line)))):
        return commas
    return blanks if all(map(blanks.is_number, blanks.split(line))) else commas


def _read_headings(above: Sequence[str], style: Style, width: int) -> list[tuple[str, str]]:
    """Return name and unit of each column; both empty where the file states none."""
    candidates = [cells for line in above if (cells := _split_heading(line, style, width))]
    units = None
    if candidates and all(map(UNIT.fullmatch, candidates[-1])):
        units = [cell[1:-1].strip() for cell in candidates.pop()]
    names = [_split_name(cell) for cell in candidates[-1]] if candidates else [("", "")] * width
    if units is None:
        return names
    return [(name, unit) for (name, _), unit in zip(names, units, strict=True)]


def _split_heading(line: str, style: Style, width: int) -> list[str] | None:
    """Return the cells of a line above the numbers; None: it is no line of headings."""
    text = line.lstrip(BLANKS_AND_MARKS) if line.startswith(COMMENT_MARKS) else line
    delimiters = (style.delimiter,) if style.delimiter else (",", ";", "\t")
    splits = [
        [cell.strip() for cell in next(csv.reader([text], delimiter=delimiter))]
        for delimiter in delimiters
        if delimiter in text or width == 1
    ]
    if style.delimiter is None:
        splits.append(text.split())
    for cells in splits:
        if len(cells) == width - 1:
            cells.append("")  # the lines of numbers end with a delimiter
        if len(cells) == width and all(cells[: max(width - 1, 1)]):
            return cells
    return None


def _split_name(cell: str) -> tuple[str, str]:
    match = HEADING.fullmatch(cell)
    if match is None:
        return cell, ""
    return match["name"], (match["unit"] or match["other"] or "").strip()


def _read_number(path: Path, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise FileError(f"{path} states {text!r}: it should be a number") from None


def write_text(path: Path, measurement: Measurement) -> None:
    """Write channels as columns parted by commas, beside their time.

    Every number is written with the digits that bring it back bit by bit. Line breaks in names
    become blanks.

    Parameters
    ----------
    path : Path
        Of the new file.
    measurement : Measurement
        Its channels must have one sampling rate and start, and one point at least.

    Raises
    ------
    FileError
        If they do not.
    """
    channels = measurement.channels
    points = max(channel.values.size for channel in channels)
    rate, start = channels[0].sampling_rate, channels[0].start
    if len({(repr(channel.sampling_rate), channel.start) for channel in channels}) > 1:
        raise FileError(
            f"{measurement.path}: its channels have different rates or starts; columns of text"
            " share their time: choose another format, or one file for each"
        )
    if points == 0:
        raise FileError(f"{measurement.path}: its channels have no points: text cannot show that")
    columns = [channel.values.tolist() for channel in channels]
    headings = [_make_heading(channel.name, channel.unit) for channel in channels]
    with path.open("w", encoding="utf-8", newline="") as file:
        if not math.isnan(rate):
            file.write(f"# {RATE}: {rate!r}\n# {START}: {start!r}\n")
            columns.insert(0, (start + np.arange(points) / rate).tolist())
            headings.insert(0, f"{TIME} [s]")
        csv.writer(file, lineterminator="\n", quoting=csv.QUOTE_ALL).writerow(headings)
        csv.writer(file, lineterminator="\n").writerows(zip_longest(*columns, fillvalue=""))


def _make_heading(name: str, unit: str) -> str:
    name = " ".join(name.split())
    is_clear = name and not HEADING.fullmatch(name) and not Style().is_number(name)
    return name if is_clear and not unit else f"{name} [{unit}]"
