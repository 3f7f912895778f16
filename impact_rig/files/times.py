"""Times and rates of measured files: units, even steps, roundness.

A column of times becomes a `Clock`: a rate, or why it makes none. Of many such points::

    0.0  0.1  0.2  0.3  0.4 ms     10 kHz
    0    1    2    3    4 samples  they are counted: the user must give their rate
    0.0  0.1  0.2  0.4  0.5 ms     a gap: all that follows is late, no rate mends that
    0.0  0.1  0.29 0.3  0.4 ms     uneven: what follows is in time; the user may give a rate
    0.0  0.0  0.0  0.1  0.1 s      rounded to too few digits; the user may give a rate
"""

import math
import mmap
import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from impact_rig.core.given.errors import SignalError
from impact_rig.core.given.records import RawArray

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
"""Units of times [s]."""
SAMPLES = "samples"
"""Unit of a column that numbers its points."""
TIME_SPELLINGS = {
    "µs": "us", "μs": "us", "sec": "s", "sek": "s", "msec": "ms", "usec": "us", "µsec": "us",
    "nsec": "ns", "second": "s", "millisecond": "ms", "microsecond": "us", "nanosecond": "ns",
    "minute": "min", "sample": SAMPLES, "point": SAMPLES, "pt": SAMPLES, "index": SAMPLES,
    "sequence": SAMPLES, "#": SAMPLES,
}  # fmt: skip
"""Other spellings of these in files, in small letters and without the s of the plural."""


def normalize_time_unit(unit: str) -> str:
    """Return how a unit of time is written here, or `SAMPLES`; empty: it is none."""
    name = unit.strip().lower()
    name = name if name in TIME_UNITS or name in TIME_SPELLINGS else name.removesuffix("s")
    return name if name in TIME_UNITS else TIME_SPELLINGS.get(name, "")


TIE = 1.0 + 1e-6
"""Factor that lets a step in the very middle between two printed ones be either [-]."""
RATE_DIGITS = 9
"""Digits that a sampling rate found in a time column is rounded to, our choice: files of one
series get the same rate, whatever the last bits of their times."""
RATE_MISMATCH = 0.01
"""How far two statements of one rate may be apart [-]: rounding makes some of it."""
LARGEST_TIME_ERROR = 0.05
"""How far a point may lie from an even time grid, part of the step [-]. Our choice: above what
rounding to the printed digits makes of even steps, far below a point that is missing."""
PIECE = 1 << 18
"""Points of a channel that are looked at at once [-], our choice."""
MOST_RISES = 0.95
"""Part of its steps that rise in a column of times with some wrong stamps [-], our choice: no
signal rises so often."""
LEAST_GAP = 0.75
"""So many steps late or early are what follows a gap [-]: a point is missing, or there twice."""
GAP_POINTS, FEWEST_POINTS, USUAL_POINTS = 256, 8, 1024
"""On each side of a gap, at most and at least, and for the usual step [-], our choice: rounding
cancels out in them."""
MANY_STEPS = 500
"""Of the largest size that fit between uneven times whose mean step is a rate [-], our choice."""
SPECTRUM_WORDS = {"hz", "khz", "mhz", "frequency", "freq", "frequenz", "f"}
"""In the heading of an axis, in small letters: it is no time."""
TIME_NAMES = {
    "t", "time", "times", "timestamp", "timestamps", "time stamp", "x value", "tdxvec", "zeit",
    "second", "seconds",
}  # fmt: skip
"""In the heading of a column of times, in small letters."""
TIME_HEADING = re.compile(r"[\s_/:.()\[\]-]+")
"""Separators between the words of a heading."""


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


class Axis(Enum):
    """Axes of a column, by its heading."""

    TIME = "time"
    COUNT = "count"
    FREQUENCY = "frequency"


def find_axis(name: str, unit: str = "") -> Axis | None:
    """Return the kind of axis by its heading; None: it is no heading of an axis."""
    first, *rest = [part.lower() for part in TIME_HEADING.split(name) if part] or [""]
    words = {unit.strip().lower(), first, *rest}
    is_time = name.strip().lower() in TIME_NAMES or (
        first in TIME_NAMES and all(map(normalize_time_unit, rest))
    )
    if is_time or normalize_time_unit(unit) in TIME_UNITS:
        return Axis.TIME
    if SAMPLES in (normalize_time_unit(name), normalize_time_unit(unit)):
        return Axis.COUNT
    return Axis.FREQUENCY if words & SPECTRUM_WORDS else None


@dataclass(frozen=True)
class Clock:
    """The sampling, from a column of times."""

    rate: float = math.nan  # [Hz]; as of seconds where no unit is stated; NaN: not known
    unit: str = ""  # as stated; empty: it is not
    flaw: str | None = None  # why the times make no sound rate; None: they do
    has_gap: bool = False  # points are missing or there twice: no rate by hand mends that

    @property
    def stated(self) -> dict[str, Any]:
        """The same by the fields of a channel."""
        names = ("sampling_rate", "time_unit", "time_flaw", "has_gap")
        return dict(zip(names, (self.rate, self.unit, self.flaw, self.has_gap), strict=True))


