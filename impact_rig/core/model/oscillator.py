"""Damped oscillators left alone, on a uniform grid, for many of them at once.

The acceleration of x'' + D x' + K x = 0 obeys the same equation, so that from its value A and its
slope J at the start it is A C + (J + a A) / w S with a = D / 2, w^2 = K - a^2 and

    C(t) = e^(-at) cos wt,   S(t) = e^(-at) sin wt,

which turn into hyperbolic functions beyond critical damping. By the addition theorems of C and S,
the values at all sums of some sqrt(n) late times and sqrt(n) short ones are one matrix product.
"""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from impact_rig.core.signals.record import FloatArray, make_read_only

SMALLEST_ROOT = 1e-100
"""|w| is taken as this at least: sin wt / w is then t to the last bit, as it must be."""


def find_padding(count: int) -> int:
    """Return how much longer a record of `count` points must be that is written in whole rows."""
    return math.isqrt(count) + 1


def simulate_free_oscillators(
    stiffness: FloatArray,
    damping: FloatArray,
    state: FloatArray,
    moments: FloatArray,
    count: int,
    out: Sequence[FloatArray],
) -> None:
    """Compute the accelerations of oscillators left alone, in any unit of time.

    Parameters
    ----------
    stiffness, damping : ndarray, shape (models, bodies)
        K, above zero, and D.
    state : ndarray, shape (models, 2, bodies)
        x and x' at the start.
    moments : ndarray, shape (2, models)
        Time from point to point, and of the first point.
    count : int
        Number of points, one or more: of the longest record.
    out : sequence of ndarray, shape (bodies, m)
        Records, one for each model, that are filled: m is its number of points, at most `count`,
        and `find_padding` of `count` or more, of which the last mean nothing.
    """
    blocks, grid = _split(count)
    numbers = np.array(
        [
            _describe(*pair)
            for pair in zip(stiffness.ravel().tolist(), damping.ravel().tolist(), strict=True)
        ]
    ).reshape(*stiffness.shape, -1)
    fundamental = _find_fundamental(numbers, (moments.T @ grid)[:, np.newaxis])
    own = state.swapaxes(1, 2)[..., np.newaxis]
    weights = (numbers[..., 3:].reshape(*stiffness.shape, 4, 2) @ own).reshape(
        *stiffness.shape, 2, 2
    )
    lists = weights @ fundamental[..., :blocks]
    rows, columns = lists.swapaxes(-1, -2), fundamental[..., blocks:]
    block = columns.shape[-1]
    for record, late, short in zip(out, rows, columns, strict=True):
        needed = min(blocks, record.shape[1] // block)
        whole = record[:, : needed * block].reshape(-1, needed, block)
        np.matmul(late[:, :needed], short, out=whole)


@lru_cache(maxsize=64)
def _split(count: int) -> tuple[int, FloatArray]:
    """Return how many late times there are, and all times in moments, shape (2, times).

    First come the late times, then the short ones that are added to each.
    """
    block = math.isqrt(count - 1) + 1
    later = np.arange(0, count, block)
    grid = np.zeros((2, later.size + block))
    grid[0, : later.size], grid[0, later.size :] = later, np.arange(block)
    grid[1, : later.size] = 1.0
    return later.size, make_read_only(grid)


def _describe(stiffness: float, damping: float) -> tuple[float, ...]:
    """Return what is needed of one oscillator.

    |w|; minus the slower decay's rate, which is a below critical damping; 1 beyond it, -1 below;
    and of the matrix ((A, B), (B, sign A)) with B = (J + a A) / |w| each entry's part of x and of
    x'.
    """
    half = 0.5 * damping
    square = stiffness - half * half
    root = max(math.sqrt(abs(square)), SMALLEST_ROOT)
    sign = -1.0 if square > 0.0 else 1.0
    # Written so that it does not vanish in rounding.
    slower = half if square > 0.0 else stiffness / (half + root)
    by_position, by_speed = stiffness * half / root, (2.0 * half * half - stiffness) / root
    return (
        *(root, -slower, sign),
        *(-stiffness, -damping, by_position, by_speed, by_position, by_speed),
        *(-sign * stiffness, -sign * damping),
    )


def _find_fundamental(numbers: FloatArray, times: FloatArray) -> FloatArray:
    """Return C and S, shape (models, bodies, 2, times)."""
    angle = numbers[..., :1] * times
    result = np.empty((*angle.shape[:2], 2, angle.shape[2]))
    np.cos(angle, out=result[..., 0, :])
    np.sin(angle, out=result[..., 1, :])
    is_aperiodic = numbers[..., 2] > 0.0
    if is_aperiodic.any():
        # (1 + e^(-2wt)) / 2 and (1 - e^(-2wt)) / 2, times the slower of the two decays.
        apart = -0.5 * np.expm1(-2.0 * angle[is_aperiodic])
        result[is_aperiodic, 0], result[is_aperiodic, 1] = 1.0 - apart, apart
    result *= np.exp(numbers[..., 1:2] * times)[..., np.newaxis, :]
    return result
