"""LabVIEW's measurement files (`.lvm`).

Read here and not by the library lvm_read (1.26): that one makes NaN of whatever is no number and
of what is cut off, takes columns of times for channels, leaves step, start and length of each
channel to the caller, and unpickles any `.lvm.pkl` that lies beside the file.
"""

import datetime as dt
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path

import numpy as np

from impact_rig.core.given.errors import FileError
from impact_rig.core.given.records import FloatArray
from impact_rig.files.formats.text import (
    NOTHING,
    NUMBER,
    Layout,
    RowReader,
    Style,
    TextLine,
    read_pieces,
    read_text,
    split_lines,
)
from impact_rig.files.measurement import NANOSECONDS, MeasuredChannel, Measurement
from impact_rig.files.times import round_rate

X_VALUE = "X_Value"
"""Heading of every column of times."""
FIRST_WORDS, END_OF_HEADER = "LabVIEW Measurement", "***End_of_Header***"
SEGMENT_TAGS = {"Channels", "Samples", "Delta_X"}
"""Statements of a table's header that the file's header does not have."""
SEPARATORS = {"Tab": "\t", "Comma": ","}
SPECIAL = re.compile(r"(?ms)^ *\*{3}Start_Special\*{3}.*?(^ *\*{3}End_Special\*{3}|\Z)")
"""Columns that a program adds for itself."""


@dataclass(frozen=True)
class LabviewSegment:
    """A table of numbers with what its header states."""

    path: Path
    number: int  # in the file, counted from 1
    style: Style  # how its numbers are written
    headings: list[str]  # of its columns
    # Lines of its header by their first cell; the other cells stand below their columns.
    tags: dict[str, list[str]]
    rows: list[TextLine] = field(default_factory=list)  # with a cell for each heading

    def get_tag(self, key: str, column: int) -> str:
        """Return the header's statement for a column; empty: none."""
        cells = self.tags.get(key, [])
        return cells[column] if column < len(cells) else ""

    def add_row(self, line: TextLine, cells: list[str]) -> None:
        """Add a line of numbers, in which the first and the last cells may be left out."""
        separator = self.style.delimiter or "\t"
        has_time = not cells[0] or self.headings[0] == X_VALUE
        text = line.text if has_time else separator + line.text
        missing = len(self.headings) - len(cells) - (not has_time)
        self.rows.append(TextLine(line.number, text + separator * missing))

    def list_columns(self) -> list[int]:
        """Return the columns of the channels: neither of times nor of words."""
        count = len(self.headings) - (self.headings[-1] == "Comment")
        return [column for column in range(1, count) if self.headings[column] != X_VALUE]


def make_channels(segment: LabviewSegment, first: LabviewSegment) -> list[MeasuredChannel]:
    """Make the channels of a segment.

    Parameters
    ----------
    segment : LabviewSegment
        What the file holds.
    first : LabviewSegment
        From whose first channel the starts count.

    Raises
    ------
    FileError
        If the table contradicts its header.
    """
    columns = segment.list_columns()
    if not columns:
        raise FileError(f"{segment.path} has no channel in segment {segment.number}")
    stated = segment.get_tag("Channels", 1)
    if stated and stated != str(len(columns)):
        raise FileError(
            f"{segment.path} states {stated} channels in segment {segment.number}, its table has"
            f" {len(columns)}"
        )
    suffix = f" (segment {segment.number})" if segment.number > 1 else ""
    origin = _read_time(first, first.list_columns()[0])
    return [
        MeasuredChannel(
            name=segment.headings[column] + suffix,
            values=values,
            sampling_rate=_read_rate(segment, column, values.size),
            unit=segment.get_tag("Y_Unit_Label", column),
            start=_read_start(segment, column, origin),
            recorded_at=origin or 0,
        )
        for column, values in _read_numbers(segment, columns).items()
    ]