def read_clock(path: Path, name: str, times: RawArray, unit: str = "") -> Clock:
    """Read a column of times, two at least and all finite, by its heading.

    The rate of even times is rounded to `RATE_DIGITS`.

    Raises
    ------
    SignalError
        If it is no column of times but of frequencies.
    """
    if find_axis(name, unit) is Axis.FREQUENCY:
        raise SignalError(
            f"{path}: its axis is {name!r}{unit and f' in {unit}'}: it is a spectrum; a hit is a"
            " trace over time"
        )
    found = find_time_unit(name, unit)
    if found == SAMPLES:
        gap = find_gap(times, find_usual_step(times))
        if gap is not None:
            return Clock(flaw=f"{path}: {name!r} skips points behind point {gap}", has_gap=True)
        return Clock(flaw=f"{path}: {name!r} counts samples: give their rate (--rate)")
    if unit.strip() and not normalize_time_unit(unit):
        flaw = f"times are in {unit!r}: they must be in {', '.join(TIME_UNITS)}"
        return Clock(flaw=f"{path}: {flaw}; if they are, skip them and give --rate")
    scale = TIME_UNITS[found or "s"]
    begin, end = scale * times[0], scale * times[-1]
    step = (end - begin) / (times.size - 1)

    def is_even(first: int, piece: RawArray) -> bool:
        time = scale * piece
        grid = begin + step * np.arange(first, first + time.size)
        error = np.abs(time - grid).max()
        return bool(np.diff(time).min(initial=step) >= 0 and error <= LARGEST_TIME_ERROR * step)

    if step > 0 and math.isfinite(step) and all(is_even(*found) for found in split_points(times)):
        return Clock(float(f"{1.0 / step:.{RATE_DIGITS}g}"), found)
    flaw, has_gap, step = _find_flaw(times, scale)
    is_known = step > 0 and MANY_STEPS * scale * np.diff(times).max() < end - begin
    rate = 1.0 / step if is_known else math.nan
    return Clock(rate, found, f"{path}: {flaw}", has_gap)


def _find_flaw(times: RawArray, scale: float) -> tuple[str, bool, float]:
    """Return why uneven times make no rate, whether that is a gap, and their usual step [s]."""
    steps = np.diff(times)
    if not steps.any():
        return f"its times are rounded: all are {scale * times[0]:g} s. Give --rate", False, 0.0
    usual = find_usual_step(times)
    worst = int(np.argmin(steps))
    falls = (
        f"time does not grow from point {worst} to {worst + 1} ({scale * times[worst]:g} s,"
        f" {scale * times[worst + 1]:g} s): is this the time column?"
    )
    if not (usual > 0 and math.isfinite(usual)):
        return falls, False, 0.0
    gap = find_gap(times, usual)
    if gap is not None:
        flaw = (
            f"points are missing, or there twice: time goes on by {scale * steps[gap]:g} s at"
            f" point {gap}, by {scale * usual:g} s elsewhere. No rate mends that: cut the file"
            " there"
        )
        return flaw, True, scale * usual
    if steps[worst] < 0:
        return falls, False, scale * usual
    flaw = (
        "its times are uneven or rounded, they have too few digits: they go on by"
        f" {scale * steps[worst]:.6g} to {scale * steps.max():.6g} s from point to point, by"
        f" {scale * usual:.6g} s on average. If its points are evenly spaced, give --rate, about"
        f" {1.0 / (scale * usual):.3g} Hz"
    )
    return flaw, False, scale * usual


def find_usual_step(times: RawArray) -> float:
    """Return the step that most points have, whatever is missing between some."""
    reach = max(min(USUAL_POINTS, times.size // 8), 1)
    first = np.linspace(0, times.size - 1 - reach, USUAL_POINTS).astype(int)
    return float(np.median(times[first + reach] - times[first])) / reach


def find_gap(times: RawArray, step: float) -> int | None:
    """Return the point behind which points are missing or come twice; None: nowhere.

    There time jumps by half a step at least, and what follows stays late or early by
    `LEAST_GAP` steps, and more than the times are rounded to: a stamp that is late alone comes
    back.
    """
    if not step > 0.0:
        return None
    steps = np.diff(times)
    is_coarse = steps.min() == 0.0
    least = max(LEAST_GAP, steps[steps > 0].min() / step if is_coarse else 0.0)
    reach = max(min(GAP_POINTS, times.size // 8), FEWEST_POINTS)
    for first in range(0, times.size - 1, PIECE):
        begin = max(first - reach, 0)
        part = times[begin : first + PIECE + reach + 1]
        late = (part - part[0]) / step - np.arange(part.size)
        sums = np.concatenate([[0.0], np.cumsum(late)])
        at = np.arange(first - begin, min(first + PIECE, times.size - 1) - begin)
        low = np.maximum(at + 1 - reach, 0)
        high = np.minimum(at + 1 + reach, late.size)
        before, after = at + 1 - low, high - at - 1
        shift = (sums[high] - sums[at + 1]) / after - (sums[at + 1] - sums[low]) / before
        is_jump = np.abs(np.diff(late))[at] >= 0.5 * LEAST_GAP
        is_sure = np.minimum(before, after) >= FEWEST_POINTS
        found = np.flatnonzero(is_jump & is_sure & (np.abs(shift) >= least))
        if found.size:
            return first + int(found[np.argmax(np.abs(shift[found]))])
    return None


def is_clock(values: RawArray) -> bool:
    """Return whether a column must be one of times: it never falls, or rises nearly always."""
    if values.size <= 1 or not values[-1] > values[0]:
        return False
    rises = np.diff(values[: PIECE + 1]) > 0
    return bool(np.mean(rises) >= MOST_RISES) or all(
        np.all(piece[1:] >= piece[:-1]) for _, piece in split_points(values)
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
