"""Hits laid onto each other below one sampling step."""

import numpy as np

from impact_rig.core.signals.interpolation import interpolate_between
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
    return interpolate_between(traces, fraction), origin
