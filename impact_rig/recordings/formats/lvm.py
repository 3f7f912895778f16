"""LabVIEW's measurement files (`.lvm`).

Read here and not by the library lvm_read (1.26): that one makes NaN of whatever is no number and
of what is cut off, takes columns of times for channels, leaves step, start and length of each
channel to the caller, and unpickles any `.lvm.pkl` that lies beside the file.
"""

import bisect
import datetime as dt
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cached_property
from pathlib import Path

import numpy as np

from impact_rig.core.errors import FileError
from impact_rig.core.records import FloatArray
from impact_rig.recordings.formats.measurement import (
    NANOSECONDS,
    MeasuredChannel,
    Measurement,
    round_rate,
)
from impact_rig.recordings.formats.text import Line, Style, read_pieces, read_text, split_lines

X_VALUE = "X_Value"
"""Heading of every column of times."""
COMMENT = "Comment"
"""Heading of the last column, of words."""
DAY = re.compile(r"(\d{4})\D(\d{1,2})\D(\d{1,2})")
CLOCK = re.compile(r"(\d{1,2}):(\d{1,2}):(\d{1,2}(?:[.,]\d+)?)")
FIRST_WORDS, END_OF_HEADER = "LabVIEW Measurement", "***End_of_Header***"
SEGMENT_TAGS = {"Channels", "Samples", "Delta_X"}
"""What the header of a table states, and that of the file does not."""
SEPARATORS = {"Tab": "\t", "Comma": ","}
SPECIAL_START, SPECIAL_END = "***Start_Special***", "***End_Special***"
"""Around what a program adds for itself."""


@dataclass(frozen=True)
class Segment:
    """A table of numbers with what its header states."""

    path: Path
    number: int  # in the file, counted from 1
    style: Style  # how its numbers are written
    headings: list[str]  # of its columns
    # Lines of its header by their first cell; the other cells stand below their columns.
    tags: dict[str, list[str]]
    rows: list[tuple[int, list[str]]] = field(default_factory=list)  # line number, cells

    def get_tag(self, key: str, column: int) -> str:
        """Return what the header states of a column; empty: nothing."""
        cells = self.tags.get(key, [])
        return cells[column] if column < len(cells) else ""

    def get_cells(self, column: int) -> list[str]:
        """Return the cells of a column; empty where a row ends before it."""
        return [cells[column] if column < len(cells) else "" for _, cells in self.rows]

    @cached_property
    def axes(self) -> list[int]:
        """Columns of times, each of the channels that follow it."""
        return [column for column, name in enumerate(self.headings) if name == X_VALUE]

    def list_columns(self) -> list[int]:
        """Return the columns of the channels: neither of times nor of words."""
        count = len(self.headings) - (self.headings[-1] == COMMENT)
        return [column for column in range(1, count) if self.headings[column] != X_VALUE]


def make_channels(segment: Segment, first: Segment) -> list[MeasuredChannel]:
    """Make the channels of a segment.

    Parameters
    ----------
    segment : Segment
        What the file holds.
    first : Segment
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
    packet = _read_packet(segment, columns)
    suffix = f" (segment {segment.number})" if segment.number > 1 else ""
    origin = _read_time(first, first.list_columns()[0])
    return [
        MeasuredChannel(
            name=segment.headings[column] + suffix,
            values=_parse_column(segment, column, packet),
            sampling_rate=_read_rate(segment, column),
            unit=segment.get_tag("Y_Unit_Label", column),
            start=_read_start(segment, column, origin),
            recorded_at=origin or 0,
        )
        for column in columns
    ]


def _read_packet(segment: Segment, columns: list[int]) -> int:
    """Return the rows that one writing of the table takes; 0: not stated."""
    stated = [_parse_count(segment, column) for column in columns]
    packet = max(stated, default=0)
    if len(segment.rows) < packet:
        name = segment.headings[columns[stated.index(packet)]]
        raise FileError(
            f"{segment.path} is cut off: {name!r} should have {packet} points, the table has"
            f" {len(segment.rows)} rows"
        )
    return packet


def _parse_count(segment: Segment, column: int) -> int:
    text = segment.get_tag("Samples", column)
    if text and not text.isdecimal():
        raise FileError(f"{segment.path} states {text!r} samples: it should be a whole number")
    return int(text or 0)


def _parse_column(segment: Segment, column: int, packet: int) -> FloatArray:
    """Return the numbers of a channel; it has none where its header says that it ended."""
    cells = np.array(segment.get_cells(column), dtype=object)
    is_there = cells != ""
    if packet:
        should_be = np.arange(cells.size) % packet < _parse_count(segment, column)
    else:
        should_be = np.arange(cells.size) < np.count_nonzero(is_there)
    wrong = np.flatnonzero(is_there != should_be)
    if wrong.size:
        what = "more" if is_there[wrong[0]] else "fewer"
        raise FileError(
            f"{segment.path}, line {segment.rows[wrong[0]][0]}: {segment.headings[column]!r} has"
            f" {what} points than its header states"
        )
    lines = [segment.rows[row][0] for row in np.flatnonzero(is_there)]
    return segment.style.parse(segment.path, cells[is_there].tolist(), lines)


def _read_rate(segment: Segment, column: int) -> float:
    """Return the rate of a channel [Hz]; NaN: not stated.

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
    axis = segment.axes[bisect.bisect(segment.axes, column) - 1] if segment.axes else 0
    cells, numbers = segment.get_cells(axis), segment.get_cells(column)
    while numbers and not numbers[-1]:
        numbers.pop()
    if len(numbers) > 1 and cells[0] and cells[len(numbers) - 1]:
        times = [_parse_rounded(segment, cells[index]) for index in (0, len(numbers) - 1)]
        mean_step = (times[1][0] - times[0][0]) / (len(numbers) - 1)
        mean_error = (times[1][1] + times[0][1]) / (len(numbers) - 1)
        if mean_error < error and abs(mean_step - step) <= mean_error + error:
            step, error = mean_step, mean_error
    return round_rate(step, error)


