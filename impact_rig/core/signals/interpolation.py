"""Traces read between their points, all by the same part of a point."""

import numpy as np
from scipy.ndimage import spline_filter1d

from impact_rig.core.checks import check_between
from impact_rig.core.signals.record import FloatArray


def interpolate_between(traces: FloatArray, fraction: float) -> FloatArray:
    """Return what lies by a part of a point behind every point but the last.

    By cubic splines on equidistant points: since the part is the same everywhere, four
    coefficients stand with the same weights behind every value. At the ends the traces are taken
    as mirrored, which reaches some ten points inside.

    Parameters
    ----------
    traces : ndarray, shape (..., n)
        Along the last axis; two points or more.
    fraction : float
        0 to 1 [points].

    Returns
    -------
    ndarray, shape (..., n - 1)

    Raises
    ------
    ParameterError
        If the part is not between 0 and 1.
    """
    check_between("part of a point", fraction, 0.0, 1.0)
    spline = spline_filter1d(traces, order=3, axis=-1, mode="mirror")
    spline = np.concatenate((spline[..., 1:2], spline, spline[..., -2:-1]), axis=-1)
    rest = 1.0 - fraction
    # Cubic B-splines, at two points on either side.
    weights = (
        rest**3 / 6.0,
        2.0 / 3.0 - fraction**2 * (1.0 - fraction / 2.0),
        2.0 / 3.0 - rest**2 * (1.0 - rest / 2.0),
        fraction**3 / 6.0,
    )
    count = spline.shape[-1] - 3
    between = weights[0] * spline[..., :count]
    for place, weight in enumerate(weights[1:], start=1):
        between += weight * spline[..., place : place + count]
    return np.asarray(between)
