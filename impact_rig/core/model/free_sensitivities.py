"""Derivatives of damped oscillators that are left alone with what they have, for several at once.

In a scaled time, x'' + D x' + K x = 0. Let s be the answer to a unit of speed, and g = s * s the
answer to that: g'' + D g' + K g = s. The derivatives of x in K and D obey the same equation driven
by -x and -x', so that all there is, for every start, is a sum of s, s', g and g'; these four are
followed, and no state besides.
"""

import numpy as np

from impact_rig.core.model.propagation import Moments, simulate_linear_systems
from impact_rig.core.signals.record import FloatArray

STATES = 4
"""s, s', g, g'; at the start 0, 1, 0, 0."""
AT_START = 1
"""Column of a readout that is its value at the start."""


Row = tuple[float, float, float, float]
"""How much of s, s', g and g'."""


def read_motion(stiffness: float, damping: float, position: float, speed: float) -> Row:
    """Write an acceleration as such a sum, from position and speed at the start."""
    return (-stiffness * speed, -stiffness * position - damping * speed, 0.0, 0.0)


def read_drive(
    stiffness: float, damping: float, position: float, speed: float
) -> tuple[Row, Row, Row]:
    """Write as such sums what a motion adds to its derivatives.

    Parameters
    ----------
    stiffness, damping : float
        K and D.
    position, speed : float
        Of the motion at the start.

    Returns
    -------
    by_stiffness, by_damping, slope : tuple of float
        Of the acceleration's derivatives in K and in D, and in time, all of it.
    """
    acceleration = -stiffness * position - damping * speed
    jerk = -stiffness * speed - damping * acceleration
    return (
        (-speed, -position, stiffness * speed, -acceleration),
        (-acceleration, -speed, stiffness * acceleration, -jerk),
        (-stiffness * acceleration, jerk, 0.0, 0.0),
    )


def propagate_free(
    stiffness: FloatArray,
    damping: FloatArray,
    readout: FloatArray,
    late: float,
    step: float,
    count: int,
    out: FloatArray,
) -> None:
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
    out : ndarray, shape (bodies, rows, m)
        Filled with them, and with room for `find_room` of `count` points.
    """
    if count < 1:
        return
    matrix = np.zeros((stiffness.size, STATES, STATES))
    matrix[:, 0, 1] = matrix[:, 2, 3] = matrix[:, 3, 0] = 1.0
    matrix[:, 1, 0] = matrix[:, 3, 2] = -stiffness
    matrix[:, 1, 1] = matrix[:, 3, 3] = -damping
    initial = np.zeros((stiffness.size, STATES))
    initial[:, AT_START] = 1.0
    moments = [Moments(late / step, late / step)] * stiffness.size
    simulate_linear_systems(step * matrix, initial, readout, moments, count, out)
