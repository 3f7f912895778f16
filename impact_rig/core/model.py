"""The two-body model of the paper, in closed form."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple

import numpy as np

from impact_rig.core.errors import ParameterError, check_not_negative, check_positive
from impact_rig.core.linear_systems import (
    FreeOscillator,
    Moments,
    compute_padding,
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


def simulate_contacts(
    system: ContactSystem,
    numbers: Sequence[tuple[float, ...]],
    moments: Sequence[Moments],
    count: int,
) -> tuple[FloatArray, FloatArray]:
    """Compute accelerations during the contact, and what moves at its end.

    Parameters
    ----------
    numbers : sequence of tuple of float
        Of each model: `K1` to `FORCE`.
    moments : sequence of Moments
        Of each model: its first point and the end of the contact, from the start of the contact.
    count : int
        Number of points, one or more; those beyond the contact mean nothing.

    Returns
    -------
    accelerations : ndarray, shape (models, 2, count)
        x1'' and x2'' [m/s^2].
    state : ndarray, shape (models, 2 * bodies)
        x w^2 / d, then x' w / d of the bodies that move, at the end of the contact [m/s^2].
    """
    size = system.size
    entries = (np.array(numbers) @ system.entries).reshape(-1, size + 3, size)
    values, ends = simulate_linear_systems(
        entries[:, :size], entries[:, -1], entries[:, size:-1], moments, count
    )
    return values, ends[:, : size - 3]


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
    places_steps: bool = False,
) -> FloatArray:
    """Simulate many impacts at once; parameters as `simulate_impact`, one start or one each.

    Parameters
    ----------
    places_steps : bool
        The two points beside each step of the printed model carry its place between them: they
        are the means of the trace over a triangle two points wide, which keeps the step's area
        and centre. Without that a step jumps from point to point as tau_p or t0 move, and no
        difference of traces is a derivative.

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
    # The last row of a record is written whole.
    result = np.zeros((len(models), 2, count + compute_padding(count)))
    for first in range(0, len(models), BATCH):
        part = slice(first, first + BATCH)
        chosen = models[part], sampling_rate, starts[part], variant, count
        _simulate(*chosen, result[part], places_steps=places_steps)
    return result[:, :, :count]