def _read_numbers(segment: LabviewSegment, columns: list[int]) -> dict[int, FloatArray]:
    """Return the numbers of each channel, which ends where its header says, in each packet."""
    counts = {column: _parse_count(segment, column) for column in columns}
    longest = max(columns, key=counts.__getitem__)
    rows, packet = segment.rows, counts[longest]
    if len(rows) < packet:
        raise FileError(
            f"{segment.path} is cut off: {segment.headings[longest]!r} should have {packet}"
            f" points, the table has {len(rows)} rows"
        )
    places = range(len(segment.headings))
    kinds = "".join(NUMBER if place in counts else NOTHING for place in places)
    table = Layout(segment.style, rows[0].number if rows else 0, kinds, tuple(columns))
    parts: dict[int, list[FloatArray]] = {column: [np.empty(0)] for column in columns}
    for first in range(0, len(rows), packet or len(rows) or 1):
        lines = rows[first : first + packet] if packet else rows
        reader = RowReader(segment.path, table)
        numbers = reader.read_lines(lines)
        for flaw in reader.flaws.values():
            raise FileError(f"{segment.path}, {flaw}")
        for column, values in zip(columns, numbers.T, strict=True):
            count = reader.ends.get(column, len(lines))
            stated = min(counts[column], len(lines)) if packet else count
            if count != stated:
                raise FileError(
                    f"{segment.path}, line {lines[min(count, stated)].number}:"
                    f" {segment.headings[column]!r} has {'more' if count > stated else 'fewer'}"
                    " points than its header states"
                )
            parts[column].append(values[:count])
    return {column: np.concatenate(blocks) for column, blocks in parts.items()}


def _parse_count(segment: LabviewSegment, column: int) -> int:
    text = segment.get_tag("Samples", column)
    if text and not text.isdecimal():
        raise FileError(f"{segment.path} states {text!r} samples: it should be a whole number")
    return int(text or 0)


def _read_rate(segment: LabviewSegment, column: int, count: int) -> float:
    """Return the rate of a channel with so many points [Hz]; NaN: not stated.

    Both step and times are rounded, often to microseconds: the more exact one is used.
    """
    dimension = segment.get_tag("X_Dimension", column) or "Time"
    if dimension != "Time":
        raise FileError(
            f"{segment.path}: {segment.headings[column]!r} runs over {dimension}: it should run"
            " over Time"
        )
    text = segment.get_tag("Delta_X", column)
    if not text:
        return math.nan
    step, error = _parse_rounded(segment, text)
    # A column of times is that of all channels that follow it.
    axis = max((at for at in range(column) if segment.headings[at] == X_VALUE), default=0)
    rows = (segment.rows[0], segment.rows[count - 1]) if count > 1 else ()
    times = [segment.style.split(row.text)[axis] for row in rows]
    if times and all(times):
        (begin, begin_error), (end, end_error) = (_parse_rounded(segment, time) for time in times)
        mean_step = (end - begin) / (count - 1)
        mean_error = (end_error + begin_error) / (count - 1)
        if mean_error < error and abs(mean_step - step) <= mean_error + error:
            step, error = mean_step, mean_error
    return round_rate(step, error)


def _parse_rounded(segment: LabviewSegment, text: str) -> tuple[float, float]:
    """Return a number and the largest error that its last digit leaves."""
    try:
        number = Decimal(segment.style.make_point(text))
        return float(number), 0.5 * 10.0 ** int(number.as_tuple().exponent)
    except (ArithmeticError, ValueError):
        raise FileError(f"{segment.path} states {text!r}: it should be a number") from None


def _read_start(segment: LabviewSegment, column: int, origin: int | None) -> float:
    """Return the time of a channel's first point after `origin` [s]."""
    text = segment.get_tag("X0", column)
    before = _parse_rounded(segment, text)[0] if text else 0.0
    time = _read_time(segment, column)
    return before if time is None or origin is None else (time - origin) / NANOSECONDS + before


