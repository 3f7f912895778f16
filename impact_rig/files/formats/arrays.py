"""Named arrays of a file of arrays become channels, with times, rates and units among them."""

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.errors import FileError
from impact_rig.files.measurement import MeasuredChannel, Measurement, keep_values
from impact_rig.files.times import (
    SAMPLES,
    SPECTRUM_WORDS,
    TIME_HEADING,
    TIME_NAMES,
    TIME_UNITS,
    normalize_time_unit,
    read_clock,
    round_rate,
)

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
