"""Derivatives of damped oscillators that are left alone with what they have, for several at once.

In a scaled time, x'' + D x' + K x = 0. Let s be the answer to a unit of speed, and g = s * s the
answer to that: g'' + D g' + K g = s. The derivatives of x in K and D obey the same equation driven
by -x and -x', so that all there is, for every start, is a sum of s, s', g and g'; these four are
followed, and no state besides.
"""

import numpy as np

from impact_rig.core.model.propagation import exponentiate, propagate_output
from impact_rig.core.signals.record import FloatArray

STATES = 4
"""s, s', g, g'; at the start 0, 1, 0, 0."""
AT_START = 1
"""Column of a readout that is its value at the start."""


def read_motion(stiffness: FloatArray, damping: FloatArray, pairs: FloatArray) -> FloatArray:
    """Write accelerations as sums of s, s', g and g'.

    Parameters
    ----------
    stiffness, damping : ndarray, shape (bodies,)
        K and D.
    pairs : ndarray, shape (2, rows, bodies)
        Positions and speeds at the start, each of a motion of its own.

    Returns
    -------
    ndarray, shape (bodies, rows, 4)
    """
    position, speed = pairs
    readout = np.zeros((stiffness.size, position.shape[0], STATES))
    readout[..., 0] = (-stiffness * speed).T
    readout[..., 1] = (-stiffness * position - damping * speed).T
    return readout


def read_drive(stiffness: FloatArray, damping: FloatArray, pair: FloatArray) -> FloatArray:
    """Write as such sums what a motion adds to its derivatives in K and in D, and its slope.

    Parameters
    ----------
    stiffness, damping : ndarray, shape (bodies,)
        K and D.
    pair : ndarray, shape (2, bodies)
        Position and speed of the motion at the start.

    Returns
    -------
    ndarray, shape (3, bodies, 4)
        Of the accelerations' derivatives in K and in D, and of the acceleration's in time.
    """
    position, speed = pair
    acceleration = -stiffness * position - damping * speed
    jerk = -stiffness * speed - damping * acceleration
    rows = np.zeros((3, stiffness.size, STATES))
    by_stiffness, by_damping, slope = rows
    by_stiffness[:, 0] = by_damping[:, 1] = -speed
    by_stiffness[:, 1] = -position
    by_stiffness[:, 2] = stiffness * speed
    by_stiffness[:, 3] = by_damping[:, 0] = -acceleration
    by_damping[:, 2] = stiffness * acceleration
    by_damping[:, 3] = -jerk
    slope[:, 0] = -stiffness * acceleration
    slope[:, 1] = jerk
    return rows


def propagate_free(
    stiffness: FloatArray,
    damping: FloatArray,
    readout: FloatArray,
    late: float,
    step: float,
    count: int,
) -> FloatArray:
    """Evaluate such sums on a uniform grid.

    Parameters
    ----------
    stiffness, damping : ndarray, shape (bodies,)
        K and D.
    readout : ndarray, shape (bodies, rows, 4)
        Of each point.
    late, step : float
        Time of the first point, and from point to point.
    count : int
        Number of points.

    Returns
    -------
    ndarray, shape (bodies, rows, count)
    """
    matrix = np.zeros((stiffness.size, STATES, STATES))
    matrix[:, 0, 1] = matrix[:, 2, 3] = matrix[:, 3, 0] = 1.0
    matrix[:, 1, 0] = matrix[:, 3, 2] = -stiffness
    matrix[:, 1, 1] = matrix[:, 3, 3] = -damping
    times = np.array([late, step])
    shift, power = exponentiate(times[:, np.newaxis, np.newaxis, np.newaxis] * matrix)
    return propagate_output(power, shift[..., AT_START], readout, count)
