"""What any file of measured channels comes down to."""

import itertools
import json
import math
import mmap
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.errors import FileError, ParameterError, SignalError, check_positive
from impact_rig.core.records import RawArray
from impact_rig.core.sensors import (
    SAMPLES,
    TIME_UNITS,
    normalize_time_unit,
    normalize_unit,
)

TIE = 1.0 + 1e-6
"""Factor that lets a step in the very middle between two printed ones be either [-]."""
RATE_DIGITS = 9
"""Digits that a sampling rate found in a time column is rounded to, our choice: files of one
series get the same rate, whatever the last bits of their times."""
ORIGIN = "origin"
"""What exported files call the origin of a channel."""
DESCRIBED = ("name", "unit", "sampling_rate", "start", "recorded_at", ORIGIN)
"""Fields of a channel that stand as JSON in our files of MATLAB and Parquet."""
LARGEST_TIME_ERROR = 0.05
"""How far a point may lie from an even time grid, part of the step [-]. Our choice: above what
rounding to the printed digits makes of even steps, far below a point that is missing."""


PIECE = 1 << 18
"""Points of a channel that are looked at at once [-], our choice."""
MANY_UNEVEN = 10
"""So many steps are uneven where points are missing; where times are rounded, more are [-]. Our
choice."""
MANY_STEPS = 500
"""Of the largest size that fit between uneven times whose mean step is a rate [-], our choice."""
SPECTRUM_WORDS = {"hz", "khz", "mhz", "frequency", "freq", "frequenz", "f"}
"""In the heading of an axis, in small letters: it is no time."""
TIME_HEADING = re.compile(r"[\s_/:.()\[\]-]+")
"""What stands between the words of a heading."""


def find_time_unit(name: str, unit: str = "") -> str:
    """Return the unit that the heading of a column of times states.

    Parameters
    ----------
    name, unit : str
        As in the file: `Time` and `ms`, or `time_ms`, `t / ms`, `Second`, `Sequence` alone.

    Returns
    -------
    str
        One of `TIME_UNITS`, or `SAMPLES`; empty: it states none.
    """
    return next(filter(None, map(normalize_time_unit, (unit, *TIME_HEADING.split(name)))), "")


def round_rate(step: float, error: float = 0.0) -> float:
    """Find the rate that a step stands for, as round as the step allows.

    Parameters
    ----------
    step : float
        Time from point to point [s], as its file states it.
    error : float
        What rounding may have made of it [s]: 1.95312e-05 s to six digits may be 51200 Hz.

    Returns
    -------
    float
        [Hz], with as few digits as possible among those whose step is that near; NaN if the step
        is no finite number above zero.
    """
    if not (math.isfinite(step) and step > 0 and math.isfinite(1.0 / step)):
        return math.nan
    for digits in range(1, 18):  # 17 digits tell every float64 from all others
        rate = float(f"{1.0 / step:.{digits}g}")
        if abs(1.0 / rate - step) <= TIE * error:
            return rate
    return 1.0 / step


def compute_rounding(value: float, digits: int) -> float:
    """Return the largest error of a number that was rounded to so many digits."""
    return 0.5 * 10.0 ** (math.floor(math.log10(abs(value))) - digits + 1)


