"""Width of a pulse between interpolated crossings, and its uncertainty."""

from dataclasses import dataclass

import numpy as np

from impact_rig.core.errors import SignalError
from impact_rig.core.records import FloatArray

HALF_LEVEL = 0.5
TENTH_LEVEL = 0.1


@dataclass(frozen=True)
class PulseWidth:
    """A pulse read at half and at a tenth of its peak; crossings and widths in points."""

    peak_index: int  # point of the largest |value|
    peak: float  # signed [unit of the trace]
    rise: float  # half-amplitude crossing before the peak
    fall: float  # the same after the peak
    half_amplitude_width: float  # w50
    tenth_amplitude_width: float  # w10; NaN: the trace does not come down to a tenth

    @property
    def middle(self) -> float:
        """Midpoint of the half-amplitude crossings, in points, fractional."""
        return (self.rise + self.fall) / 2.0

    @property
    def width_ratio(self) -> float:
        """w10 / w50 [-]."""
        return self.tenth_amplitude_width / self.half_amplitude_width


def find_crossing(trace: FloatArray, peak_index: int, level: float, step: int) -> float:
    """Find where a positive pulse crosses `level`, walking from its peak.

    Parameters
    ----------
    trace : ndarray, shape (n,)
        Positive at the peak.
    peak_index : int
        Where to start.
    level : float
        In the trace's unit, below the peak.
    step : {-1, 1}
        Backwards or forwards.

    Returns
    -------
    float
        In points, linearly interpolated; NaN if the trace ends first.
    """
    side = trace[peak_index:] if step > 0 else trace[peak_index::-1]
    below = side < level
    index = int(np.argmax(below))
    if not below[index]:
        return float("nan")
    inner, outer = float(side[index - 1]), float(side[index])
    return peak_index + step * (index - 1 + (inner - level) / (inner - outer))


def measure_rise(trace: FloatArray) -> float:
    """Return how long the largest pulse of a trace takes from a tenth to nine tenths of its peak.

    Parameters
    ----------
    trace : ndarray, shape (n,)
        Its baseline is zero; either polarity.

    Returns
    -------
    float
        In points; NaN if the trace begins within the rise.
    """
    upright = np.abs(trace)
    peak_index = int(upright.argmax())
    low, high = (
        find_crossing(upright, peak_index, level * float(upright[peak_index]), -1)
        for level in (TENTH_LEVEL, 1.0 - TENTH_LEVEL)
    )
    return high - low


def measure_pulse(trace: FloatArray) -> PulseWidth:
    """Measure the largest pulse of a trace whose baseline is zero.

    Parameters
    ----------
    trace : ndarray, shape (n,)
        Either polarity.

    Returns
    -------
    PulseWidth

    Raises
    ------
    SignalError
        If the trace is flat, or does not fall to half its peak on both sides.
    """
    peak_index = int(np.argmax(np.abs(trace)))
    peak = float(trace[peak_index])
    if not np.isfinite(peak) or peak == 0.0:
        raise SignalError("the trace has no pulse: it must leave its baseline and come back")
    upright = trace if peak > 0 else -trace
    height = abs(peak)
    rise, fall = (find_crossing(upright, peak_index, HALF_LEVEL * height, s) for s in (-1, 1))
    if np.isnan(rise) or np.isnan(fall):
        raise SignalError(
            "the pulse is cut off: the trace must fall to half its peak on both sides"
        )
    low, high = (find_crossing(upright, peak_index, TENTH_LEVEL * height, s) for s in (-1, 1))
    return PulseWidth(
        peak_index=peak_index,
        peak=peak,
        rise=rise,
        fall=fall,
        half_amplitude_width=fall - rise,
        tenth_amplitude_width=high - low,
    )
