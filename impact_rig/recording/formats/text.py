"""Columns of numbers in text, read however they were written, and written exactly."""

import csv
import math
import re
from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path

import numpy as np

from impact_rig.core.errors import FileError
from impact_rig.recording.formats.measurement import MeasuredChannel, Measurement
from impact_rig.recording.formats.text_table import Line, Style, parse_columns, read_lines

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
    headings = _find_headings(above, style, len(cells))
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


def _find_headings(above: Sequence[str], style: Style, width: int) -> list[tuple[str, str]]:
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
