"""Derivatives of the model as printed: two bodies coupled in contact, free afterwards.

With T = tau_p / (2 pi), the traces are (L / T^2) times functions of kappa_i = k_i T^2 / m_i,
delta_i = c_i T / m_i and the scaled time t / T alone, so that the derivative in tau_p follows from
the others. While the bodies touch, stiffness and damping enter by the same pattern
and everything starts at rest, so that the derivative in delta_i is the time derivative of the one
in kappa_i. In the free phase each body is followed by itself, with the derivatives it brings
along.
"""

from dataclasses import dataclass

import numpy as np

from impact_rig.core.model.contact import FULL_TURN
from impact_rig.core.model.free_sensitivities import (
    AT_START,
    STATES,
    propagate_free,
    read_drive,
    read_motion,
)
from impact_rig.core.model.impact import ImpactModel
from impact_rig.core.model.propagation import Moments, find_room, simulate_linear_systems
from impact_rig.core.model.time_grid import find_contact
from impact_rig.core.signals.record import FloatArray

SPEED, FORCE, KAPPA_1, DELTA_1, KAPPA_2, DELTA_2, JERK = range(7)
"""Rows: acceleration per unit impact speed and per unit force, derivatives of the acceleration,
and its derivative in time."""
ROWS = 7
TAU, T0, K2, C2, F0, K1, C1, TRACE = range(8)
"""What is computed: the derivatives in these parameters, and the trace itself."""
OUTPUTS = 8
CONTACT_BLOCKS = 4
"""In contact the responses to speed and force and the derivatives in kappa_1 and kappa_2 are
followed, each by two positions and two velocities."""
CONTACT_STATES = 4 * CONTACT_BLOCKS


@dataclass(frozen=True)
class _Scaled:
    """The model in scaled time: lengths in units of `length`, time in units of `duration`.

    `kappa` and `delta` have the shape (2,).
    """

    duration: float
    length: float
    speed: float
    force: float
    kappa: FloatArray
    delta: FloatArray
    masses: tuple[float, float]

    @staticmethod
    def make(model: ImpactModel) -> "_Scaled":
        """Scale a model."""
        duration, (first, second) = model.contact_time / FULL_TURN, (model.hammer, model.specimen)
        by_speed = model.impact_speed * duration
        by_force = model.peak_force * duration**2 / second.mass
        length = max(abs(by_speed), abs(by_force)) or 1.0
        return _Scaled(
            duration=duration,
            length=length,
            speed=by_speed / length,
            force=by_force / length,
            kappa=np.array([body.stiffness * duration**2 / body.mass for body in (first, second)]),
            delta=np.array(
                [body.damping_coefficient * duration / body.mass for body in (first, second)]
            ),
            masses=(first.mass, second.mass),
        )

    def find_mixing(self) -> FloatArray:
        """Return what the rows are in each output, shape (8, 7).

        In that of tau_p, time * JERK is left out.
        """
        duration, length, (first_mass, second_mass) = self.duration, self.length, self.masses
        mixing = np.zeros((OUTPUTS, ROWS))
        mixing[TAU, SPEED] = -self.speed
        mixing[TAU, KAPPA_1 : KAPPA_2 + 1 : 2] = 2.0 * self.kappa
        mixing[TAU, DELTA_1 : DELTA_2 + 1 : 2] = self.delta
        mixing[TAU] /= FULL_TURN
        mixing[T0, JERK] = -1.0
        mixing[: T0 + 1] *= length / duration**3
        mixing[K2, KAPPA_2] = length / second_mass
        mixing[C2, DELTA_2] = length / second_mass / duration
        mixing[F0, FORCE] = 1.0 / second_mass
        mixing[K1, KAPPA_1] = length / first_mass
        mixing[C1, DELTA_1] = length / first_mass / duration
        mixing[TRACE, : FORCE + 1] = self.speed, self.force
        mixing[TRACE] *= length / duration**2
        return mixing


