"""Files of arrays by name: which are channels, which their time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.errors import FileError
from impact_rig.recording.exchange.time_column import TIME_UNITS, find_sampling_rate
from impact_rig.recording.formats.measurement import MeasuredChannel, Measurement, keep_values
from impact_rig.recording.formats.sampling import find_round_rate

TIME_NAMES = {"t", "time", "time s", "times", "x value"}
RATE_NAMES = {"fs", "rate", "sampling rate", "sampling rate hz", "sample rate", "samplerate"}
STEP_NAMES = {"dt", "delta t", "delta x", "step", "ts"}
"""Names of arrays that say when the others were taken, in small letters, underscores as blanks."""
DIMENSIONS = 2
"""Of the largest array that is taken for channels side by side."""


@dataclass(frozen=True)
class NamedArray:
    """An array, and what its file states of it.

    Attributes
    ----------
    name : str
        In the file.
    values : ndarray
        Of any kind and shape.
    sampling_rate, unit, start, recorded_at
        As in `MeasuredChannel`.
    is_channel : bool
        The file says so of numbers; False: found out by name and shape.
    """

    name: str
    values: NDArray[Any]
    sampling_rate: float = math.nan
    unit: str = ""
    start: float = 0.0
    is_channel: bool = False
    recorded_at: int = 0


def make_measurement(path: Path, arrays: Sequence[NamedArray]) -> Measurement:
    """Make channels of the arrays of a file.

    Vectors are channels; of an array with two axes the longer one is time. An array named as a
    time, a sampling rate or a step says when the others were taken; all else is left out.

    Parameters
    ----------
    path : Path
        Of the file, for messages.
    arrays : sequence of NamedArray
        All arrays of the file, in its order.

    Returns
    -------
    Measurement

    Raises
    ------
    FileError
        If no array is a channel.
    SignalError
        If time does not run in even steps.
    """
    rate = _find_stated_rate(arrays)
    clocks = [array for array in arrays if _is_time(array)]
    channels: list[MeasuredChannel] = []
    for array in arrays:
        if _is_channel(array) and not _is_time(array):
            channels += _make_channels(path, array, clocks, rate)
    if channels:
        return Measurement(path, tuple(channels))
    found = ", ".join(f"{a.name} ({a.values.dtype}, {a.values.shape})" for a in arrays[:5])
    raise FileError(f"{path} has no vector of real numbers: it holds {found or 'nothing'}")


def split_columns(values: NDArray[Any]) -> list[NDArray[Any]]:
    """Return the columns of an array of one or two axes, of which the longer is time."""
    if values.ndim == 1:
        return [values]
    rows = np.atleast_2d(values)
    return list(rows if rows.shape[0] <= rows.shape[1] else rows.T)


def clean_name(name: str) -> str:
    """Return the last part of a name in small letters, underscores as blanks."""
    return name.rpartition("/")[2].replace("_", " ").strip().lower()


def _make_channels(
    path: Path, array: NamedArray, clocks: Sequence[NamedArray], rate: float
) -> list[MeasuredChannel]:
    columns = split_columns(array.values)
    sampling_rate, start = array.sampling_rate, array.start
    if math.isnan(sampling_rate) and not array.is_channel:
        sampling_rate = rate
        time = next((clock for clock in clocks if clock.values.size == columns[0].size), None)
        if time is not None:
            times = np.asarray(time.values, dtype=np.float64).ravel()
            sampling_rate = find_sampling_rate(path, times, time.unit)
            start = TIME_UNITS[time.unit.strip()] * float(times[0])
    return [
        MeasuredChannel(
            name=array.name if len(columns) == 1 else f"{array.name} {number}",
            values=keep_values(column, f"{path}, {array.name}"),
            sampling_rate=sampling_rate,
            unit=array.unit,
            start=start,
            recorded_at=array.recorded_at,
        )
        for number, column in enumerate(columns, start=1)
    ]


def _find_stated_rate(arrays: Sequence[NamedArray]) -> float:
    """Return the sampling rate that a number in the file states [Hz]; NaN: none does."""
    for array in arrays:
        if array.values.size != 1 or array.values.dtype.kind not in "iuf":
            continue
        value = float(array.values.ravel()[0])
        if not (math.isfinite(value) and value > 0):
            continue
        if clean_name(array.name) in RATE_NAMES:
            return value
        if clean_name(array.name) in STEP_NAMES:
            return find_round_rate(value)
    return math.nan


def _is_time(array: NamedArray) -> bool:
    return (
        not array.is_channel
        and _is_channel(array)
        and max(array.values.shape) == array.values.size
        and clean_name(array.name) in TIME_NAMES
    )


def _is_channel(array: NamedArray) -> bool:
    values = array.values
    is_large = 1 <= values.ndim <= DIMENSIONS and values.size > 1
    return values.dtype.kind in "iuf" and (array.is_channel or is_large)
