"""A file of measured channels, whatever its format."""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.given.errors import FileError, ParameterError, check_positive
from impact_rig.core.given.records import RawArray
from impact_rig.core.given.sensors import normalize_unit

ORIGIN = "origin"
"""Name of a channel's origin in exported files."""
DESCRIBED = ("name", "unit", "sampling_rate", "start", "recorded_at", ORIGIN)
"""Fields of a channel that stand as JSON in our files of MATLAB and Parquet."""


EARLIEST, LATEST = 315_532_800, 2_145_916_800
"""A date is believed between these, 1980 and 2038 [s since the epoch]. Our choice: clocks that
were never set begin in 1904, 1970 or 1980, and ROS 2's stamps end in January 2038."""
NANOSECONDS = 1_000_000_000
"""In a second [ns]."""


@dataclass(frozen=True, eq=False)
class MeasuredChannel:
    """One channel as its file states it; equal to itself alone."""

    name: str  # as in the file; "column 1", "channel 1" and so on where it states none
    # int32 or float64, shape (n,), neither scaled nor rounded, with NaN and infinity; read-only
    values: RawArray
    sampling_rate: float = math.nan  # [Hz]; NaN: the file does not state it
    unit: str = ""  # spelled as in `core.given.sensors`; empty: the file does not state it
    start: float = 0.0  # time of the first point [s]
    # When that time was 0 [ns since the epoch]; 0: not stated, or not in `EARLIEST` to `LATEST`.
    recorded_at: int = 0
    flaw: str | None = None  # why not all are numbers; without values: none are; None: all are
    origin: str = ""  # as an export states it; empty: the file does not
    time_unit: str = "s"  # stated for the times; empty: not stated, the rate assumes seconds
    time_flaw: str | None = None  # why the times make no sound rate, so that --rate is used
    has_gap: bool = False  # points are missing or there twice: no --rate mends that

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
    channels: Sequence[MeasuredChannel]
    cues: tuple[int, ...] = ()  # points that are marked as hits, in ascending order
    remarks: tuple[str, ...] = ()  # what a person must know of how it was read

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


def write_described(channels: Sequence[MeasuredChannel], names: Sequence[str]) -> str:
    """Return the channels' properties as JSON, by names in a file."""
    table = [
        {"variable": variable}
        | {name: getattr(channel, name) for name in DESCRIBED}
        | {"sampling_rate": None if math.isnan(channel.sampling_rate) else channel.sampling_rate}
        | {"recorded_at": channel.recorded_at or None}
        for variable, channel in zip(names, channels, strict=True)
    ]
    return json.dumps(table)


def read_described(path: Path, text: str, variables: Mapping[str, Any]) -> Measurement:
    """Return the channels of a file with a text of `write_described`, and its variables."""
    channels = []
    for row in json.loads(text):
        values = keep_values(np.ravel(variables[row["variable"]]), f"{path}, {row['name']}")
        stated = {name: row[name] for name in DESCRIBED if row[name] is not None}
        stated["recorded_at"] = int(stated.get("recorded_at", 0))  # MATLAB writes it as 1.6e18
        channels.append(MeasuredChannel(values=values, **stated))
    return Measurement(path, tuple(channels))


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
