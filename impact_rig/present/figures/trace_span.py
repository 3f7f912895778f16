"""Which part of traces there is something to see in."""

from collections.abc import Sequence

import numpy as np

from impact_rig.core.signals.record import FloatArray
from impact_rig.results.sample_traces import SampleTraces

PULSE_WIDTHS_BEFORE, PULSE_WIDTHS_AFTER = 1.2, 2.0
"""What is shown at least, before and after the middle of the pulse [tau_p], our choice."""


def cut_trace(
    time: FloatArray, values: FloatArray, start: float, stop: float
) -> tuple[FloatArray, FloatArray]:
    """Return the points of a line from `start` to `stop`, both included [as `time`]."""
    inside = (time >= start) & (time <= stop)
    return time[inside], values[inside]


def compute_fading_time(time: FloatArray, traces: FloatArray, level: float) -> float:
    """Return when the last of the traces has faded.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Of the points.
    traces : ndarray, shape (channels, n)
        What fades; points that are not finite count as nothing.
    level : float
        Part of each trace's largest magnitude below which it has faded [-].

    Returns
    -------
    float
        Time of the last point at or above `level` in any trace; that of the first point for
        traces that are zero.
    """
    sizes = np.nan_to_num(np.abs(traces), nan=0.0, posinf=0.0)
    peaks = sizes.max(axis=1, keepdims=True)
    loud = np.flatnonzero(((sizes >= level * peaks) & (peaks > 0.0)).any(axis=0))
    return float(time[loud[-1]]) if loud.size else float(time[0])


def choose_span(
    samples: Sequence[SampleTraces], channels: slice, level: float
) -> tuple[float, float]:
    """Return from when to when there is something to see in channels of any sample [s]."""
    longest = max(sample.contact_time for sample in samples)
    faded = max(
        compute_fading_time(sample.time, sample.mean[channels], level) for sample in samples
    )
    start = max(-PULSE_WIDTHS_BEFORE * longest, *(sample.time[0] for sample in samples))
    last = min(sample.time[-1] for sample in samples)
    return start, min(max(PULSE_WIDTHS_AFTER * longest, faded), last)
