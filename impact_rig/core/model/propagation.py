"""Linear systems without input on a uniform grid, y[n] = P^n y[0], for many systems at once.

What is read off a state, C P^n y, needs no state at most points: with n = i b + j it is
(C P^j) (P^(i b) y), some sqrt(count) rows times as many states, each list made by doubling. That
is exact for every damping, critical damping included, and costs little more than to write the
result down.
"""

import math
from functools import lru_cache

import numpy as np

from impact_rig.core.signals.record import FloatArray, make_read_only

SERIES_BLOCKS = 4
SERIES_ORDER = SERIES_BLOCKS**2 - 1
"""Terms of the exponential series beyond the first [-]."""
LARGEST_NORM = 0.5
"""Up to which the series is used [-]: what it leaves out, 0.5^16 / 16!, is below 1e-18."""
_COEFFICIENTS = np.array(
    [0.0] + [1.0 / math.factorial(n) for n in range(1, SERIES_ORDER + 1)]
).reshape(SERIES_BLOCKS, SERIES_BLOCKS)
"""Of e^A - 1, by powers of A in rows of `SERIES_BLOCKS`."""


def exponentiate(matrices: FloatArray) -> FloatArray:
    """Compute e^A of many matrices at once.

    By the series, scaled down and squared up again. `scipy.linalg.expm` takes a batch one by one,
    which costs more than all the rest of a model.

    Parameters
    ----------
    matrices : ndarray, shape (..., d, d)
        Finite.

    Returns
    -------
    ndarray, shape (..., d, d)
    """
    norm = float(np.maximum.reduce(np.add.reduce(np.abs(matrices), axis=-2), axis=None, initial=0))
    squarings = max(0, math.ceil(math.log2(norm / LARGEST_NORM))) if norm > 0.0 else 0
    size = matrices.shape[-1]
    powers = np.empty((SERIES_BLOCKS, *matrices.shape))
    powers[0] = identity = _make_identity(size)
    scaled = np.multiply(matrices, 0.5**squarings, out=powers[1])
    for n in range(2, SERIES_BLOCKS):
        np.matmul(powers[n - 1], scaled, out=powers[n])
    blocks = (_COEFFICIENTS @ powers.reshape(SERIES_BLOCKS, -1)).reshape(powers.shape)
    top = powers[-1] @ scaled
    result: FloatArray = blocks[-1]
    for block in blocks[-2::-1]:
        result = result @ top
        result += block
    # e^A - 1 is squared, not e^A, which keeps the digits of small matrices beside large ones.
    twice = 2.0 * identity
    for _ in range(squarings):
        result = result @ (result + twice)
    result += identity
    return result


@lru_cache(maxsize=16)
def _make_identity(size: int) -> FloatArray:
    return make_read_only(np.eye(size))


def propagate(power: FloatArray, initial: FloatArray, count: int) -> FloatArray:
    """Compute P^n y for n = 0 ... count - 1 by doubling.

    Parameters
    ----------
    power : ndarray, shape (..., d, d)
        P, which takes the state over one step.
    initial : ndarray, shape (..., d)
        y.
    count : int
        Number of columns.

    Returns
    -------
    ndarray, shape (..., d, count)
    """
    result = np.empty((*initial.shape, count))
    result[..., 0] = initial
    done = 1
    while done < count:
        more = min(done, count - done)
        np.matmul(power, result[..., :more], out=result[..., done : done + more])
        done += more
        if done < count:
            power = power @ power
    return result


@lru_cache(maxsize=64)
def find_blocks(count: int) -> tuple[int, int]:
    """Return in how many blocks `propagate_output` takes `count` points, and of how many each."""
    block = 1 << max(count - 1, 0).bit_length() // 2
    return -(-count // block), block


def find_room(count: int) -> int:
    """Return on how many points it works: whole blocks."""
    return math.prod(find_blocks(count))


def find_way_to_end(duration: float, step: float, count: int) -> tuple[int, float]:
    """Return from which block a time after the first point is reached, and how far from there.

    Parameters
    ----------
    duration : float
        That time.
    step : float
        From point to point.
    count : int
        Number of points.
    """
    blocks, block = find_blocks(count)
    last = int(min(duration / (block * step), blocks - 1))
    return last, duration - last * block * step


def propagate_output(
    power: FloatArray,
    initial: FloatArray,
    readout: FloatArray,
    count: int,
    out: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Compute C P^n y for n = 0 ... count - 1.

    Parameters
    ----------
    power : ndarray, shape (..., d, d)
        P, which takes the state over one step.
    initial : ndarray, shape (..., d)
        y.
    readout : ndarray, shape (..., r, d)
        C, what is read off a state.
    count : int
        Number of points, one or more.
    out : ndarray, shape (..., r, m), optional
        Where to put them: m is `find_room` of `count` or more, and of so many points those
        beyond `count` mean nothing.

    Returns
    -------
    values : ndarray, shape (..., r, count)
    states : ndarray, shape (..., d, blocks)
        P^n y at the first point of each block.
    """
    blocks, block = find_blocks(count)
    outputs, size = readout.shape[-2:]
    if out is None:
        out = np.empty((*readout.shape[:-1], blocks * block))
    # The readouts of all points of a block are multiplied as one list of rows.
    rows = np.empty((*readout.shape[:-2], block * outputs, size))
    rows[..., :outputs, :] = readout
    done = outputs
    while done < block * outputs:
        np.matmul(rows[..., :done, :], power, out=rows[..., done : 2 * done, :])
        power = power @ power
        done *= 2
    states = propagate(power, initial, blocks)
    by_output = rows.reshape(*readout.shape[:-2], block, outputs, size).swapaxes(-2, -3)
    np.matmul(
        states.swapaxes(-1, -2)[..., np.newaxis, :, :],
        by_output.swapaxes(-1, -2),
        out=out[..., : blocks * block].reshape(*readout.shape[:-1], -1, block),
    )
    return out[..., :count], states
