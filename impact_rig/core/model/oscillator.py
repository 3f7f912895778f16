"""Damped oscillators left alone, on a uniform grid, for many of them at once.

The acceleration of x'' + D x' + K x = 0 obeys the same equation, so that from its value A and its
slope J at the start it is A C + (J + a A) S with a = D / 2, w^2 = K - a^2 and

    C(t) = e^(-at) cos wt,   S(t) = e^(-at) sin wt / w,

which turn into hyperbolic functions beyond critical damping, and into e^(-at) and t e^(-at) at it.
By the addition theorems of C and S, the values at all sums of some sqrt(n) late times and sqrt(n)
short ones are one matrix product.
"""

import math

import numpy as np

from impact_rig.core.signals.record import FloatArray

SMALLEST_ROOT = 1e-100
"""|w| is taken as this at least: sin wt / w is then t to the last bit, as it must be."""


def simulate_free_oscillators(
    stiffness: FloatArray,
    damping: FloatArray,
    state: FloatArray,
    late: FloatArray,
    step: FloatArray,
    count: int,
) -> FloatArray:
    """Compute the accelerations of oscillators left alone, in any unit of time.

    Parameters
    ----------
    stiffness, damping : ndarray, shape (models, bodies)
        K, above zero, and D.
    state : ndarray, shape (models, 2, bodies)
        x and x' at the start.
    late, step : ndarray, shape (models,)
        Time of the first point, and from point to point.
    count : int
        Number of points.

    Returns
    -------
    ndarray, shape (models, bodies, count)
    """
    block = math.isqrt(count - 1) + 1
    later = np.arange(0, count, block)
    times = np.empty((late.size, 1, later.size + block))
    np.multiply.outer(step, later, out=times[:, 0, : later.size])
    times[:, 0, : later.size] += late[:, np.newaxis]
    np.multiply.outer(step, np.arange(block), out=times[:, 0, later.size :])

    half = 0.5 * damping
    square = stiffness - half * half
    fundamental = _find_fundamental(stiffness, half, square, times)
    acceleration = -stiffness * state[:, 0] - damping * state[:, 1]
    jerk = -stiffness * state[:, 1] - damping * acceleration
    weights = np.empty((*stiffness.shape, 2, 2))
    weights[..., 0, 0] = acceleration
    weights[..., 0, 1] = weights[..., 1, 0] = jerk + half * acceleration
    weights[..., 1, 1] = -square * acceleration
    lists = weights @ fundamental[..., : later.size]
    values = lists.swapaxes(-1, -2) @ fundamental[..., later.size :]
    result: FloatArray = values.reshape(*stiffness.shape, -1)[..., :count]
    return result


def _find_fundamental(
    stiffness: FloatArray, half: FloatArray, square: FloatArray, times: FloatArray
) -> FloatArray:
    """Return C and S, shape (models, bodies, 2, times)."""
    root = np.sqrt(np.abs(square))
    np.maximum(root, SMALLEST_ROOT, out=root)
    angle = root[..., np.newaxis] * times
    result = np.empty((*root.shape, 2, times.shape[-1]))
    np.cos(angle, out=result[..., 0, :])
    np.sin(angle, out=result[..., 1, :])
    slower = half
    is_aperiodic = square <= 0.0
    if is_aperiodic.any():
        # (1 + e^(-2wt)) / 2 and (1 - e^(-2wt)) / 2, times the slower of the two decays, which is
        # written so that it does not vanish in rounding.
        apart = -0.5 * np.expm1(-2.0 * angle[is_aperiodic])
        result[is_aperiodic, 0], result[is_aperiodic, 1] = 1.0 - apart, apart
        slower = np.where(is_aperiodic, stiffness / (half + root), half)
    decay = np.exp(-slower[..., np.newaxis] * times)
    result[..., 0, :] *= decay
    result[..., 1, :] *= decay / root[..., np.newaxis]
    return result
