"""Closed solutions of linear systems and damped oscillators."""

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.records import FloatArray, make_read_only

ORDER = 16
"""Highest power in the exponential series [-]."""
LARGEST_NORM = 1.0
"""Up to which the series is used [-]: what it leaves out, 1 / 17!, is below 3e-15."""
LONGEST_BLOCK = 32
"""Points that one state serves at most [-], measured: rows and states are then few."""
_POWERS = np.arange(ORDER + 1.0)
_COEFFICIENTS = np.array([1.0 / math.factorial(n) for n in range(ORDER + 1)])

Rows = tuple[slice, slice]
"""An index of rows of all systems."""


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


def simulate_linear_systems(
    matrices: FloatArray,
    initial: FloatArray,
    readout: FloatArray,
    moments: Sequence[Moments],
    count: int,
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

    Returns
    -------
    values : ndarray, shape (systems, r, count)
    states : ndarray, shape (systems, d)
        At the end that each system's moments name.
    """
    systems, outputs, size = readout.shape
    exponent = _compute_reach(matrices)
    # A point that is too far for the series is halved, and its exponential squared.
    squarings, block = max(-exponent, 0), 1 << max(exponent, 0)
    powers = _raise(matrices * 0.5**squarings if squarings else matrices, readout)
    rows = (_make_series(block) @ powers[..., size * size :]).reshape(-1, block, outputs, size)

    blocks = -(-count // block)
    places = [_divide(*moment, block, blocks) for moment in moments]
    skipped, last, times = zip(*places, strict=True)
    jumps = _exponentiate(times, powers, size, squarings)
    to_block, to_first, to_end = jumps[:, 0], jumps[:, 1], jumps[:, 2]
    begin = to_first @ initial[:, :, np.newaxis]
    if any(skipped):
        begin = _skip(to_block, begin, np.array(skipped))
    states = _propagate(to_block, begin, blocks)
    values = np.empty((systems, outputs, blocks, block))
    np.matmul(
        states[:, np.newaxis],
        rows.transpose(0, 2, 3, 1),
        out=values,
    )
    before_end = states.reshape(-1, size, 1).take(
        [number * blocks + place for number, place in enumerate(last)], axis=0
    )
    return values.reshape(systems, outputs, -1)[..., :count], (to_end @ before_end)[..., 0]


def _compute_reach(matrices: FloatArray) -> int:
    """Return which power of two says how many points the series reaches, or what part of one."""
    norm = np.maximum.reduce(np.add.reduce(np.abs(matrices), 1), None)
    longest = LONGEST_BLOCK.bit_length() - 1
    return min(math.frexp(LARGEST_NORM / norm)[1] - 1, longest) if norm > 0.0 else longest


def _raise(matrices: FloatArray, readout: FloatArray) -> FloatArray:
    """Return A^n and below it C A^n for n = 0 ... ORDER, shape (systems, ORDER + 1, (d + r) d)."""
    systems, outputs, size = readout.shape
    height = size + outputs
    rows = np.empty((systems, (ORDER + 1) * height, size))
    rows[:, :size], rows[:, size:height] = _make_identity(size), readout
    np.matmul(rows[:, :height], matrices, out=rows[:, height : 2 * height])
    for factors, power, products in _plan_powers(size, height):
        np.matmul(rows[factors], rows[power], out=rows[products])
    return rows.reshape(systems, ORDER + 1, -1)


@lru_cache(maxsize=16)
def _plan_powers(size: int, height: int) -> Sequence[tuple[Rows, Rows, Rows]]:
    """Return which rows times which matrix are which rows, of all powers beyond the first."""
    return tuple(
        (
            _take_rows(height, height + more * height),
            _take_rows(done * height, done * height + size),
            _take_rows((done + 1) * height, (done + 1 + more) * height),
        )
        for done, more in _double(1, ORDER)
    )


def _double(done: int, count: int) -> Iterator[tuple[int, int]]:
    """Yield how many there are already, and how many more are made of them."""
    while done < count:
        more = min(done, count - done)
        yield done, more
        done += more


def _take_rows(first: int, end: int) -> Rows:
    return slice(None), slice(first, end)


@lru_cache(maxsize=16)
def _make_series(block: int) -> FloatArray:
    """Return what each power has in e^(jA), shape (block, ORDER + 1)."""
    return make_read_only(np.arange(block)[:, np.newaxis] ** _POWERS * _COEFFICIENTS)


@lru_cache(maxsize=16)
def _make_identity(size: int) -> FloatArray:
    return make_read_only(np.eye(size))


def _divide(
    first: float, end: float, block: int, blocks: int
) -> tuple[int, int, tuple[float, float, float]]:
    """Return how a system's moments are reached, in points.

    How many blocks come before the one in which the first point lies; the last block of points
    that begins before the end; and how long a block is, how far it is from the former to the
    first point, and from the latter to the end.
    """
    skipped, rest = divmod(first, block)
    duration = end - first
    last = min(int(duration) // block, blocks - 1)
    return int(skipped), last, (block, rest, min(duration - last * block, block))


def _exponentiate(
    times: Sequence[tuple[float, ...]], powers: FloatArray, size: int, squarings: int
) -> FloatArray:
    """Return e^(At) of each system at times of its own, shape (systems, times, d, d)."""
    series = np.array(times)[..., np.newaxis] ** _POWERS
    series *= _COEFFICIENTS
    if squarings:
        # e^A - 1 is squared, not e^A, which keeps the digits of small matrices beside large ones.
        series[..., 0] = 0.0
    result: FloatArray = series @ powers[..., : size * size]
    result = result.reshape(-1, len(times[0]), size, size)
    if squarings:
        identity = _make_identity(size)
        for _ in range(squarings):
            result = result @ (result + 2.0 * identity)
        result += identity
    return result


def _skip(power: FloatArray, states: FloatArray, numbers: NDArray[np.int_]) -> FloatArray:
    """Return P^n y with n of each system's own, shape (systems, d, 1)."""
    numbers = numbers[:, np.newaxis, np.newaxis]
    while numbers.any():
        states = np.where(numbers & 1, power @ states, states)
        numbers, power = numbers >> 1, power @ power
    return states


def _propagate(power: FloatArray, initial: FloatArray, count: int) -> FloatArray:
    """Return P^n y for n = 0 ... count - 1 by doubling, shape (systems, count, d)."""
    result = np.empty((len(initial), count, initial.shape[1]))
    result[:, 0] = initial[..., 0]
    transposed = power.swapaxes(-1, -2)
    for done, known, wanted in _plan_states(count):
        if done > 1:
            transposed = transposed @ transposed
        np.matmul(result[known], transposed, out=result[wanted])
    return result


@lru_cache(maxsize=64)
def _plan_states(count: int) -> Sequence[tuple[int, Rows, Rows]]:
    """Return how many states there are, and which are multiplied to give which."""
    return tuple(
        (done, _take_rows(0, more), _take_rows(done, done + more))
        for done, more in _double(1, count)
    )


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
