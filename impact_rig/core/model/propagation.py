"""Linear systems without input on a uniform grid, y(t) = e^(Nt) y(0), for many systems at once.

With P the step from point to point, what is read off a state, C P^n y, needs no state at most
points: with n = i b + j it is (C P^j) (P^(i b) y), few rows times few states. The powers of a
scaled matrix, multiplied once, are the terms of the exponential series of all the matrices that
takes; only the states, one for each block of points, are made one from another, by doubling. That
is exact for every damping, critical damping included, and costs little more than to write the
result down.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.signals.record import FloatArray, make_read_only

ORDER = 32
"""Highest power in the exponential series [-]."""
LARGEST_NORM = 4.0
"""Up to which the series is used [-]: what it leaves out, 4^33 / 33!, is below 1e-17."""
LONGEST_BLOCK = 128
"""Points that one state serves at most [-], measured: rows and states are then few."""
_POWERS = np.arange(ORDER + 1.0)
_COEFFICIENTS = np.array([1.0 / math.factorial(n) for n in range(ORDER + 1)])


class Moments(NamedTuple):
    """Times of one system, counted from its start [points].

    Attributes
    ----------
    first : float
        Of the first point.
    end : float
        Of the state that is wanted besides, not before `first`; beyond the last point it means
        nothing.
    """

    first: float
    end: float


def find_room(count: int) -> int:
    """Return on how many points `simulate_linear_systems` works at most: whole blocks."""
    return -(-count // LONGEST_BLOCK) * LONGEST_BLOCK


def simulate_linear_systems(
    matrices: FloatArray,
    initial: FloatArray,
    readout: FloatArray,
    moments: Sequence[Moments],
    count: int,
    out: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Compute C e^(At) y on a uniform grid, and e^(At) y at one time more.

    Parameters
    ----------
    matrices : ndarray, shape (systems, d, d)
        A, finite, for a time that is counted in points.
    initial : ndarray, shape (systems, d)
        y.
    readout : ndarray, shape (systems, r, d)
        C, what is read off a state.
    moments : sequence of Moments
        One for each system.
    count : int
        Number of points, one or more.
    out : ndarray, shape (systems, r, m), optional
        Where to put the values: m is `find_room` of `count` or more, and of so many points those
        beyond `count` mean nothing.

    Returns
    -------
    values : ndarray, shape (systems, r, count)
    states : ndarray, shape (systems, d)
        At the end that each system's moments name.
    """
    systems, outputs, size = readout.shape
    exponent = _find_reach(matrices)
    # A point that is too far for the series is halved, and its exponential squared.
    squarings, block = max(-exponent, 0), 1 << max(exponent, 0)
    powers = _raise(matrices * 0.5**squarings if squarings else matrices, readout)
    rows = (_make_series(block) @ powers[..., size * size :]).reshape(-1, block, outputs, size)

    blocks = -(-count // block)
    places = [_divide(moment, block, blocks) for moment in moments]
    jumps = _exponentiate(
        [(block, place.first, place.left) for place in places], powers, size, squarings
    )
    to_block, to_first, to_end = jumps[:, 0], jumps[:, 1], jumps[:, 2]
    begin = to_first @ initial[..., np.newaxis]
    if any(place.skipped for place in places):
        begin = _skip(to_block, begin, np.array([[[place.skipped]] for place in places]))
    states = _propagate(to_block, begin, blocks)
    if out is None:
        out = np.empty((systems, outputs, blocks * block))
    np.matmul(
        states[:, np.newaxis],
        rows.transpose(0, 2, 3, 1),
        out=out[..., : blocks * block].reshape(systems, outputs, blocks, block),
    )
    last = [number * blocks + place.last for number, place in enumerate(places)]
    before_end = states.reshape(-1, size).take(last, axis=0)
    return out[..., :count], (to_end @ before_end[..., np.newaxis])[..., 0]


def _find_reach(matrices: FloatArray) -> int:
    """Return which power of two says how many points the series reaches, or what part of one."""
    norm = np.maximum.reduce(np.add.reduce(np.abs(matrices), axis=-2), axis=None, initial=0.0)
    longest = LONGEST_BLOCK.bit_length() - 1
    return min(math.frexp(LARGEST_NORM / norm)[1] - 1, longest) if norm > 0.0 else longest


def _raise(matrices: FloatArray, readout: FloatArray) -> FloatArray:
    """Return A^n and below it C A^n for n = 0 ... ORDER, shape (systems, ORDER + 1, (d + r) d)."""
    systems, outputs, size = readout.shape
    height = size + outputs
    rows = np.empty((systems, (ORDER + 1) * height, size))
    rows[:, :size], rows[:, size:height] = _make_identity(size), readout
    np.matmul(rows[:, :height], matrices, out=rows[:, height : 2 * height])
    done = height
    while done < ORDER * height:
        end = done + height
        np.matmul(rows[:, height:end], rows[:, done : done + size], out=rows[:, end : end + done])
        done *= 2
    return rows.reshape(systems, ORDER + 1, -1)


@lru_cache(maxsize=16)
def _make_series(block: int) -> FloatArray:
    """Return what each power has in e^(jA), shape (block, ORDER + 1)."""
    return make_read_only(np.arange(block)[:, np.newaxis] ** _POWERS * _COEFFICIENTS)


@lru_cache(maxsize=16)
def _make_identity(size: int) -> FloatArray:
    return make_read_only(np.eye(size))


class _Places(NamedTuple):
    """How a system's moments are reached, in points.

    Attributes
    ----------
    skipped : int
        Blocks before the one in which the first point lies.
    first : float
        From there to it.
    last : int
        The last block of points that begins before the end.
    left : float
        From there to it.
    """

    skipped: int
    first: float
    last: int
    left: float


def _divide(moment: Moments, block: int, blocks: int) -> _Places:
    skipped, first = divmod(moment.first, block)
    duration = moment.end - moment.first
    last = min(duration // block, blocks - 1)
    return _Places(int(skipped), first, int(last), min(duration - last * block, block))


def _exponentiate(
    times: Sequence[tuple[float, ...]], powers: FloatArray, size: int, squarings: int
) -> FloatArray:
    """Return e^(At) of each system at times of its own, shape (systems, times, d, d)."""
    series = np.array(times)[..., np.newaxis] ** _POWERS
    series *= _COEFFICIENTS
    # e^A - 1 is squared, not e^A, which keeps the digits of small matrices beside large ones.
    series[..., 0] = 0.0
    result: FloatArray = series @ powers[..., : size * size]
    result = result.reshape(*series.shape[:2], size, size)
    identity = _make_identity(size)
    for _ in range(squarings):
        result = result @ (result + 2.0 * identity)
    result += identity
    return result


def _skip(power: FloatArray, states: FloatArray, numbers: NDArray[np.int_]) -> FloatArray:
    """Return P^n y with n of each system's own, shape (systems, d, 1)."""
    while numbers.any():
        states = np.where(numbers & 1, power @ states, states)
        numbers, power = numbers >> 1, power @ power
    return states


def _propagate(power: FloatArray, initial: FloatArray, count: int) -> FloatArray:
    """Return P^n y for n = 0 ... count - 1 by doubling, shape (systems, count, d)."""
    result = np.empty((len(initial), count, initial.shape[1]))
    result[:, :1] = initial.swapaxes(-1, -2)
    transposed = power.swapaxes(-1, -2)
    done = 1
    while done < count:
        more = min(done, count - done)
        np.matmul(result[:, :more], transposed, out=result[:, done : done + more])
        done += more
        if done < count:
            transposed = transposed @ transposed
    return result
