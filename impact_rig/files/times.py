"""Times and rates of measured files: units, even steps, roundness."""

import math
import mmap
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.errors import SignalError
from impact_rig.core.records import RawArray

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
"""Units of times [s]."""
SAMPLES = "samples"
"""What a column counts that numbers its points."""
TIME_SPELLINGS = {
    "µs": "us", "μs": "us", "sec": "s", "sek": "s", "msec": "ms", "usec": "us", "µsec": "us",
    "nsec": "ns", "second": "s", "millisecond": "ms", "microsecond": "us", "nanosecond": "ns",
    "minute": "min", "sample": SAMPLES, "point": SAMPLES, "pt": SAMPLES, "index": SAMPLES,
    "sequence": SAMPLES, "#": SAMPLES,
}  # fmt: skip
"""How files write these, too, in small letters and without the s of the plural."""


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


TIME_NAMES = {"t", "time", "times", "x value", "tdxvec"}