def read_clock(path: Path, name: str, times: RawArray, unit: str = "") -> tuple[float, str, str]:
    """Read a column of times, two at least and all finite, by its heading.

    Returns
    -------
    tuple of float, str and str
        Rate [Hz], rounded to `RATE_DIGITS`, as of seconds where no unit is stated; NaN: not known.
        Unit as stated; empty: it is not. Why the times make no sound rate; empty: they do.

    Raises
    ------
    SignalError
        If it is no column of times but of frequencies.
    """
    words = {word.lower() for word in (unit.strip(), *TIME_HEADING.split(name))}
    if words & SPECTRUM_WORDS and not words & TIME_NAMES:
        raise SignalError(
            f"{path}: its axis is {name!r}{unit and f' in {unit}'}: it is a spectrum; a hit is a"
            " trace over time"
        )
    found = find_time_unit(name, unit)
    if found == SAMPLES:
        return math.nan, "", f"{path}: {name!r} counts samples: give their rate (--rate)"
    if unit.strip() and not normalize_time_unit(unit):
        flaw = f"times are in {unit!r}: they must be in {', '.join(TIME_UNITS)}"
        return math.nan, "", f"{path}: {flaw}; if they are, skip them and give --rate"
    scale = TIME_UNITS[found or "s"]
    begin, end = scale * times[0], scale * times[-1]
    step = (end - begin) / (times.size - 1)

    def is_even(first: int, piece: RawArray) -> bool:
        time = scale * piece
        grid = begin + step * np.arange(first, first + time.size)
        error = np.abs(time - grid).max()
        return bool(np.diff(time).min(initial=step) >= 0 and error <= LARGEST_TIME_ERROR * step)

    if step > 0 and math.isfinite(step) and all(is_even(*found) for found in split_points(times)):
        return float(f"{1.0 / step:.{RATE_DIGITS}g}"), found, ""
    flaw = f"{path}: {_describe_unevenness(scale * times, step)}"
    is_known = step > 0 and MANY_STEPS * np.diff(times).max() < times[-1] - times[0]
    return 1.0 / step if is_known else math.nan, found, flaw


def _describe_unevenness(time: NDArray[Any], step: float) -> str:
    """Return why times [s] with a mean step make no sound rate."""
    steps = np.diff(time)
    if not steps.any():
        return f"its times are rounded: all are {time[0]:g} s. Give --rate"
    if steps.min() < 0 or not (step > 0 and math.isfinite(step)):
        worst = int(np.argmin(steps))
        return (
            f"time does not grow from point {worst} to {worst + 1}"
            f" ({time[worst]:g} s, {time[worst + 1]:g} s): is this the time column?"
        )
    deviation = np.abs(time - (time[0] + step * np.arange(time.size)))
    # Rounded times are off by their last digit at most, and many are; or they repeat.
    least = steps[steps > 0].min()
    uneven = np.count_nonzero(np.abs(steps - np.median(steps)) > LARGEST_TIME_ERROR * least)
    if steps.min() == 0 or (deviation.max() <= least and uneven > MANY_UNEVEN):
        return (
            f"its times are rounded, they have too few digits: they go on by {steps.min():.6g} to"
            f" {steps.max():.6g} s from point to point, by {step:.6g} s on average. If its points"
            f" are evenly spaced, give --rate, about {1.0 / step:.3g} Hz"
        )
    worst = int(np.argmax(np.abs(steps - step)))
    return (
        f"time does not run in even steps of {step:g} s: it goes on by {steps[worst]:g} s at point"
        f" {worst}"
    )


def is_clock(values: RawArray) -> bool:
    """Tell whether a column that never falls must be one of times: no signal is like that."""
    return (
        values.size > 1
        and bool(values[-1] > values[0])
        and all(np.all(piece[1:] >= piece[:-1]) for _, piece in split_points(values))
    )


def split_points(values: RawArray) -> Iterator[tuple[int, RawArray]]:
    """Yield a channel piece by piece, each with the number of its first point.

    Each piece ends with the first point of the next. Numbers in a file leave the memory again.
    """
    source: Any = values
    while isinstance(source, np.ndarray):
        source = source.base
    for first in range(0, values.size, PIECE):
        yield first, values[first : first + PIECE + 1]
        if isinstance(source, mmap.mmap):
            source.madvise(mmap.MADV_DONTNEED)


EARLIEST, LATEST = 315_532_800, 2_145_916_800
"""A date is believed between these, 1980 and 2038 [s since the epoch]. Our choice: clocks that
were never set begin in 1904, 1970 or 1980, and ROS 2's stamps end in January 2038."""
NANOSECONDS = 1_000_000_000
"""In a second [ns]."""
TIME_NAMES = {"t", "time", "times", "x value", "tdxvec"}
RATE_NAMES = {
    "fs", "rate", "sampling rate", "sampling rate hz", "sample rate", "samplerate",
    "samplefrequency", "sampling frequency",
}  # fmt: skip
STEP_NAMES = {
    "dt", "delta t", "delta x", "step", "ts", "sample interval", "sampling interval", "increment",
    "tinc", "tinterval",
}  # fmt: skip
UNIT_NAMES = {"unit", "units", "unit string", "quantity.label"}
"""Names of arrays that say when the others were taken and in what unit, in small letters,
underscores as blanks."""
DIMENSIONS = 3
"""Of the largest array that is taken for channels side by side: hits, channels and time."""


