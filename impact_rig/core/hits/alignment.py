"""Hits laid onto each other below one sampling step."""

import numpy as np
from scipy.interpolate import CubicSpline

from impact_rig.core.signals.record import FloatArray


def align_traces(traces: FloatArray, middle: float) -> tuple[FloatArray, int]:
    """Shift traces by a part of a point so that `middle` falls onto a point.

    Parameters
    ----------
    traces : ndarray, shape (channels, n)
        Filtered, so that cubic splines follow them.
    middle : float
        In points, fractional.

    Returns
    -------
    traces : ndarray, shape (channels, n - 1 or n)
        By cubic splines; exact where the shift is zero.
    origin : int
        The point of the middle.
    """
    origin = int(np.floor(middle))
    fraction = middle - origin
    if fraction == 0.0:
        return traces, origin
    count = traces.shape[1]
    spline = CubicSpline(np.arange(count), traces, axis=1)
    return spline(np.arange(count - 1) + fraction), origin
