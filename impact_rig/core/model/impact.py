"""The two-body model of the paper in closed form.

While the bodies touch, the model is one linear system without input, y(t) = e^(At) y(0), with the
force in its state; afterwards each body is a damped oscillator. That is exact for every damping
and every pulse, critical damping and resonance included, where eigenvectors or a particular
solution would fail. Nothing is stepped through time, and many impacts are calculated at once.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from impact_rig.core.checks import check_between, check_not_negative, check_positive
from impact_rig.core.errors import ParameterError
from impact_rig.core.model.contact import (
    ANGLE,
    C1,
    C2,
    DRIVEN,
    FULL_TURN,
    K1,
    K2,
    PRINTED,
    simulate_contacts,
)
from impact_rig.core.model.oscillator import (
    FreeOscillator,
    find_padding,
    simulate_free_oscillators,
)
from impact_rig.core.model.propagation import Moments
from impact_rig.core.model.stiffness import estimate_equivalent_mass
from impact_rig.core.model.time_grid import find_contact
from impact_rig.core.signals.record import FloatArray

OSCILLATORS: tuple[tuple[int, int], ...] = ((K1, C1), (K2, C2))
"""Which numbers of a model are those of hammer and sample left alone."""
BATCH = 64
"""Impacts that are calculated at once [-], measured: what they need stays near the processor."""


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
    result = simulate_impacts([model], sampling_rate, count, start=start, variant=variant)
    return result[0, 0], result[0, 1]


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

    Raises
    ------
    ParameterError
        If the sampling rate is no positive number, a start none at all, or the count below zero.
    """
    check_positive("sampling rate", sampling_rate, "Hz")
    if count < 0:
        raise ParameterError(f"count is {count} points: it must be 0 or more")
    starts = start.tolist() if isinstance(start, np.ndarray) else [start] * len(models)
    if not all(map(math.isfinite, starts)):
        raise ParameterError("the start of a time grid must be a finite number")
    # The last row of a record is written whole.
    result = np.zeros((len(models), 2, count + find_padding(count)))
    for first in range(0, len(models), BATCH):
        part = slice(first, first + BATCH)
        _simulate(models[part], sampling_rate, starts[part], variant, count, result[part])
    return result[:, :, :count]


def _simulate(
    models: Sequence[ImpactModel],
    sampling_rate: float,
    starts: Sequence[float],
    variant: ModelVariant,
    count: int,
    out: FloatArray,
) -> None:
    """Fill `out`, shape (models, 2, count and more), which is zero."""
    is_printed = variant is ModelVariant.PRINTED
    system = PRINTED if is_printed else DRIVEN
    spans, numbers, moments, longest = [], [], [], 1
    for model, start in zip(models, starts, strict=True):
        span = find_contact(start, model.contact_time, sampling_rate, count)
        spans.append(span)
        numbers.append(_describe(model, sampling_rate, is_printed=is_printed))
        moments.append(Moments(span.begin * sampling_rate, model.contact_time * sampling_rate))
        longest = max(longest, span.free - span.first)
    contact, ends = simulate_contacts(system, numbers, moments, longest)

    oscillators, records, longest = [], [], 0
    bodies = OSCILLATORS[system.moving]
    for number, ((first, free, _, late), end) in enumerate(zip(spans, ends.tolist(), strict=True)):
        out[number, :, first:free] = contact[number, :, : free - first]
        if free < count:
            longest = max(longest, count - free)
            own, angle, late_points = numbers[number], numbers[number][ANGLE], late * sampling_rate
            for body, (stiffness, damping) in enumerate(bodies):
                oscillators.append(
                    FreeOscillator(
                        angle * own[stiffness],
                        own[damping],
                        end[body] / angle,
                        end[body + len(bodies)],
                        late_points,
                    )
                )
            records.append(out[number, system.moving, free:])
    if records:
        simulate_free_oscillators(oscillators, longest, records)


def _describe(model: ImpactModel, sampling_rate: float, *, is_printed: bool) -> tuple[float, ...]:
    """Return a model's numbers, `K1` to `FORCE`."""
    first, second = model.hammer, model.specimen
    m1, m2, rate = first.mass, second.mass, FULL_TURN / model.contact_time
    angle = rate / sampling_rate
    k1, k2 = first.stiffness * angle / rate**2, second.stiffness * angle / rate**2
    c1 = first.damping_coefficient / sampling_rate
    c2 = second.damping_coefficient / sampling_rate
    return (
        *(k1 / m1, k1 / m2, k2 / m2, c1 / m1, c1 / m2, c2 / m2, angle * m2 / m1, angle),
        model.impact_speed * sampling_rate if is_printed else 0.0,
        model.peak_force / (2.0 * m2 * angle),
    )