def _read_time(segment: LabviewSegment, column: int) -> int | None:
    """Return the date of a channel's time 0 [ns since the epoch]; None: not stated."""
    day = "/".join(re.split(r"\D", segment.get_tag("Date", column)))
    clock, _, fraction = segment.get_tag("Time", column).replace(",", ".").partition(".")
    try:
        second = dt.datetime.strptime(f"{day} {clock} +0000", "%Y/%m/%d %H:%M:%S %z")
        nanoseconds = round(NANOSECONDS * Decimal(f"0.{fraction}"))
    except (ValueError, ArithmeticError):
        return None
    return NANOSECONDS * int(second.timestamp()) + nanoseconds


def read_lvm(path: Path) -> Measurement:
    """Read the channels of all segments of a LabVIEW measurement file.

    A channel may be slower or shorter than its neighbours. Its rate and start are those of its
    header, since the table gives times to the microsecond only; starts count from that of the
    first channel, date and time in its header. These are local ones without a time zone: they are
    taken as UTC. Channels of later segments are named by their segment.

    Raises
    ------
    FileError
        If the file is no `.lvm`, is cut off, or its table contradicts its header.
    """
    text = "".join(read_pieces(path))
    lines = split_lines(SPECIAL.sub(lambda special: "\n" * special[0].count("\n"), text))
    if not lines or not lines[0].text.startswith(FIRST_WORDS):
        if any(line.text.startswith(END_OF_HEADER) for line in lines):
            raise FileError(f"{path} is no .lvm file: it should begin with {FIRST_WORDS!r}")
        return read_text(path)  # LabVIEW's plain tables are often called so, too
    style = _read_style(path, lines)
    segments = _split_segments(path, lines, style)
    if not segments:
        if any(style.is_number(style.split(line.text)[0]) for line in lines):
            return read_text(path)  # a table without names
        raise FileError(f"{path} is cut off: it holds no table of numbers")
    return Measurement(
        path,
        tuple(channel for segment in segments for channel in make_channels(segment, segments[0])),
    )


def read_any_text(path: Path) -> Measurement:
    """Read a file of text, that of LabVIEW by its first words, whatever it is called."""
    head = next(read_pieces(path), "").lstrip()
    return read_lvm(path) if head.startswith(FIRST_WORDS) else read_text(path)


def _split_segments(path: Path, lines: Sequence[TextLine], style: Style) -> list[LabviewSegment]:
    """Return the tables: headings begin with `X_Value`, or follow a segment's header."""
    segments: list[LabviewSegment] = []
    tags: dict[str, list[str]] = {}
    for line in lines:
        cells = style.split(line.text)
        key = cells[0]
        if not any(cells):
            continue
        if key == X_VALUE or (tags.get(END_OF_HEADER) and SEGMENT_TAGS & tags.keys()):
            headings = cells if key in ("", X_VALUE) else ["", *cells]
            while not headings[-1]:
                headings.pop()
            segments.append(LabviewSegment(path, len(segments) + 1, style, headings, tags))
            tags = {}
        elif segments and not tags and (not key or style.is_number(key)):
            segments[-1].add_row(line, cells)
        else:
            # Of two ends of headers the segment's is the second.
            tags.pop(END_OF_HEADER, None)
            tags[key] = cells
    return segments


def _read_style(path: Path, lines: Sequence[TextLine]) -> Style:
    """Return the separator that the header states, by default a tab."""
    key = "Separator"
    stated = next((line.text for line in lines if line.text.startswith(key)), "")
    name = stated.removeprefix(key).strip(" \t,;")
    if name and name not in SEPARATORS:
        raise FileError(
            f"{path} states the separator {name!r}: it should be {' or '.join(SEPARATORS)}"
        )
    separator = SEPARATORS.get(name, "\t")
    return Style(separator, has_decimal_comma=separator != ",")
