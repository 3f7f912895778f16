"""Closed solutions of linear systems and damped oscillators."""

import cmath
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
    """Return e^(At) of each system at its own times, shape (systems, times, d, d)."""
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


NEARLY_CRITICAL = 1e-5
"""Distance of both decay rates from their mean, over it, at least [-]: nearer ones count as so far
apart, which changes a trace by 1e-10, and keeps the digits of their difference."""


class FreeOscillator(NamedTuple):
    """An oscillator x'' = -K x - D x' left alone, its times counted in points."""

    stiffness: float  # K, above zero
    damping: float  # D
    position: float  # at the start
    speed: float
    first: float  # time of the first point


def simulate_free_oscillators(oscillators: Sequence[FreeOscillator], count: int) -> FloatArray:
    """Compute the accelerations of oscillators left alone, shape (oscillators, count)."""
    block = math.isqrt(count - 1) + 1
    described = np.array([_describe(oscillator, block) for oscillator in oscillators])
    far = np.conj(_make_powers(described[:, :2], described[:, 2:4], -(-count // block)))
    near = _make_powers(1.0, described[:, 4:], block)
    # The real parts of all products.
    values: FloatArray = far.view(np.float64) @ near.view(np.float64).swapaxes(1, 2)
    return values.reshape(len(values), -1)[:, :count]


def _describe(oscillator: FreeOscillator, block: int) -> tuple[complex, ...]:
    """Return the two decays whose sum it is: first values, factors of a block and of a point."""
    stiffness, damping, position, speed, first = oscillator
    half = damping / 2.0
    root = cmath.sqrt(half * half - stiffness)
    if abs(root) < NEARLY_CRITICAL * half:
        root = complex(NEARLY_CRITICAL * half)
    fast = -half - root
    # Their product is K: -D / 2 + root would lose its digits to a large D.
    slow = stiffness / fast
    return (
        slow**2 * (speed - fast * position) / (slow - fast) * cmath.exp(slow * first),
        fast**2 * (slow * position - speed) / (slow - fast) * cmath.exp(fast * first),
        *(cmath.exp(rate * block) for rate in (slow, fast)),
        *(cmath.exp(rate) for rate in (slow, fast)),
    )


def _make_powers(
    first: NDArray[np.complex128] | float, factor: NDArray[np.complex128], count: int
) -> NDArray[np.complex128]:
    """Return first, first * factor and so on, shape (oscillators, count, 2)."""
    powers = np.empty((len(factor), count, 2), dtype=np.complex128)
    powers[:, 0], powers[:, 1:] = first, factor[:, np.newaxis]
    return np.multiply.accumulate(powers, axis=1, out=powers)