@dataclass(frozen=True)
class MeasuredChannel:
    """One channel as its file states it."""

    name: str  # as in the file; "column 1", "channel 1" and so on where it states none
    # int32 or float64, shape (n,), neither scaled nor rounded, with NaN and infinity; read-only
    values: RawArray
    sampling_rate: float = math.nan  # [Hz]; NaN: the file does not state it
    unit: str = ""  # spelled as in `impact_rig.core.sensors`; empty: the file does not state it
    start: float = 0.0  # time of the first point [s]
    # When that time was 0 [ns since the epoch]; 0: not stated, or not in `EARLIEST` to `LATEST`.
    recorded_at: int = 0
    flaw: str = ""  # why the numbers cannot be read, then there are no values; empty: they can
    origin: str = ""  # as an export states it; empty: the file does not
    time_unit: str = "s"  # stated for the times; empty: not stated, the rate assumes seconds
    time_flaw: str = ""  # why the times make no sound rate, so that --rate is used

    def __post_init__(self) -> None:
        """Copy the values, make them read-only, and refuse what cannot be meant."""
        what = f"channel {self.name!r}"
        # Numbers in a file that cannot be written are not copied into memory.
        values: NDArray[Any] = self.values
        if not isinstance(values, np.memmap) or values.flags.writeable:
            values = np.array(values, order="C")
        if values.ndim != 1 or values.dtype not in (np.int32, np.float64):
            raise ParameterError(
                f"{what} is an array of {values.dtype} with shape {values.shape}: it must be one"
                " row of int32 or float64"
            )
        values.setflags(write=False)
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "unit", normalize_unit(self.unit))
        if not math.isnan(self.sampling_rate):
            check_positive(f"{what}: sampling rate", self.sampling_rate, "Hz")
        if not math.isfinite(self.start):
            raise ParameterError(f"{what} starts at {self.start!r} s: it must be a finite time")
        if not EARLIEST < self.recorded_at / NANOSECONDS < LATEST:
            object.__setattr__(self, "recorded_at", 0)

    @property
    def stamp(self) -> int:
        """When the first point was taken, nanoseconds since the epoch; 0: not known."""
        if not EARLIEST < self.recorded_at / NANOSECONDS + self.start < LATEST:
            return 0
        return self.recorded_at and self.recorded_at + round(self.start * NANOSECONDS)


@dataclass(frozen=True)
class Measurement:
    """All channels of one file."""

    path: Path
    # One at least, in the order of the file; lengths, rates and starts may differ.
    channels: tuple[MeasuredChannel, ...]
    cues: tuple[int, ...] = ()  # points that are marked as hits, in ascending order

    def __post_init__(self) -> None:
        """Refuse a measurement of nothing."""
        if not self.channels:
            raise FileError(f"{self.path} holds no channel: it should have one or more of numbers")


def keep_values(array: NDArray[Any], what: str) -> RawArray:
    """Return numbers of any kind in one of the two kinds that a channel has.

    Parameters
    ----------
    array : ndarray
        Of real numbers.
    what : str
        Names file and channel in the message.

    Returns
    -------
    ndarray of int32 or float64
        The same numbers: int32 if all integers of their kind fit, otherwise float64.

    Raises
    ------
    FileError
        If the numbers are not real, or cannot be kept exactly.
    """
    kind = array.dtype.kind
    if kind in "iu" and np.can_cast(array.dtype, np.int32):
        return array.astype(np.int32, copy=False)
    if kind in "iu" and array.size and max(abs(int(array.min())), int(array.max())) > 2**53:
        raise FileError(
            f"{what} holds whole numbers beyond 2^53: float64 cannot keep them exactly"
        )
    if kind not in "iuf" or array.dtype.itemsize > np.dtype(np.float64).itemsize:
        raise FileError(
            f"{what} holds {array.dtype}: a channel is of real numbers, float64 at most"
        )
    return array.astype(np.float64, copy=False)


