"""What a sensor makes of an acceleration: a second-order system behind a high-pass of first order.

    w0^2 / (s^2 + 2 zeta w0 s + w0^2)  *  s / (s + wc)

Between its points an acceleration is taken as straight (a first-order hold), for which the filter
is exact.
"""

import math
from functools import lru_cache

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.signal import cont2discrete, lfilter

from impact_rig.core.setup.sensors import SensorResponse
from impact_rig.core.signals.record import FloatArray, make_read_only


def respond(traces: FloatArray, response: SensorResponse, sampling_rate: float) -> FloatArray:
    """Return what a sensor shows of accelerations that were zero before their first point.

    Parameters
    ----------
    traces : ndarray, shape (..., n)
        Along the last axis.
    sampling_rate : float
        [Hz]

    Returns
    -------
    ndarray, shape (..., n)
    """
    if response.is_flat:
        return traces
    numerator, denominator = _design(
        response.resonance / sampling_rate, response.damping, response.low_corner / sampling_rate
    )
    return np.asarray(lfilter(numerator, denominator, traces, axis=-1))


@lru_cache(maxsize=16)
def _design(resonance: float, damping: float, low_corner: float) -> tuple[FloatArray, FloatArray]:
    """Return the coefficients of the filter, its frequencies over the sampling rate."""
    natural, corner = 2.0 * math.pi * resonance, 2.0 * math.pi * low_corner
    numerator, denominator = np.ones(1), np.ones(1)
    if natural:
        numerator = numerator * natural**2
        denominator = np.array([1.0, 2.0 * damping * natural, natural**2])
    if corner:
        numerator = np.append(numerator, 0.0)
        denominator = np.convolve(denominator, [1.0, corner])
    discrete = cont2discrete((numerator, denominator), 1.0, "foh")
    return make_read_only(np.ravel(discrete[0])), make_read_only(np.ravel(discrete[1]))


def restore_level(traces: FloatArray, low_corner: float, sampling_rate: float) -> FloatArray:
    """Return traces, shape (..., n), zero before their first point, without the high-pass."""
    if not low_corner:
        return traces
    lost = cumulative_trapezoid(traces, dx=1.0 / sampling_rate, axis=-1, initial=0.0)
    return np.asarray(traces + 2.0 * math.pi * low_corner * lost)