def _simulate(
    models: Sequence[ImpactModel],
    sampling_rate: float,
    starts: Sequence[float],
    variant: ModelVariant,
    count: int,
    out: FloatArray,
    *,
    places_steps: bool,
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
    if not (places_steps and is_printed):
        return
    for number, (span, end) in enumerate(zip(spans, ends.tolist(), strict=True)):
        at_start, at_end = _compute_jumps(numbers[number], end)
        place = -starts[number] * sampling_rate
        _place_step(out[number, :, :count], place, span.first, at_start)
        place += models[number].contact_time * sampling_rate
        _place_step(out[number, :, :count], place, span.free, at_end)


def _compute_jumps(
    numbers: Sequence[float], end: Sequence[float]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return how far the traces of hammer and sample jump at t = 0 and at tau_p [m/s^2].

    Of a printed model's numbers and its state at the end of the contact.
    """
    x1, x2, v1, v2 = end
    hammer = numbers[K1] * x2 + numbers[C1] * v2
    specimen = numbers[K12] * (x1 - x2) + numbers[C12] * (v1 - v2)
    speed = numbers[SPEED]
    return (-numbers[C1] * speed, numbers[C12] * speed), (-hammer, -specimen)


def _place_step(
    traces: FloatArray, place: float, follower: int, jumps: tuple[float, float]
) -> None:
    """Let the two points beside a step carry its place [points]; `follower` comes after it."""
    for point, sign in ((follower - 1, 0.5), (follower, -0.5)):
        reach = 1.0 - abs(point - place)
        if reach > 0.0 and 0 <= point < traces.shape[1]:
            weight = sign * reach * reach
            for body, jump in enumerate(jumps):
                traces[body, point] += weight * jump


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


DRIVEN_PARAMETERS = ("tau_p", "t0", "k2", "c2", "F0")
PRINTED_PARAMETERS = ("tau_p", "t0", "k2", "c2", "F0", "k1", "c1")
RELATIVE_STEP = 2.0**-25
"""Step over a parameter's scale [-]: there half the second derivative, which a forward difference
leaves out, and the traces' rounding of some 1e-15, which it divides, are both some 3e-8."""


@dataclass(frozen=True)
class Sensitivities:
    """Accelerations of both bodies and their derivatives.

    Attributes
    ----------
    names : tuple of str
        Parameters: contact time tau_p [s], start of the contact t0 [s], k2 [N/m], c2 [N s/m],
        F0 [N]; for the printed model also k1 [N/m] and c1 [N s/m].
    traces : ndarray, shape (2, n)
        x1'' and x2'' [m/s^2].
    derivatives : ndarray, shape (2, parameters, n)
        Of the traces [m/s^2 per unit of the parameter]. For t0: the contact moves later.
    """

    names: tuple[str, ...]
    traces: FloatArray
    derivatives: FloatArray


def list_parameters(variant: ModelVariant) -> tuple[str, ...]:
    """Return the parameters of a model variant, in the order of the derivatives."""
    return DRIVEN_PARAMETERS if variant is ModelVariant.DRIVEN else PRINTED_PARAMETERS


def compute_sensitivities(
    model: ImpactModel,
    sampling_rate: float,
    count: int,
    *,
    start: float = 0.0,
    variant: ModelVariant = ModelVariant.DRIVEN,
) -> Sensitivities:
    """Compute both accelerations on a uniform time grid and their derivatives.

    The arguments are those of `simulate_impact`, and the traces are equal to its with
    `places_steps`.
    """
    names = list_parameters(variant)
    models, starts, steps = [model], [start], []
    for name in names:
        moved, moved_start, step = _move(model, start, name)
        models.append(moved)
        starts.append(moved_start)
        steps.append(step)
    traces = simulate_impacts(
        models,
        sampling_rate,
        count,
        start=np.array(starts),
        variant=variant,
        places_steps=True,
    )
    # In place: nothing of that size is allocated again.
    derivatives = traces[1:]
    derivatives -= traces[0]
    derivatives *= 1.0 / np.array(steps)[:, np.newaxis, np.newaxis]
    return Sensitivities(names, traces[0], derivatives.swapaxes(0, 1))


def _move(model: ImpactModel, start: float, name: str) -> tuple[ImpactModel, float, float]:
    """Return model and start of the grid with one parameter a step larger, and that step."""
    rate = FULL_TURN / model.contact_time
    if name == "F0":
        # The traces are linear in it, so that any step is as good.
        moved = replace(model, peak_force=model.peak_force + (abs(model.peak_force) or 1.0))
        return moved, start, moved.peak_force - model.peak_force
    if name == "t0":
        earlier = start - RELATIVE_STEP / rate
        return model, earlier, start - earlier
    if name == "tau_p":
        moved = replace(model, contact_time=model.contact_time + RELATIVE_STEP / rate)
        return moved, start, moved.contact_time - model.contact_time
    part = "hammer" if name[1] == "1" else "specimen"
    body: Body = getattr(model, part)
    if name[0] == "k":
        scale = body.stiffness + body.mass * rate**2
        changed = replace(body, stiffness=body.stiffness + RELATIVE_STEP * scale)
        step = changed.stiffness - body.stiffness
    else:
        scale = body.damping_coefficient + body.mass * rate
        changed = replace(
            body, damping_coefficient=body.damping_coefficient + RELATIVE_STEP * scale
        )
        step = changed.damping_coefficient - body.damping_coefficient
    moved = (
        replace(model, hammer=changed) if part == "hammer" else replace(model, specimen=changed)
    )
    return moved, start, step
