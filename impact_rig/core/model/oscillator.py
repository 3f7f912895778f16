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
from typing import NamedTuple

import numpy as np

from impact_rig.core.signals.record import FloatArray, make_read_only

SMALLEST_ROOT = 1e-100
"""|w| is taken as this at least: sin wt / w is then t to the last bit, as it must be."""


class FreeOscillator(NamedTuple):
    """An oscillator left alone, its times counted in points.

    Attributes
    ----------
    stiffness, damping : float
        K, above zero, and D.
    position, speed : float
        x and x' at the start.
    first : float
        Time of the first point.
    """

    stiffness: float
    damping: float
    position: float
    speed: float
    first: float


def compute_padding(count: int) -> int:
    """Return how much longer a record of `count` points must be that is written in whole rows."""
    return math.isqrt(count) + 1


def simulate_free_oscillators(
    oscillators: Sequence[FreeOscillator], count: int, out: Sequence[FloatArray]
) -> None:
    """Compute the accelerations of oscillators left alone.

    Parameters
    ----------
    oscillators : sequence of FreeOscillator
        What moves, and when it is looked at: as many in turn as a record has bodies.
    count : int
        Number of points, one or more: of the longest record.
    out : sequence of ndarray, shape (bodies, m)
        Records that are filled: m is the number of points of each, at most `count`, and
        `compute_padding` of `count` or more, of which the last mean nothing.
    """
    late, grid = _split(count)
    described = [_describe(*oscillator) for oscillator in oscillators]
    numbers = np.array(described)
    exponents = numbers[:, :4].reshape(-1, 2, 2) @ grid
    fundamental = np.empty_like(exponents)
    np.cos(exponents[:, 1], out=fundamental[:, 0])
    np.sin(exponents[:, 1], out=fundamental[:, 1])
    for place, (*_, sign) in enumerate(described):
        if sign > 0.0:
            # (1 + e^(-2wt)) / 2 and (1 - e^(-2wt)) / 2, times the slower of the two decays.
            apart = -0.5 * np.expm1(-2.0 * exponents[place, 1])
            fundamental[place] = 1.0 - apart, apart
    fundamental *= np.exp(exponents[:, :1])
    lists = (numbers[:, 4:8].reshape(-1, 2, 2) @ fundamental[:, :, :late]).swapaxes(1, 2)
    short = fundamental[:, :, late:]
    block, bodies = grid.shape[1] - late, len(oscillators) // len(out)
    for first, record in zip(range(0, len(oscillators), bodies), out, strict=True):
        needed = min(late, record.shape[1] // block)
        whole = record[:, : needed * block].reshape(-1, needed, block)
        own = slice(first, first + bodies)
        np.matmul(lists[own, :needed], short[own], out=whole)


@lru_cache(maxsize=64)
def _split(count: int) -> tuple[int, FloatArray]:
    """Return how many late times there are, and all times in points and firsts, shape (2, times).

    First come the late times, then the short ones that are added to each.
    """
    block = math.isqrt(count - 1) + 1
    later = np.arange(0, count, block)
    grid = np.zeros((2, later.size + block))
    grid[0, : later.size], grid[0, later.size :] = later, np.arange(block)
    grid[1, : later.size] = 1.0
    return later.size, make_read_only(grid)


def _describe(
    stiffness: float, damping: float, position: float, speed: float, first: float
) -> tuple[float, ...]:
    """Return what is needed of one oscillator.

    Minus the slower decay's rate, which is a below critical damping, and that up to the first
    point; |w| likewise; the matrix ((A, B), (B, sign A)) with B = (J + a A) / |w|; and sign,
    which is 1 beyond critical damping, -1 below.
    """
    half = 0.5 * damping
    square = stiffness - half * half
    root = max(math.sqrt(abs(square)), SMALLEST_ROOT)
    sign = -1.0 if square > 0.0 else 1.0
    # Written so that neither vanishes in rounding.
    slower = half if square > 0.0 else stiffness / (half + root)
    value = -stiffness * position - damping * speed
    other = (stiffness * half * position + (2.0 * half * half - stiffness) * speed) / root
    return (
        *(-slower, -slower * first, root, root * first),
        *(value, other, other, sign * value, sign),
    )
