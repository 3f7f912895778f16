"""What any file of measured channels comes down to."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.checks import check_positive
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.core.setup.calibration import normalize_unit
from impact_rig.core.signals.record import RawArray

EXACT_INTEGERS = 2**53
"""Up to here float64 holds every whole number [-]."""
EARLIEST, LATEST = 315_532_800, 2_145_916_800
"""A date is believed between these, 1980 and 2038 [s since the epoch]. Our choice: clocks that
were never set begin in 1904, 1970 or 1980, and ROS 2's stamps end in January 2038."""
NANOSECONDS = 1_000_000_000
"""In a second [ns]."""


@dataclass(frozen=True)
class MeasuredChannel:
    """One channel as its file states it.

    Attributes
    ----------
    name : str
        As in the file; "column 1", "channel 1" and so on where it states none.
    values : ndarray of int32 or float64, shape (n,)
        The file's numbers, neither scaled nor rounded, NaN and infinity among them; read-only.
    sampling_rate : float
        [Hz]; NaN: the file does not state it.
    unit : str
        Of the values, spelled as `impact_rig.core.setup.calibration` does if it is known there;
        empty: the file does not state it.
    start : float
        Time of the first point [s].
    recorded_at : int
        When that time was 0, nanoseconds since the epoch in UTC; 0: the file does not state it,
        or a date that is not between `EARLIEST` and `LATEST`.
    """

    name: str
    values: RawArray
    sampling_rate: float = math.nan
    unit: str = ""
    start: float = 0.0
    recorded_at: int = 0

    def __post_init__(self) -> None:
        """Copy the values, make them read-only, and refuse what cannot be meant."""
        what = f"channel {self.name!r}"
        values = np.array(self.values)
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
    """All channels of one file.

    Attributes
    ----------
    path : Path
        Of the file.
    channels : tuple of MeasuredChannel
        One at least, in the order of the file. Lengths, rates and starts may differ.
    """

    path: Path
    channels: tuple[MeasuredChannel, ...]

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
    if (
        kind in "iu"
        and array.size
        and max(abs(int(array.min())), int(array.max())) > EXACT_INTEGERS
    ):
        raise FileError(
            f"{what} holds whole numbers beyond 2^53: float64 cannot keep them exactly"
        )
    if kind not in "iuf" or array.dtype.itemsize > np.dtype(np.float64).itemsize:
        raise FileError(
            f"{what} holds {array.dtype}: a channel is of real numbers, float64 at most"
        )
    return array.astype(np.float64, copy=False)