@dataclass(frozen=True)
class NamedArray:
    """An array, and what its file states of it."""

    name: str  # in the file
    values: NDArray[Any]  # of any kind and shape
    stated: Mapping[str, Any] = field(default_factory=dict)  # fields of its `MeasuredChannel`
    is_channel: bool = False  # the file says that it is one; False: by name and shape


def make_measurement(path: Path, arrays: Sequence[NamedArray]) -> Measurement:
    """Make channels of the arrays of a file.

    Vectors are channels; of an array with more axes the longest is time. An array named as a time,
    a sampling rate or a step says when those were taken that share most groups with it, a text
    named as a unit is theirs; all else is left out.

    Parameters
    ----------
    path : Path
        Of the file, for messages.
    arrays : sequence of NamedArray
        All arrays of the file, in its order.

    Raises
    ------
    FileError
        If no array is a channel.
    """
    rates = [array for array in arrays if read_stated_rate(array) > 0]
    clocks = [array for array in arrays if _is_time(array)]
    units = [array for array in arrays if _is_unit(array)]
    channels: list[MeasuredChannel] = []
    for array in arrays:
        if _is_channel(array) and not _is_time(array):
            channels += _make_channels(path, _find_unit(array, units), clocks, rates)
    if channels:
        return Measurement(path, tuple(channels))
    found = ", ".join(f"{a.name} ({a.values.dtype}, {a.values.shape})" for a in arrays[:5])
    raise FileError(f"{path} has no vector of real numbers: it holds {found or 'nothing'}")


def describe_channels(channels: Sequence[MeasuredChannel], names: Sequence[str]) -> str:
    """Return what is known of channels beside their values as JSON, by names in a file."""
    table = [
        {"variable": variable}
        | {name: getattr(channel, name) for name in DESCRIBED}
        | {"sampling_rate": None if math.isnan(channel.sampling_rate) else channel.sampling_rate}
        | {"recorded_at": channel.recorded_at or None}
        for variable, channel in zip(names, channels, strict=True)
    ]
    return json.dumps(table)


def read_described(path: Path, text: str, variables: Mapping[str, Any]) -> Measurement:
    """Return the channels of a file with a text of `describe_channels`, and its variables."""
    channels = []
    for row in json.loads(text):
        values = keep_values(np.ravel(variables[row["variable"]]), f"{path}, {row['name']}")
        stated = {name: row[name] for name in DESCRIBED if row[name] is not None}
        stated["recorded_at"] = int(stated.get("recorded_at", 0))  # MATLAB writes it as 1.6e18
        channels.append(MeasuredChannel(values=values, **stated))
    return Measurement(path, tuple(channels))


