"""The two-body model of the paper, in closed form."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from impact_rig.core.errors import ParameterError, check_not_negative, check_positive
from impact_rig.core.linear_systems import (
    FreeOscillator,
    Moments,
    simulate_free_oscillators,
    simulate_linear_systems,
)
from impact_rig.core.records import FloatArray
from impact_rig.core.stiffness import estimate_equivalent_mass


class ContactSpan(NamedTuple):
    """The points in the contact.

    Attributes
    ----------
    first, free : int
        The first point in the contact, and the first one beyond it; the number of points, if
        there is none.
    begin : float
        Time of `first`, counted from the start of the contact [s].
    late : float
        Time of `free`, counted from the end of the contact [s].
    """

    first: int
    free: int
    begin: float
    late: float


def find_contact(
    start: float, contact_time: float, sampling_rate: float, count: int
) -> ContactSpan:
    """Find the points with 0 <= t <= tau_p.

    Parameters
    ----------
    start : float
        Time of the first point, counted from the start of the contact [s].
    contact_time : float
        tau_p [s].
    sampling_rate : float
        [Hz]
    """
    first = _find_point(start, 0.0, sampling_rate, count)
    beyond = math.nextafter(contact_time, math.inf)
    free = _find_point(start, beyond, sampling_rate, count)
    begin, late = start + first / sampling_rate, start + free / sampling_rate - contact_time
    # Where the grid has no such point, a harmless time.
    return ContactSpan(first, free, min(max(begin, 0.0), contact_time), max(late, 0.0))


def _find_point(start: float, time: float, sampling_rate: float, count: int) -> int:
    """Return the first point at a time or after it; `count`: there is none."""
    place = (time - start) * sampling_rate
    if not -1.0 < place < count + 1.0:
        return 0 if place < 0.0 else count
    point = math.ceil(place)
    # The grid is start + n / rate as rounded, which may be one point aside.
    if start + (point - 1) / sampling_rate >= time:
        point -= 1
    elif start + point / sampling_rate < time:
        point += 1
    return min(max(point, 0), count)


FULL_TURN = 2.0 * np.pi
"""phi at the end of the contact [rad]."""

K1, K12, K2, C1, C12, C2, MASSES, ANGLE, SPEED, FORCE = range(10)
"""Numbers of a model. d [rad] times k1 / m1, k1 / m2 and k2 / m2 over w^2, times c1 / m1, c1 / m2
and c2 / m2 over w, times m2 / m1, and d itself; and what drives it [m/s^2]: the hammer's v1 w / d,
and the force's F0 / (2 m2 d)."""
NUMBERS = 10


@dataclass(frozen=True)
class ContactSystem:
    """How one variant of the model moves during the contact.

    The state is positions, velocities, and the force's constant, cosine and sine.

    Attributes
    ----------
    moving : slice
        The bodies in the state, of hammer and sample.
    size : int
        Of the state, d.
    entries : ndarray, shape (10, (d + 3) d)
        A model's numbers times these are A, below it the readout of the accelerations of hammer
        and sample, and the state at the start.
    """

    moving: slice
    size: int
    entries: FloatArray

    @staticmethod
    def make(moving: slice, readout: FloatArray) -> "ContactSystem":
        """Complete A, of which accelerations are rows, shape (10, 2, d)."""
        size = readout.shape[2]
        bodies = (size - 3) // 2
        entries = np.zeros((NUMBERS, size + 3, size))
        for body in range(bodies):
            entries[ANGLE, body, bodies + body] = 1.0
        entries[:, bodies : 2 * bodies] = readout[:, moving]
        entries[ANGLE, size - 2, size - 1], entries[ANGLE, size - 1, size - 2] = -1.0, 1.0
        entries[:, size:-1] = readout
        entries[SPEED, -1, bodies] = entries[FORCE, -1, -3] = entries[FORCE, -1, -2] = 1.0
        return ContactSystem(moving, size, entries.reshape(NUMBERS, -1))


