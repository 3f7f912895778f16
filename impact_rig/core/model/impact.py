"""The two-body model of the paper in closed form.

While the bodies touch, the model is a linear system driven by a constant and a cosine, since
F(t) = F0 sin^2(pi t / tau_p). Both are solutions of linear equations themselves, so that with
them in the state y nothing but y' = A y is left, and y(t) = e^(At) y(0). Afterwards each body is
a damped oscillator, again e^(At). That is exact for every damping and every pulse, critical
damping and resonance included, where eigenvectors or a particular solution would fail. Nothing is
stepped through time, and many impacts are calculated at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.checks import check_between, check_not_negative, check_positive
from impact_rig.core.errors import ParameterError
from impact_rig.core.model.propagation import exponentiate, propagate_output
from impact_rig.core.model.stiffness import estimate_equivalent_mass
from impact_rig.core.signals.record import FloatArray

BATCH = 64
"""Impacts that are calculated at once [-], measured: what they need stays near the processor."""


FULL_TURN = 2.0 * np.pi
NEIGHBOURS = np.array([-1.0, 0.0, 1.0])


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
    hammer, specimen = simulate_impacts(
        [model], sampling_rate, count, start=start, variant=variant
    )[0]
    return hammer, specimen


def simulate_impacts(
    models: Sequence[ImpactModel],
    sampling_rate: float,
    count: int,
    *,
    start: float | FloatArray = 0.0,
    variant: ModelVariant = ModelVariant.PRINTED,
) -> FloatArray:
    """Simulate many impacts at once; parameters as `simulate_impact`, one start or one each.

    Returns
    -------
    ndarray, shape (models, 2, count)
        x1'' and x2'' of each [m/s^2].
    """
    check_positive("sampling rate", sampling_rate, "Hz")
    starts = np.broadcast_to(np.asarray(start, dtype=np.float64), (len(models),))
    result = np.zeros((len(models), 2, count))
    for first in range(0, len(models), BATCH):
        part = slice(first, first + BATCH)
        _simulate(models[part], sampling_rate, starts[part], variant, result[part])
    return result


def _simulate(
    models: Sequence[ImpactModel],
    sampling_rate: float,
    starts: FloatArray,
    variant: ModelVariant,
    out: FloatArray,
) -> None:
    """Fill `out`, shape (models, 2, count), which is zero."""
    count, bodies = out.shape[2], _Bodies(models)
    first = _find_point(starts, sampling_rate, np.zeros(len(models)), count, is_inside=True)
    free = _find_point(starts, sampling_rate, bodies.contact_time, count, is_inside=False)
    contact = _ContactPhase(bodies, variant)
    _place(
        contact.evaluate(starts + first / sampling_rate, sampling_rate, free - first),
        first,
        free,
        out,
    )
    late = starts + free / sampling_rate - bodies.contact_time
    ends = np.full(len(models), count)
    # The driven hammer rests once the force is gone.
    moving = slice(0 if variant is ModelVariant.PRINTED else 1, 2)
    _place(
        _evaluate_free(bodies, contact.find_end(), late, sampling_rate, ends - free, moving),
        free,
        ends,
        out[:, moving],
    )


def _find_point(
    starts: FloatArray,
    sampling_rate: float,
    limits: FloatArray,
    count: int,
    *,
    is_inside: bool,
) -> NDArray[np.intp]:
    """Return the first points at or (not `is_inside`) beyond a time, at most `count`."""
    # The grid is start + n / rate as rounded: the points around say which one it is.
    near = np.ceil((limits - starts) * sampling_rate)[:, np.newaxis] + NEIGHBOURS
    times = starts[:, np.newaxis] + near / sampling_rate
    limit = limits[:, np.newaxis]
    is_before = times < limit if is_inside else times <= limit
    points = near[:, 0] + is_before.sum(axis=1)
    return np.asarray(points.clip(0.0, count), dtype=np.intp)


def _place(
    values: FloatArray, first: NDArray[np.intp], end: NDArray[np.intp], out: FloatArray
) -> None:
    """Copy values, shape (models, bodies, longest), to where each model has them."""
    for record, source, begin, stop in zip(out, values, first, end, strict=True):
        record[:, begin:stop] = source[:, : stop - begin]


class _Bodies:
    """Parameters of many models, each an array of shape (models,) or (models, 2)."""

    def __init__(self, models: Sequence[ImpactModel]) -> None:
        table = np.array(
            [
                (
                    model.hammer.mass,
                    model.specimen.mass,
                    model.hammer.stiffness,
                    model.specimen.stiffness,
                    model.hammer.damping_coefficient,
                    model.specimen.damping_coefficient,
                    model.contact_time,
                    model.impact_speed,
                    model.peak_force,
                )
                for model in models
            ],
            dtype=np.float64,
        )
        self.masses, self.stiffness, self.damping = table[:, 0:2], table[:, 2:4], table[:, 4:6]
        self.contact_time, self.impact_speed, self.peak_force = table[:, 6:9].T


class _ContactPhase:
    """The contact, 0 <= t <= tau_p, as one linear system without input.

    Its state is z = (x1/d, x2/d, x1'/(d w), x2'/(d w), 1, cos wt, sin wt) with w = 2 pi / tau_p
    and a length d that makes all entries of about one size; z' = w N z.
    """

    def __init__(self, bodies: _Bodies, variant: ModelVariant) -> None:
        count = bodies.contact_time.size
        is_printed = variant is ModelVariant.PRINTED
        self._rate = rate = FULL_TURN / bodies.contact_time
        direction = np.array((0.0, -1.0) if is_printed else (-1.0, 1.0))
        drive = direction * (bodies.peak_force / 2.0)[:, np.newaxis] / bodies.masses
        speed = bodies.impact_speed if is_printed else np.zeros(count)
        length = np.maximum(np.abs(drive).max(axis=1) / rate, np.abs(speed)) / rate
        self._length = np.where(length > 0.0, length, 1.0)
        drive = drive / (self._length * rate**2)[:, np.newaxis]

        self._matrix = matrix = np.zeros((count, 7, 7))
        matrix[:, 0, 2] = matrix[:, 1, 3] = 1.0
        for column, values, scale in ((0, bodies.stiffness, rate**2), (2, bodies.damping, rate)):
            scaled = values / bodies.masses / scale[:, np.newaxis]
            matrix[:, 3, column + 1] = -scaled[:, 1]
            if is_printed:
                on_second = values[:, 0] / bodies.masses[:, 1] / scale
                matrix[:, 2, column] = -scaled[:, 0]
                matrix[:, 2, column + 1] = scaled[:, 0]
                matrix[:, 3, column] = on_second
                matrix[:, 3, column + 1] -= on_second
        matrix[:, 2:4, 4] = drive
        matrix[:, 2:4, 5] = -drive
        matrix[:, 5, 6], matrix[:, 6, 5] = -1.0, 1.0
        self._initial = np.zeros((count, 7))
        self._initial[:, 2] = speed / (self._length * rate)
        self._initial[:, 4:6] = 1.0

    def find_end(self) -> FloatArray:
        """Return x1, x2 over tau_p and x1', x2' at tau_p, shape (models, 2, 2) [m/s]."""
        turn = exponentiate(self._matrix * FULL_TURN)
        state: FloatArray = (turn @ self._initial[:, :, np.newaxis])[:, :4, 0].reshape(-1, 2, 2)
        state = state * (self._length * self._rate)[:, np.newaxis, np.newaxis]
        state[:, 0] /= FULL_TURN
        return state

    def evaluate(
        self, first: FloatArray, sampling_rate: float, counts: NDArray[np.intp]
    ) -> FloatArray:
        """Return both accelerations from the time `first` on, shape (models, 2, longest)."""
        angles = np.stack([self._rate * first, self._rate / sampling_rate])
        shift, step = exponentiate(self._matrix * angles[:, :, np.newaxis, np.newaxis])
        initial = (shift @ self._initial[:, :, np.newaxis])[:, :, 0]
        scale = (self._length * self._rate**2)[:, np.newaxis, np.newaxis]
        return propagate_output(
            step, initial, scale * self._matrix[:, 2:4], int(counts.max(initial=0))
        )


def _evaluate_free(
    bodies: _Bodies,
    state: FloatArray,
    late: FloatArray,
    sampling_rate: float,
    counts: NDArray[np.intp],
    which: slice,
) -> FloatArray:
    """Return the accelerations of bodies left alone, `late` after the contact.

    States, shape (models, 2, 2), are positions over tau_p and velocities, which makes entries of
    about one size; the result has the shape (models, bodies, longest).
    """
    tau = bodies.contact_time
    masses = bodies.masses[:, which]
    matrix = np.zeros((late.size, masses.shape[1], 2, 2))
    matrix[..., 0, 1] = 1.0
    matrix[..., 1, 0] = bodies.stiffness[:, which] / masses * -(tau**2)[:, np.newaxis]
    matrix[..., 1, 1] = bodies.damping[:, which] / masses * -tau[:, np.newaxis]
    times = np.stack([late, np.full(late.size, 1.0 / sampling_rate)]) / tau
    shift, step = exponentiate(matrix * times[:, :, np.newaxis, np.newaxis, np.newaxis])
    own = np.swapaxes(state, 1, 2)[:, which, :, np.newaxis]
    readout = matrix[..., 1:, :] / tau[:, np.newaxis, np.newaxis, np.newaxis]
    longest = int(counts.max(initial=0))
    return propagate_output(step, (shift @ own)[..., 0], readout, longest)[:, :, 0]