def compute_printed_sensitivities(
    model: ImpactModel, sampling_rate: float, count: int, start: float
) -> tuple[FloatArray, FloatArray]:
    """Compute traces, shape (2, n), and derivatives, shape (2, 7, n), of the printed model.

    The parameters are tau_p, t0, k2, c2, F0, k1 and c1; see `compute_sensitivities`.
    """
    scaled, tau = _Scaled.make(model), model.contact_time
    first, free, begin, late = find_contact(start, tau, sampling_rate, count)
    step = 1.0 / (sampling_rate * scaled.duration)
    matrix, initial = _make_contact_system(scaled)
    contact = max(free - first, 1)
    room = max(first + find_room(contact), free + find_room(count - free))
    result = np.empty((2, OUTPUTS, room))
    result[:, :, :first] = 0.0
    mixing = scaled.find_mixing()
    in_contact = mixing @ _read_contact(scaled, matrix)
    _, ends = simulate_linear_systems(
        step * matrix[np.newaxis],
        initial[np.newaxis],
        in_contact.reshape(1, 2 * OUTPUTS, -1),
        [Moments(begin * sampling_rate, tau * sampling_rate)],
        contact,
        result.reshape(1, 2 * OUTPUTS, -1)[:, :, first:],
    )
    end = ends[0]
    afterwards = mixing @ _read_free(scaled, end, matrix @ end)
    propagate_free(
        scaled.kappa,
        scaled.delta,
        afterwards,
        late / scaled.duration,
        step,
        count - free,
        result[:, :, free:],
    )
    result = result[:, :, :count]
    # What is scaled by tau_p moves all the farther, the later it is.
    time = (start + np.arange(count) / sampling_rate) / tau
    result[:, TAU] += time * result[:, T0]
    _place_step(result, start * sampling_rate, first, 0.0, in_contact @ initial, sampling_rate)
    jump = afterwards[..., AT_START] - in_contact @ end
    _place_step(result, (start - tau) * sampling_rate, free, 1.0, jump, sampling_rate)
    return result[:, TRACE], result[:, :TRACE]


def _place_step(
    result: FloatArray,
    offset: float,
    point: int,
    moves: float,
    jump: FloatArray,
    sampling_rate: float,
) -> None:
    """Let the two points beside a step carry its place between them.

    Points count as the means of the trace over a triangle of two steps: the step's area and
    centre are then kept wherever between the points it stands.

    Parameters
    ----------
    result : ndarray, shape (2, 8, n)
        Changed in place.
    offset : float
        From the step to the first point of the record [points].
    point : int
        The first one after the step.
    moves : float
        How far the step moves with tau_p [-].
    jump : ndarray, shape (2, 8)
        Of all outputs; that of t0 counts for nothing.
    sampling_rate : float
        [Hz]
    """
    for neighbour, sign in ((point - 1, 0.5), (point, -0.5)):
        reach = 1.0 - abs(offset + neighbour)
        if reach <= 0.0 or not 0 <= neighbour < result.shape[2]:
            continue
        change = sign * reach**2 * jump
        change[:, T0] = -sampling_rate * reach * jump[:, TRACE]
        change[:, TAU] += moves * change[:, T0]
        result[:, :, neighbour] += change


K_11, K_12, K_22, D_11, D_12, D_22, V_1, V_2, F_1, F_2, ONE = range(11)
"""Numbers that the contact's matrix is made of: kappa_1, the same over the other mass, and
kappa_2; the same for delta; speed and force, and both times m1 / m2; 1."""
NUMBERS = 11


