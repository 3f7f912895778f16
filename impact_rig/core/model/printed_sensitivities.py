"""Derivatives of the model as printed: two bodies coupled in contact, free afterwards.

In the scaled time sigma = t / tau_p the traces are (L / tau_p^2) times functions of kappa_i =
k_i tau_p^2 / m_i, delta_i = c_i tau_p / m_i and sigma alone, so that the derivative in tau_p
follows from the others. While the bodies touch, stiffness and damping enter by the same pattern
and everything starts at rest, so that the derivative in delta_i is the time derivative of the one
in kappa_i. In the free phase each body is followed by itself, with the derivatives it brings
along.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from impact_rig.core.model.impact import ImpactModel
from impact_rig.core.model.propagation import propagate
from impact_rig.core.signals.record import FloatArray

SPEED, FORCE, KAPPA_1, DELTA_1, KAPPA_2, DELTA_2, JERK = range(7)
"""Rows: acceleration per unit impact speed and per unit force, derivatives of the acceleration,
and its derivative in time."""
ROWS = 7
CONTACT_BLOCKS = 4
"""In contact the responses to speed and force and the derivatives in kappa_1 and kappa_2 are
followed, each by two positions and two velocities."""
CONTACT_STATES = 4 * CONTACT_BLOCKS


@dataclass(frozen=True)
class _Scaled:
    """The model in scaled time: lengths in units of `length`, time in tau_p."""

    length: float
    speed: float
    force: float
    kappa: tuple[float, float]
    delta: tuple[float, float]
    masses: tuple[float, float]

    @staticmethod
    def make(model: ImpactModel) -> "_Scaled":
        """Scale a model."""
        tau, bodies = model.contact_time, (model.hammer, model.specimen)
        by_speed = model.impact_speed * tau
        by_force = model.peak_force * tau**2 / model.specimen.mass
        length = max(abs(by_speed), abs(by_force)) or 1.0
        return _Scaled(
            length=length,
            speed=by_speed / length,
            force=by_force / length,
            kappa=(
                bodies[0].stiffness * tau**2 / bodies[0].mass,
                bodies[1].stiffness * tau**2 / bodies[1].mass,
            ),
            delta=(
                bodies[0].damping_coefficient * tau / bodies[0].mass,
                bodies[1].damping_coefficient * tau / bodies[1].mass,
            ),
            masses=(bodies[0].mass, bodies[1].mass),
        )

    @property
    def patterns(self) -> FloatArray:
        """How kappa_1 and kappa_2 enter the stiffness in contact, shape (2, 2, 2)."""
        ratio = self.masses[0] / self.masses[1]
        return np.array([[[1.0, -1.0], [-ratio, ratio]], [[0.0, 0.0], [0.0, 1.0]]])

    def add_up(self, rows: FloatArray) -> FloatArray:
        """Return what speed and force do together, from rows that begin with the two."""
        return np.asarray(self.speed * rows[SPEED] + self.force * rows[FORCE])


def compute_printed_sensitivities(
    model: ImpactModel, sampling_rate: float, count: int, start: float
) -> tuple[FloatArray, FloatArray]:
    """Compute traces, shape (2, n), and derivatives, shape (2, 7, n), of the printed model.

    The parameters are tau_p, t0, k2, c2, F0, k1 and c1; see `compute_sensitivities`.
    """
    scaled, tau = _Scaled.make(model), model.contact_time
    time = (start + np.arange(count) / sampling_rate) / tau
    step = 1.0 / (sampling_rate * tau)
    first = int(np.searchsorted(time, 0.0, side="left"))
    free = int(np.searchsorted(time, 1.0, side="right"))

    matrix, initial = _make_contact_system(scaled)
    rows = np.zeros((ROWS, 2, count))
    if free > first:
        states = propagate(expm(matrix * step), expm(matrix * time[first]) @ initial, free - first)
        rows[:, :, first:free] = _read_contact(scaled, matrix, states)
    end = (expm(matrix) @ initial)[:, np.newaxis]
    at_end = _read_contact(scaled, matrix, end)[:, :, 0]
    after_end = np.empty((ROWS, 2))
    for body in (0, 1):
        free_matrix, free_initial = _make_free_system(scaled, body, matrix, end)
        after_end[:, body] = _read_free(scaled, body, free_initial[:, np.newaxis])[:, 0]
        if count > free:
            arrived = expm(free_matrix * (time[free] - 1.0)) @ free_initial
            states = propagate(expm(free_matrix * step), arrived, count - free)
            rows[:, body, free:] = _read_free(scaled, body, states)
    at_start = _read_contact(scaled, matrix, initial[:, np.newaxis])[:, :, 0]

    impulses = np.zeros((2, 2, count))
    for index, (point, place, jump) in enumerate(
        ((first, 0.0, at_start), (free, 1.0, after_end - at_end))
    ):
        # Points count as the means of the trace over a triangle of two steps: the step's area
        # and centre are then kept wherever between the points it stands.
        for neighbour in (point - 1, point):
            if 0 <= neighbour < count:
                distance = (time[neighbour] - place) / step
                reach = max(1.0 - abs(distance), 0.0)
                share = 0.5 * reach**2 * (1.0 if neighbour < point else -1.0)
                rows[:JERK, :, neighbour] += share * jump[:JERK]
                impulses[index, :, neighbour] -= reach / step * scaled.add_up(jump)
    return _assemble(model, scaled, rows, impulses, time)


def _assemble(
    model: ImpactModel,
    scaled: _Scaled,
    rows: FloatArray,
    impulses: FloatArray,
    time: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    tau, length = model.contact_time, scaled.length
    first_mass, second_mass = scaled.masses
    by_tau = (
        2.0 * scaled.kappa[0] * rows[KAPPA_1]
        + scaled.delta[0] * rows[DELTA_1]
        + 2.0 * scaled.kappa[1] * rows[KAPPA_2]
        + scaled.delta[1] * rows[DELTA_2]
        - scaled.speed * rows[SPEED]
        - time * rows[JERK]
        + impulses[1]
    )
    derivatives = np.stack(
        [
            length / tau**3 * by_tau,
            length / tau**3 * (impulses.sum(axis=0) - rows[JERK]),
            length / second_mass * rows[KAPPA_2],
            length / second_mass / tau * rows[DELTA_2],
            rows[FORCE] / second_mass,
            length / first_mass * rows[KAPPA_1],
            length / first_mass / tau * rows[DELTA_1],
        ],
        axis=1,
    )
    return length / tau**2 * scaled.add_up(rows), derivatives


def _make_contact_system(scaled: _Scaled) -> tuple[FloatArray, FloatArray]:
    """Return matrix and initial state of the contact: four blocks, then 1, cos and sin."""
    size = CONTACT_STATES
    matrix = np.zeros((size + 3, size + 3))
    patterns = scaled.patterns
    stiffness = np.tensordot(scaled.kappa, patterns, axes=1)
    damping = np.tensordot(scaled.delta, patterns, axes=1)
    for block in range(CONTACT_BLOCKS):
        position = slice(4 * block, 4 * block + 2)
        velocity = slice(4 * block + 2, 4 * block + 4)
        matrix[position, velocity] = np.eye(2)
        matrix[velocity, position] = -stiffness
        matrix[velocity, velocity] = -damping
    for block, pattern in ((2, patterns[0]), (3, patterns[1])):
        velocity = slice(4 * block + 2, 4 * block + 4)
        matrix[velocity, 0:2] = -scaled.speed * pattern
        matrix[velocity, 4:6] = -scaled.force * pattern
    # Equation (1): the force acts on body 2, with a minus.
    matrix[7, size], matrix[7, size + 1] = -0.5, 0.5
    matrix[size + 1, size + 2], matrix[size + 2, size + 1] = -2.0 * np.pi, 2.0 * np.pi
    initial = np.zeros(size + 3)
    initial[2] = initial[size] = initial[size + 1] = 1.0
    return matrix, initial


def _read_contact(scaled: _Scaled, matrix: FloatArray, states: FloatArray) -> FloatArray:
    """Return the rows, shape (7, 2, n), from states in contact."""
    rates = matrix @ states
    # The system is linear without input, so that its states' rates obey the same equations.
    second_rates = matrix @ rates
    return np.stack(
        [
            rates[2:4],
            rates[6:8],
            rates[10:12],
            second_rates[10:12],
            rates[14:16],
            second_rates[14:16],
            scaled.speed * second_rates[2:4] + scaled.force * second_rates[6:8],
        ]
    )


def _make_free_system(
    scaled: _Scaled, body: int, matrix: FloatArray, end: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return matrix and initial state of one body left alone: six pairs, in the rows' order."""
    state, rates = end[:, 0], (matrix @ end)[:, 0]
    free = np.zeros((12, 12))
    for pair in range(6):
        place, rate = 2 * pair, 2 * pair + 1
        free[place, rate] = 1.0
        free[rate, place] = -scaled.kappa[body]
        free[rate, rate] = -scaled.delta[body]
    # Its own stiffness acts on the position, its own damper on the velocity.
    own_kappa, own_delta = ((KAPPA_1, DELTA_1), (KAPPA_2, DELTA_2))[body]
    for cause, amount in ((SPEED, scaled.speed), (FORCE, scaled.force)):
        free[2 * own_kappa + 1, 2 * cause] = -amount
        free[2 * own_delta + 1, 2 * cause + 1] = -amount
    initial = np.concatenate(
        [
            source[[4 * block + body, 4 * block + 2 + body]]
            for block, source in (
                (0, state),
                (1, state),
                (2, state),
                (2, rates),
                (3, state),
                (3, rates),
            )
        ]
    )
    return free, initial


def _read_free(scaled: _Scaled, body: int, states: FloatArray) -> FloatArray:
    """Return the rows, shape (7, n), from one body's states after the contact."""
    free_rates = -scaled.kappa[body] * states[0::2] - scaled.delta[body] * states[1::2]
    moving = scaled.speed * states[0:2] + scaled.force * states[2:4]
    own_kappa, own_delta = ((KAPPA_1, DELTA_1), (KAPPA_2, DELTA_2))[body]
    free_rates[own_kappa] -= moving[0]
    free_rates[own_delta] -= moving[1]
    jerk = -scaled.kappa[body] * moving[1] - scaled.delta[body] * scaled.add_up(free_rates)
    return np.concatenate([free_rates, jerk[np.newaxis]])
