"""Derivatives of the driven model, whose sample is one oscillator.

In the scaled time phi = t / T with T = tau_p / (2 pi),

    X'' + D X' + K X = (1 - cos phi) / 2,   K = k2 T^2 / m2,   D = c2 T / m2,

with the sample's acceleration F0 / m2 X''. Its derivative Y = dX/dK obeys the same equation
driven by -X, and dX/dD = Y' since -X' is what drives it and everything starts at rest. So four
states and the three of the force give the trace and all its derivatives by one e^(At).
"""

import numpy as np

from impact_rig.core.model.contact import FULL_TURN
from impact_rig.core.model.free_sensitivities import propagate_free, read_drive, read_motion
from impact_rig.core.model.impact import ImpactModel
from impact_rig.core.model.propagation import Moments, find_room, simulate_linear_systems
from impact_rig.core.model.time_grid import find_contact
from impact_rig.core.signals.record import FloatArray

TAU, T0, STIFFNESS, DAMPING, FORCE = range(5)
"""The parameters tau_p, t0, k2, c2 and F0."""
PARAMETERS = 5
STATES = 7
"""X, X', Y, Y', and the force's constant, cosine and sine."""
AT_START = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0])


def compute_driven_sensitivities(
    model: ImpactModel, sampling_rate: float, count: int, start: float
) -> tuple[FloatArray, FloatArray]:
    """Compute traces, shape (2, n), and derivatives, shape (2, 5, n), of the driven model.

    See `compute_sensitivities`.
    """
    tau, force = model.contact_time, model.peak_force
    first, free, begin, late = find_contact(start, tau, sampling_rate, count)
    contact = max(free - first, 1)
    room = max(first + find_room(contact), free + find_room(count - free))
    derivatives = np.zeros((2, PARAMETERS, room))
    time = (start + np.arange(count) / sampling_rate) / tau
    phase = time[first:free]
    hammer = derivatives[0, :, first:free]
    hammer[T0] = force * np.pi / (model.hammer.mass * tau) * np.sin(FULL_TURN * phase)
    hammer[FORCE] = np.sin(np.pi * phase) ** 2 / -model.hammer.mass

    duration = tau / FULL_TURN
    stiffness = model.specimen.stiffness * duration**2 / model.specimen.mass
    damping = model.specimen.damping_coefficient * duration / model.specimen.mass
    mixing = _find_mixing(model, stiffness, damping)
    matrix = _make_contact_matrix(stiffness, damping)
    step = 1.0 / (sampling_rate * duration)
    _, ends = simulate_linear_systems(
        step * matrix[np.newaxis],
        AT_START[np.newaxis],
        (mixing @ _read_contact(matrix))[np.newaxis],
        [Moments(begin * sampling_rate, tau * sampling_rate)],
        contact,
        derivatives[1:, :, first:],
    )
    end = ends[0]
    propagate_free(
        np.array([stiffness]),
        np.array([damping]),
        (mixing @ _read_free(stiffness, damping, matrix, end))[np.newaxis],
        late / duration,
        step,
        count - free,
        derivatives[1:, :, free:],
    )
    derivatives = derivatives[:, :, :count]
    # What is scaled by tau_p moves all the farther, the later it is.
    derivatives[:, TAU] += time * derivatives[:, T0]
    return force * derivatives[:, FORCE], derivatives


def _find_mixing(model: ImpactModel, stiffness: float, damping: float) -> FloatArray:
    """Return what X'', dX''/dK, dX''/dD and X''' are in each parameter, shape (5, 4)."""
    tau, mass = model.contact_time, model.specimen.mass
    duration, amplitude = tau / FULL_TURN, model.peak_force / mass
    mixing = np.zeros((PARAMETERS, 4))
    mixing[TAU, 1:3] = 2.0 * stiffness * amplitude / tau, damping * amplitude / tau
    mixing[T0, 3] = -amplitude / duration
    mixing[STIFFNESS, 1] = amplitude * duration**2 / mass
    mixing[DAMPING, 2] = amplitude * duration / mass
    mixing[FORCE, 0] = 1.0 / mass
    return mixing


def _make_contact_matrix(stiffness: float, damping: float) -> FloatArray:
    matrix = np.zeros((STATES, STATES))
    matrix[0, 1] = matrix[2, 3] = 1.0
    matrix[1, 0] = matrix[3, 2] = -stiffness
    matrix[1, 1] = matrix[3, 3] = -damping
    matrix[3, 0] = -1.0
    matrix[1, 4], matrix[1, 5] = 0.5, -0.5
    matrix[5, 6], matrix[6, 5] = -1.0, 1.0
    return matrix


def _read_contact(matrix: FloatArray) -> FloatArray:
    """Return X'', dX''/dK, dX''/dD and X''' as sums of the states, shape (4, 7)."""
    # Without input the states' slopes obey the same equations.
    rates = matrix[[1, 3]] @ matrix
    return np.stack([matrix[1], matrix[3], rates[1], rates[0]])


def _read_free(
    stiffness: float, damping: float, matrix: FloatArray, end: FloatArray
) -> FloatArray:
    """Return the same after the contact as sums of s, s', g and g', shape (4, 4)."""
    position, speed, change, change_rate = end[:4].tolist()
    # The derivative in D is the slope of that in K.
    pairs = ((position, speed), (change, change_rate), (change_rate, float(matrix[3] @ end)))
    readout = np.zeros((4, 4))
    readout[:3] = [read_motion(stiffness, damping, *pair) for pair in pairs]
    readout[1:] += read_drive(stiffness, damping, position, speed)
    return readout