def _make_printed() -> ContactSystem:
    """Couple both bodies, with the force on the second and a minus before it: equation (1)."""
    readout = np.zeros((NUMBERS, 2, 7))
    for on_first, on_second, own, places in ((K1, K12, K2, (0, 1)), (C1, C12, C2, (2, 3))):
        readout[on_first, 0, places] = -1.0, 1.0
        readout[on_second, 1, places] = 1.0, -1.0
        readout[own, 1, places[1]] = -1.0
    readout[ANGLE, 1, 4:6] = -1.0, 1.0
    return ContactSystem.make(slice(0, 2), readout)


def _make_driven() -> ContactSystem:
    """Let the hammer show the force, and rest afterwards; the sample alone is driven by it."""
    readout = np.zeros((NUMBERS, 2, 5))
    readout[MASSES, 0, 2:4] = -1.0, 1.0
    readout[K2, 1, 0] = readout[C2, 1, 1] = -1.0
    readout[ANGLE, 1, 2:4] = 1.0, -1.0
    return ContactSystem.make(slice(1, 2), readout)


PRINTED, DRIVEN = _make_printed(), _make_driven()


OSCILLATORS = ((K1, C1), (K2, C2))
"""Which numbers of a model are those of hammer and sample left alone."""


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
    hammer_mass: float, moving_mass: float, impact_speed: float, contact_time: float
) -> float:
    """Compute F0 [N] of an elastic impact from the momentum balance F0 = 4 m_eq v1 / tau_p.

    The impulse of a versed-sine is F0 tau_p / 2; masses in kg, speed in m/s, time in s. Raises
    `ParameterError` for impossible ones.
    """
    check_positive("contact time", contact_time, "s")
    equivalent = estimate_equivalent_mass(hammer_mass, moving_mass)
    return 4.0 * equivalent * impact_speed / contact_time


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
    sampling_rate : float
        [Hz]
    start : float
        Time of the first point, counted from the start of the contact [s]; before the contact
        both accelerations are zero.

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
        If the sampling rate is no positive number, or a start none at all.
    """
    check_positive("sampling rate", sampling_rate, "Hz")
    starts = start.tolist() if isinstance(start, np.ndarray) else [start] * len(models)
    if not all(map(math.isfinite, starts)):
        raise ParameterError("the start of a time grid must be a finite number")
    is_printed = variant is ModelVariant.PRINTED
    system = PRINTED if is_printed else DRIVEN
    spans = [
        find_contact(start, model.contact_time, sampling_rate, count)
        for model, start in zip(models, starts, strict=True)
    ]
    numbers = [_describe(each, sampling_rate, is_printed=is_printed) for each in models]
    moments = [
        Moments(span.begin * sampling_rate, model.contact_time * sampling_rate)
        for model, span in zip(models, spans, strict=True)
    ]
    size = system.size
    entries = (np.array(numbers) @ system.entries).reshape(-1, size + 3, size)
    contact, ends = simulate_linear_systems(
        entries[:, :size],
        entries[:, -1],
        entries[:, size:-1],
        moments,
        max(1, *(span.free - span.first for span in spans)),
    )
    bodies = (size - 3) // 2
    oscillators = [
        FreeOscillator(
            own[ANGLE] * own[stiffness],
            own[damping],
            end[body] / own[ANGLE],
            end[body + bodies],
            span.late * sampling_rate,
        )
        for own, end, span in zip(numbers, ends.tolist(), spans, strict=True)
        for body, (stiffness, damping) in enumerate(OSCILLATORS[-bodies:])
    ]
    longest = max(1, *(count - span.free for span in spans))
    free = simulate_free_oscillators(oscillators, longest).reshape(len(models), bodies, -1)
    result = np.zeros((len(models), 2, count))
    for number, span in enumerate(spans):
        result[number, :, span.first : span.free] = contact[number, :, : span.free - span.first]
        result[number, system.moving, span.free :] = free[number, :, : count - span.free]
    return result


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
