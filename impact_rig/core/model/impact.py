"""The two-body model of the paper in closed form.

While the bodies touch, the model is a linear system driven by a constant and a cosine, since
F(t) = F0 sin^2(pi t / tau_p). Both are solutions of linear equations themselves, so that with
them in the state y nothing but y' = A y is left, and y(t) = e^(At) y(0). Afterwards each body is
a damped oscillator, again e^(At). On a uniform grid e^(At) y is built by doubling, Y[n:2n] =
e^(An dt) Y[0:n]: exact for every damping and every pulse, critical damping and resonance
included, where eigenvectors or a particular solution would fail.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from scipy.linalg import expm

from impact_rig.core.checks import check_between, check_not_negative, check_positive
from impact_rig.core.errors import ParameterError
from impact_rig.core.model.stiffness import estimate_equivalent_mass
from impact_rig.core.signals.record import FloatArray


class ModelVariant(Enum):
    """How the two bodies are driven.

    `PRINTED` is equations (1) and (2) as they stand. `DRIVEN` is what Figs. 5 and 6 describe:
    the hammer's trace is the versed-sine (4) itself, and the sample is driven by +F(t) alone.
    """

    DRIVEN = "driven"
    PRINTED = "printed"


@dataclass(frozen=True)
class Body:
    """One body: a mass on a spring and a damper.

    Attributes
    ----------
    mass : float
        [kg]
    stiffness : float
        [N/m]
    damping_coefficient : float
        [N s/m]
    """

    mass: float
    stiffness: float
    damping_coefficient: float

    def __post_init__(self) -> None:
        """Refuse impossible numbers."""
        check_positive("mass of a body", self.mass, "kg")
        check_positive("stiffness of a body", self.stiffness, "N/m")
        check_not_negative("damping coefficient of a body", self.damping_coefficient, "N s/m")


@dataclass(frozen=True)
class ImpactModel:
    """Parameters of one impact.

    Attributes
    ----------
    hammer, specimen : Body
        m1, k1, c1 and m2, k2, c2.
    contact_time : float
        tau_p [s].
    impact_speed : float
        v1 [m/s].
    peak_force : float
        F0 [N], signed; equation (1) has -F(t) on body 2.
    """

    hammer: Body
    specimen: Body
    contact_time: float
    impact_speed: float
    peak_force: float

    def __post_init__(self) -> None:
        """Refuse impossible numbers."""
        check_positive("contact time", self.contact_time, "s")
        for name, value in (("speed", self.impact_speed), ("peak force", self.peak_force)):
            if not np.isfinite(value):
                raise ParameterError(f"impact {name} is {value!r}: it must be a finite number")


def compute_peak_force(
    hammer_mass: float,
    moving_mass: float,
    impact_speed: float,
    contact_time: float,
    restitution: float = 1.0,
) -> float:
    """Compute F0 [N] from the momentum balance F0 = 2 (1 + e) m_eq v1 / tau_p.

    The impulse of a versed-sine is F0 tau_p / 2; `restitution` is e [-], 1 for an elastic
    impact; masses in kg, speed in m/s, time in s. Raises `ParameterError` for impossible ones.
    """
    check_between("restitution", restitution, 0.0, 1.0)
    check_positive("contact time", contact_time, "s")
    equivalent = estimate_equivalent_mass(hammer_mass, moving_mass)
    return 2.0 * (1.0 + restitution) * equivalent * impact_speed / contact_time


def simulate_impact(
    model: ImpactModel,
    sampling_rate: float,
    count: int,
    *,
    start: float = 0.0,
    variant: ModelVariant = ModelVariant.PRINTED,
) -> tuple[FloatArray, FloatArray]:
    """Simulate the accelerations of both bodies on a uniform time grid.

    Parameters
    ----------
    model : ImpactModel
        Parameters.
    sampling_rate : float
        [Hz]
    count : int
        Number of points.
    start : float
        Time of the first point, counted from the start of the contact [s]; before the contact
        both accelerations are zero.
    variant : ModelVariant
        How the bodies are driven.

    Returns
    -------
    hammer, specimen : ndarray, shape (count,)
        x1'' and x2'' [m/s^2]. With v1 and c1 the printed model steps at t = 0 and at tau_p:
        that is the model, and nothing here smooths it.
    """
    check_positive("sampling rate", sampling_rate, "Hz")
    time = start + np.arange(count) / sampling_rate
    first_contact = int(np.searchsorted(time, 0.0, side="left"))
    first_free = int(np.searchsorted(time, model.contact_time, side="right"))
    contact = _ContactPhase(model, variant)
    hammer = np.zeros(count)
    specimen = np.zeros(count)
    if first_free > first_contact:
        inside = slice(first_contact, first_free)
        hammer[inside], specimen[inside] = contact.evaluate(time[inside], 1.0 / sampling_rate)
    if count > first_free:
        state = contact.find_state(model.contact_time)
        late = time[first_free:] - model.contact_time
        if variant is ModelVariant.PRINTED:
            hammer[first_free:] = _evaluate_free(model.hammer, state[[0, 2]], late, sampling_rate)
        specimen[first_free:] = _evaluate_free(model.specimen, state[[1, 3]], late, sampling_rate)
    return hammer, specimen


class _ContactPhase:
    """The contact, 0 <= t <= tau_p, as one linear system without input.

    Its state is z = (x1/d, x2/d, x1'/(d w), x2'/(d w), 1, cos wt, sin wt) with w = 2 pi / tau_p
    and a length d that makes all entries of about one size; z' = w N z.
    """

    def __init__(self, model: ImpactModel, variant: ModelVariant) -> None:
        first, second = model.hammer, model.specimen
        self._rate = 2.0 * np.pi / model.contact_time
        if variant is ModelVariant.PRINTED:
            k1, c1, direction, speed = (
                first.stiffness,
                first.damping_coefficient,
                (0.0, -1.0),
                model.impact_speed,
            )
        else:
            k1, c1, direction, speed = 0.0, 0.0, (-1.0, 1.0), 0.0
        k2, c2 = second.stiffness, second.damping_coefficient
        masses = np.array([first.mass, second.mass])
        drive = np.array(direction) * model.peak_force / 2.0 / masses
        length = float(max(np.abs(drive).max() / self._rate, abs(speed)) / self._rate)
        self._length = length or 1.0
        stiffness = np.array([[k1, -k1], [-k1, k1 + k2]]) / masses[:, np.newaxis]
        damping = np.array([[c1, -c1], [-c1, c1 + c2]]) / masses[:, np.newaxis]
        drive /= self._length * self._rate**2
        self._matrix = np.zeros((7, 7))
        self._matrix[0, 2] = self._matrix[1, 3] = 1.0
        self._matrix[2:4, 0:2] = -stiffness / self._rate**2
        self._matrix[2:4, 2:4] = -damping / self._rate
        self._matrix[2:4, 4] = drive
        self._matrix[2:4, 5] = -drive
        self._matrix[5, 6], self._matrix[6, 5] = -1.0, 1.0
        relative_speed = speed / (self._length * self._rate)
        self._initial = np.array([0.0, 0.0, relative_speed, 0.0, 1.0, 1.0, 0.0])

    def find_state(self, time: float) -> FloatArray:
        """Return (x1, x2, x1', x2') at `time` [s]."""
        scaled: FloatArray = expm(self._matrix * self._rate * time) @ self._initial
        state = self._length * scaled[:4]
        state[2:] *= self._rate
        return state

    def evaluate(self, time: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
        """Return both accelerations [m/s^2] on a uniform grid of `step` [s]."""
        initial = expm(self._matrix * self._rate * time[0]) @ self._initial
        states = propagate(self._matrix * self._rate * step, initial, time.size)
        hammer, specimen = self._length * self._rate**2 * (self._matrix[2:4] @ states)
        return hammer, specimen


def _evaluate_free(
    body: Body, state: FloatArray, time: FloatArray, sampling_rate: float
) -> FloatArray:
    """Return the acceleration [m/s^2] of a body left alone in `state` = (x, x')."""
    matrix = np.array(
        [[0.0, 1.0], [-body.stiffness / body.mass, -body.damping_coefficient / body.mass]]
    )
    states = propagate(matrix / sampling_rate, expm(matrix * time[0]) @ state, time.size)
    return np.asarray(matrix[1] @ states)


def propagate(matrix: FloatArray, initial: FloatArray, count: int) -> FloatArray:
    """Compute e^(n M) y for n = 0 ... count - 1; M, shape (d, d), is system matrix times step."""
    return propagate_power(expm(matrix), initial, count)


def propagate_power(power: FloatArray, initial: FloatArray, count: int) -> FloatArray:
    """Compute P^n y for n = 0 ... count - 1 by doubling.

    Parameters
    ----------
    power : ndarray, shape (d, d)
        P, which takes the state over one step.
    initial : ndarray, shape (d,)
        y.
    count : int
        Number of columns.

    Returns
    -------
    ndarray, shape (d, count)
    """
    result = np.empty((initial.size, count))
    result[:, 0] = initial
    done = 1
    while done < count:
        more = min(done, count - done)
        np.matmul(power, result[:, :more], out=result[:, done : done + more])
        done += more
        power = power @ power
    return result