def _make_contact_entries() -> FloatArray:
    """Return what each number has in the contact's matrix, shape (11, 19 * 19)."""
    size = CONTACT_STATES + 3
    entries = np.zeros((NUMBERS, size, size))
    for block in range(0, CONTACT_STATES, 4):
        first, second = block + 2, block + 3
        entries[ONE, block, first] = entries[ONE, block + 1, second] = 1.0
        for (own, other, single), at in (((K_11, K_12, K_22), block), ((D_11, D_12, D_22), first)):
            entries[own, first, at : at + 2] = -1.0, 1.0
            entries[other, second, at : at + 2] = 1.0, -1.0
            entries[single, second, at + 1] = -1.0
    # The derivative in kappa_1 is driven by what its spring does, that in kappa_2 as well.
    for response, on_first, on_second in ((0, V_1, V_2), (4, F_1, F_2)):
        entries[on_first, 10, response : response + 2] = -1.0, 1.0
        entries[on_second, 11, response : response + 2] = 1.0, -1.0
        entries[on_first, 15, response + 1] = -1.0
    # Equation (1): the force acts on body 2, with a minus.
    entries[ONE, 7, -3:-1] = -0.5, 0.5
    entries[ONE, -2, -1], entries[ONE, -1, -2] = -1.0, 1.0
    return entries.reshape(NUMBERS, -1)


CONTACT_ENTRIES = _make_contact_entries()


def _make_contact_system(scaled: _Scaled) -> tuple[FloatArray, FloatArray]:
    """Return matrix and initial state of the contact: four blocks, then 1, cos and sin."""
    ratio = scaled.masses[0] / scaled.masses[1]
    (k1, k2), (d1, d2) = scaled.kappa.tolist(), scaled.delta.tolist()
    speed, force, size = scaled.speed, scaled.force, CONTACT_STATES + 3
    numbers = np.array(
        [
            *(k1, ratio * k1, k2, d1, ratio * d1, d2),
            *(speed, ratio * speed, force, ratio * force, 1.0),
        ]
    )
    initial = np.zeros(size)
    initial[2] = initial[-3] = initial[-2] = 1.0
    return (numbers @ CONTACT_ENTRIES).reshape(size, size), initial


def _read_contact(scaled: _Scaled, matrix: FloatArray) -> FloatArray:
    """Return the rows as sums of the states in contact, shape (2, 7, 19)."""
    accelerations = matrix[:CONTACT_STATES].reshape(CONTACT_BLOCKS, 4, -1)[:, 2:]
    # The system is linear without input, so that its states' rates obey the same equations.
    slopes = accelerations @ matrix
    rows = np.empty((ROWS, 2, matrix.shape[0]))
    rows[SPEED], rows[FORCE] = accelerations[:2]
    rows[KAPPA_1], rows[KAPPA_2] = accelerations[2:]
    rows[DELTA_1], rows[DELTA_2] = slopes[2:]
    rows[JERK] = scaled.speed * slopes[0] + scaled.force * slopes[1]
    return rows.swapaxes(0, 1)


def _read_free(scaled: _Scaled, end: FloatArray, rates: FloatArray) -> FloatArray:
    """Return the rows after the contact as sums of s, s', g and g', shape (2, 7, 4)."""
    states, slopes = end.tolist(), rates.tolist()
    rows = np.zeros((2, ROWS, STATES))
    for body, (kappa, delta) in enumerate(
        zip(scaled.kappa.tolist(), scaled.delta.tolist(), strict=True)
    ):
        # The derivatives in delta are slopes of those in kappa.
        pairs = [
            (values[block + body], values[block + 2 + body])
            for values, block in (
                *((states, 0), (states, 4), (states, 8)),
                *((slopes, 8), (states, 12), (slopes, 12)),
            )
        ]
        rows[body, :JERK] = [read_motion(kappa, delta, *pair) for pair in pairs]
        moving = (
            scaled.speed * by_speed + scaled.force * by_force
            for by_speed, by_force in zip(pairs[SPEED], pairs[FORCE], strict=True)
        )
        by_kappa, by_delta, slope = read_drive(kappa, delta, *moving)
        # Its own stiffness acts on the position, its own damper on the velocity.
        own = (KAPPA_1, KAPPA_2)[body]
        rows[body, own : own + 2] += (by_kappa, by_delta)
        rows[body, JERK] = slope
    return rows
