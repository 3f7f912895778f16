"""Where the hammer's output first leaves its baseline: in the raw output, block by block."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.record import ChannelBlock, FloatArray, RawArray
from impact_rig.core.signals.stretch import Stretch

RELATIVE_LEVEL = 0.1
"""Where full scale is unknown, the part of the largest deviation that starts a pulse [-], our
choice: a hit recorded as a whole always has one."""
PULSE_NOISE = 6.0
"""Least height of a pulse, in standard deviations of the noise [-], our choice: noise alone
reaches it in one record of 100 000."""
SPREAD_OF_MEDIAN = 1.4826
"""Standard deviation over median absolute deviation of normal noise [-]."""


class PulseSearch:
    """Finds the next pulse in a stretch of the stream.

    Baseline and level are numbers of the raw output, and whole blocks are held against them by
    their largest and smallest count: nothing is converted where there is no pulse.

    Parameters
    ----------
    settings : AnalysisSettings
        `detection_level` is used.
    """

    def __init__(self, settings: AnalysisSettings) -> None:
        self._settings = settings
        self._noise = 0.0

    def learn(self, quiet: RawArray) -> float:
        """Take the noise from what holds no pulse, and return its baseline."""
        baseline = find_median(quiet)
        self._noise = SPREAD_OF_MEDIAN * find_median(np.abs(quiet - baseline))
        return baseline

    def find(self, stretch: Stretch, baseline: float, last: int) -> int | None:
        """Find the first pulse that is not searched yet, up to the point `last`.

        Parameters
        ----------
        stretch : Stretch
            Searched from its `searched` on, which is not changed.
        baseline : float
            Of the hammer's raw output.
        last : int
            Behind the last point to be looked at.

        Returns
        -------
        int or None
            The first point at or above the level; None: there is none.
        """
        channel = stretch.block.hammer
        if channel.full_scale > 0.0:
            level = self._settings.detection_level * abs(channel.full_scale / channel.scale)
        else:
            # Without a full scale the level is a part of the largest pulse: of the whole stretch.
            level = find_relative_level(np.abs(stretch.read(stretch.start, last)[0] - baseline))
        level = max(level, PULSE_NOISE * self._noise, channel.resolution / abs(channel.scale))
        for start, output in stretch.read_hammer(stretch.searched, last):
            index = _find_departure(output, baseline, level)
            if index is not None:
                return start + index
        return None


def count_window_points(settings: AnalysisSettings, sampling_rate: float) -> tuple[int, int]:
    """Return pre-trigger and length of a hit's window [points] at a rate [Hz]."""
    before, length = settings.pre_trigger * sampling_rate, settings.record_duration * sampling_rate
    return max(round(before), 1), max(round(length), 1)


def to_acceleration(channel: ChannelBlock, output: RawArray) -> FloatArray:
    """Return raw output of a channel as acceleration [m/s^2], read-only."""
    acceleration: FloatArray = np.multiply(channel.scale, output, dtype=np.float64)
    acceleration += channel.offset
    acceleration.setflags(write=False)
    return acceleration


def find_median(values: NDArray[Any]) -> float:
    """Return what `numpy.median` does, of short arrays in a third of its time.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Of at least one number.
    """
    low, high = (values.size - 1) // 2, values.size // 2
    ordered = np.partition(values, (low, high, values.size - 1))
    largest = float(ordered[-1])
    # Numbers that are none lie at the end, and leave no median.
    return largest if math.isnan(largest) else (float(ordered[low]) + float(ordered[high])) / 2


def find_quietest(output: RawArray, count: int) -> RawArray:
    """Return that part of `count` points in which least happens; all, if there are no more.

    Parameters
    ----------
    output : ndarray, shape (n,)
        Cut into parts from its beginning on; what is left over at its end is left out.
    count : int
        Points of a part.
    """
    parts = output.size // count
    if not parts:
        return output
    split = output[: parts * count].reshape(parts, count)
    # Where numbers are none, much happens.
    quietest: RawArray = split[int(np.nan_to_num(np.ptp(split, axis=1), nan=np.inf).argmin())]
    return quietest


def find_relative_level(deviation: FloatArray) -> float:
    """Return what a pulse must reach where full scale is unknown [unit of the deviation].

    Infinite: nothing stands out of the noise.
    """
    largest = float(deviation.max())
    noise = SPREAD_OF_MEDIAN * float(np.median(deviation))
    return RELATIVE_LEVEL * largest if largest > PULSE_NOISE * noise else np.inf


def _find_departure(output: RawArray, baseline: float, level: float) -> int | None:
    """Find the first point that deviates from the baseline by `level` or more."""
    if output.dtype == np.int32:
        # Of whole numbers these differences are exact, as those of the points below are.
        top, bottom = int(np.maximum.reduce(output)), int(np.minimum.reduce(output))
        if top - baseline < level and baseline - bottom < level:
            return None
    above = np.abs(output - baseline) >= level
    index = int(above.argmax())
    return index if above[index] else None