def _parse_rounded(segment: Segment, text: str) -> tuple[float, float]:
    """Return a number and the largest error that its last digit leaves."""
    try:
        number = Decimal(segment.style.make_point(text))
        return float(number), 0.5 * 10.0 ** int(number.as_tuple().exponent)
    except (ArithmeticError, ValueError):
        raise FileError(f"{segment.path} states {text!r}: it should be a number") from None


def _read_start(segment: Segment, column: int, origin: int | None) -> float:
    """Return the time of a channel's first point after `origin` [s]."""
    text = segment.get_tag("X0", column)
    before = _parse_rounded(segment, text)[0] if text else 0.0
    time = _read_time(segment, column)
    return before if time is None or origin is None else (time - origin) / NANOSECONDS + before


def _read_time(segment: Segment, column: int) -> int | None:
    """Return what a channel's times count from [ns since the epoch]; None: not stated."""
    day = DAY.fullmatch(segment.get_tag("Date", column))
    clock = CLOCK.fullmatch(segment.get_tag("Time", column))
    if day is None or clock is None:
        return None
    hours, minutes, seconds = clock.groups()
    try:
        date = dt.date(*map(int, day.groups()))
        minute = dt.datetime.combine(date, dt.time(int(hours), int(minutes)), dt.UTC)
    except ValueError:
        return None
    whole = NANOSECONDS * int(minute.timestamp())
    return whole + round(NANOSECONDS * Decimal(seconds.replace(",", ".")))


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
    lines = split_lines("".join(read_pieces(path)))
    if not lines or not lines[0].text.startswith(FIRST_WORDS):
        if any(line.text.startswith(END_OF_HEADER) for line in lines):
            raise FileError(f"{path} is no .lvm file: it should begin with {FIRST_WORDS!r}")
        return read_text(path)  # LabVIEW's plain tables are often called so, too
    segments = list(_split_segments(path, lines))
    if not segments:
        style = _read_style(path, lines)
        if any(style.is_number(style.split(line.text)[0]) for line in lines):
            return read_text(path)  # a table without names
        raise FileError(f"{path} is cut off: it holds no table of numbers")
    return Measurement(
        path,
        tuple(channel for segment in segments for channel in make_channels(segment, segments[0])),
    )


def _split_segments(path: Path, lines: Sequence[Line]) -> Iterator[Segment]:
    """Yield the tables; headings begin with `X_Value`, or follow the end of a segment's header."""
    style = _read_style(path, lines)
    segment: Segment | None = None
    tags: dict[str, list[str]] = {}
    number = 0
    for line in _leave_out_special(lines):
        cells = style.split(line.text)
        key = cells[0]
        if not any(cells):
            continue
        if key == X_VALUE or (tags.get(END_OF_HEADER) and SEGMENT_TAGS & tags.keys()):
            if segment is not None:
                yield segment
            number += 1
            headings = cells if key in ("", X_VALUE) else ["", *cells]
            while not headings[-1]:
                headings.pop()
            segment = Segment(path, number, style, headings, tags)
            tags = {}
        elif segment is not None and not tags and (not key or style.is_number(key)):
            has_time = not key or segment.headings[0] == X_VALUE
            segment.rows.append((line.number, cells if has_time else ["", *cells]))
        else:
            # Of two ends of headers the segment's is the second.
            tags.pop(END_OF_HEADER, None)
            tags[key] = cells
    if segment is not None:
        yield segment


def _leave_out_special(lines: Sequence[Line]) -> Iterator[Line]:
    is_special = False
    for line in lines:
        if line.text.startswith(SPECIAL_START):
            is_special = True
        elif line.text.startswith(SPECIAL_END):
            is_special = False
        elif not is_special:
            yield line


def _read_style(path: Path, lines: Sequence[Line]) -> Style:
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