def split_columns(values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Return the columns of an array, of whose axes the longest is time, the last of equals.

    Each has its number along the other axes, counted from 1, as text: " 3 1"; of a vector "".
    """
    values = np.atleast_1d(values)
    time = values.ndim - 1 - int(np.argmax(values.shape[::-1]))
    rows = np.moveaxis(values, time, -1)
    return {
        "".join(
            f" {number + 1}" for number, of in zip(place, rows.shape, strict=False) if of > 1
        ): (rows[place])
        for place in np.ndindex(rows.shape[:-1])
    }


PARTS = re.compile(r"[/.]")
"""What stands between the parts of a name: of groups in a file, or of structs."""


def clean_name(name: str) -> str:
    """Return the last part of a name in small letters, underscores as blanks."""
    return PARTS.split(name)[-1].replace("_", " ").strip().lower()


def _make_channels(
    path: Path, array: NamedArray, clocks: Sequence[NamedArray], rates: Sequence[NamedArray]
) -> list[MeasuredChannel]:
    stated = dict(array.stated)
    if math.isnan(stated.get("sampling_rate", math.nan)) and not array.is_channel:
        if rates:
            nearest = _find_nearest(rates, array)
            is_step = clean_name(nearest.name) in STEP_NAMES
            stated |= {
                "sampling_rate": read_stated_rate(nearest),
                "time_unit": "" if is_step else "s",
            }
        fitting = [clock for clock in clocks if clock.values.size == max(array.values.shape)]
        if fitting:
            time = _find_nearest(fitting, array)
            times, unit = time.values.ravel(), time.stated.get("unit", "")
            rate, unit, flaw = read_clock(path, clean_name(time.name), times, unit)
            stated |= {"sampling_rate": rate, "time_unit": unit, "time_flaw": flaw}
            if not flaw:
                stated["start"] = TIME_UNITS[unit or "s"] * float(times[0])
    return [
        MeasuredChannel(array.name + place, keep_values(column, f"{path}, {array.name}"), **stated)
        for place, column in split_columns(array.values).items()
    ]


def _find_nearest(stated: Sequence[NamedArray], array: NamedArray) -> NamedArray:
    """Return that one of arrays that shares most groups with another; the outermost of equals."""
    parts = PARTS.split(array.name)

    def rank(other: NamedArray) -> tuple[int, int]:
        others = PARTS.split(other.name)
        pairs = itertools.takewhile(
            lambda pair: pair[0] == pair[1], zip(parts, others, strict=False)
        )
        return len(list(pairs)), -len(others)

    return max(stated, key=rank)


def _is_unit(array: NamedArray) -> bool:
    """Tell whether a text is the unit of values, not of their times."""
    *groups, last = PARTS.split(array.name)
    names = {clean_name(last), f"{groups[-1] if groups else ''}.{last}"}
    is_clocks = any(clean_name(group) == "x values" for group in groups)
    return array.values.dtype.kind == "U" and bool(names & UNIT_NAMES) and not is_clocks


def _find_unit(array: NamedArray, units: Sequence[NamedArray]) -> NamedArray:
    """Return an array with the unit that is stated in its group, or around it."""
    groups = PARTS.split(array.name)[:-1]
    around = [
        unit
        for unit in units
        if unit.values.size == 1
        and (PARTS.split(unit.name.removesuffix(".quantity.label"))[: len(groups)] == groups)
    ]
    if array.stated.get("unit") or not around:
        return array
    unit = str(_find_nearest(around, array).values.item())
    return replace(array, stated={**array.stated, "unit": unit})


def read_stated_rate(array: NamedArray) -> float:
    """Return the sampling rate that a number in the file states [Hz]; NaN: it does not."""
    name = clean_name(array.name)
    if array.values.size != 1 or name not in RATE_NAMES | STEP_NAMES:
        return math.nan
    try:
        value = float(array.values.item())  # some write numbers as text
    except (TypeError, ValueError):
        return math.nan
    if name in STEP_NAMES:
        return round_rate(value)
    return value if math.isfinite(value) else math.nan


def _is_time(array: NamedArray) -> bool:
    name = clean_name(array.name)
    word, *rest = [word for word in TIME_HEADING.split(name) if word] or [name]
    units = [normalize_time_unit(word) for word in rest]
    return (
        not array.is_channel
        and _is_channel(array)
        and max(array.values.shape) == array.values.size
        and (
            name in TIME_NAMES
            or name in SPECTRUM_WORDS
            or (word in TIME_NAMES and all(units))
            or normalize_time_unit(name) == SAMPLES
        )
    )


def _is_channel(array: NamedArray) -> bool:
    values = array.values
    is_large = 1 <= values.ndim <= DIMENSIONS and values.size > 1
    return values.dtype.kind in "iuf" and (array.is_channel or is_large)


def make_unique(
    names: Sequence[str], clean: Callable[[str], str], number_format: str = " ({})"
) -> list[str]:
    """Return a name for each channel that a format can hold.

    Parameters
    ----------
    names : sequence of str
        Of the channels; a name may be there twice.
    clean : callable
        Returns a name that the format allows, the same if it is one.
    number_format : str
        What is added to a name that is taken, a number in place of the braces.

    Returns
    -------
    list of str
        As many, all different, also if the case of letters does not count.
    """
    taken: set[str] = set()
    unique = []
    for name in names:
        candidate = allowed = clean(name)
        number = 2
        while candidate.lower() in taken:
            candidate = allowed + number_format.format(number)
            number += 1
        taken.add(candidate.lower())
        unique.append(candidate)
    return unique
