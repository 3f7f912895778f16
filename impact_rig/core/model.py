"""The two-body model of the paper, in closed form."""

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from impact_rig.core.equations import estimate_equivalent_mass
from impact_rig.core.errors import ParameterError, check_not_negative, check_positive
from impact_rig.core.records import FloatArray


class ContactSpan(NamedTuple):
    """The points in the contact."""

    # The first point in the contact, and the first one beyond it; the number of points, if there
    # is none.
    first: int
    free: int
    begin: float  # time of `first`, counted from the start of the contact [s]
    late: float  # time of `free`, counted from the end of the contact [s]


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
    times = start + np.arange(count) / sampling_rate
    first, free = int(times.searchsorted(0.0)), int(times.searchsorted(contact_time, "right"))
    begin, late = start + first / sampling_rate, start + free / sampling_rate - contact_time
    # Where the grid has no such point, a harmless time.
    return ContactSpan(first, free, min(max(begin, 0.0), contact_time), max(late, 0.0))


FULL_TURN = 2.0 * math.pi
"""w tau_p [rad]."""


class ModelVariant(Enum):
    """How the two bodies are driven.

    `PRINTED` is equations (1) and (2) as they stand. `DRIVEN` is what Figs. 5 and 6 describe:
    the hammer's trace is the versed-sine (4) itself, and the sample is driven by +F(t) alone.
    """

    DRIVEN = "driven"
    PRINTED = "printed"


@dataclass(frozen=True)
class Body:
    """One body: a mass on a spring and a damper."""

    mass: float  # [kg]
    stiffness: float  # [N/m]
    damping_coefficient: float  # [N s/m]

    def __post_init__(self) -> None:
        """Refuse impossible numbers."""
        check_positive("mass of a body", self.mass, "kg")
        check_positive("stiffness of a body", self.stiffness, "N/m")
        check_not_negative("damping coefficient of a body", self.damping_coefficient, "N s/m")


@dataclass(frozen=True)
class ImpactModel:
    """Parameters of one impact."""

    hammer: Body  # m1, k1, c1 and m2, k2, c2
    specimen: Body
    contact_time: float  # tau_p [s]
    impact_speed: float  # v1 [m/s]
    peak_force: float  # F0 [N], signed; equation (1) has -F(t) on body 2

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
    spans = [
        find_contact(start, model.contact_time, sampling_rate, count)
        for model, start in zip(models, starts, strict=True)
    ]
    systems = [_describe(model, sampling_rate, variant) for model in models]
    during, ends = _follow(
        np.array([matrix for matrix, _ in systems]),
        np.array([state for _, state in systems]),
        np.array([span.begin * sampling_rate for span in spans]),
        np.array([model.contact_time * sampling_rate for model in models]),
        max(1, *(span.free - span.first for span in spans)),
        sampling_rate,
    )
    # The driven hammer rests after the contact.
    moving = slice(0, 2) if variant is ModelVariant.PRINTED else slice(1, 2)
    decays = [
        _find_decays(
            body, position * model.contact_time / FULL_TURN, speed, span.late, sampling_rate
        )
        for model, span, end in zip(models, spans, ends.tolist(), strict=True)
        for body, position, speed in [
            (model.hammer, end[0], end[2]),
            (model.specimen, end[1], end[3]),
        ][moving]
    ]
    longest = max(1, *(count - span.free for span in spans))
    free = _let_decay(decays, longest).reshape(len(models), -1, longest)
    result = np.zeros((len(models), 2, count))
    for number, span in enumerate(spans):
        contact = during[number, :, : span.free - span.first]
        result[number, :, span.first : span.free] = contact
        result[number, moving, span.free :] = free[number, :, : count - span.free]
    return result


def _describe(
    model: ImpactModel, sampling_rate: float, variant: ModelVariant
) -> tuple[Sequence[Sequence[float]], Sequence[float]]:
    """Return A of y' = A y during the contact, its time counted in points, and y at the start.

    The state y is the positions of both bodies times w = 2 pi / tau_p, their velocities, and 1,
    cos(w t) and sin(w t), which make the force.
    """
    first, second = model.hammer, model.specimen
    m1, m2, rate = first.mass, second.mass, sampling_rate
    turn = FULL_TURN / model.contact_time / rate
    force = model.peak_force / (2.0 * rate)
    k1, c1, speed, f1, f2 = 0.0, 0.0, 0.0, -force / m1, force / m2
    if variant is ModelVariant.PRINTED:
        k1, c1, speed = first.stiffness, first.damping_coefficient, model.impact_speed
        f1, f2 = 0.0, -force / m2
    k1, k2 = (stiffness / (turn * rate**2) for stiffness in (k1, second.stiffness))
    c1, c2 = c1 / rate, second.damping_coefficient / rate
    matrix = (
        (0.0, 0.0, turn, 0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, turn, 0.0, 0.0, 0.0),
        (-k1 / m1, k1 / m1, -c1 / m1, c1 / m1, f1, -f1, 0.0),
        (k1 / m2, -(k1 + k2) / m2, c1 / m2, -(c1 + c2) / m2, f2, -f2, 0.0),
        (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -turn),
        (0.0, 0.0, 0.0, 0.0, 0.0, turn, 0.0),
    )
    return matrix, (0.0, 0.0, speed, 0.0, 1.0, 1.0, 0.0)


DIRECT = 32
"""Points that are exponentials of the start [-], measured; the others are made of them."""
ORDER = 16
"""Of the exponential's series [-]: what it leaves out, 1 / 17!, is below 3e-15."""


def _follow(
    matrices: FloatArray,
    states: FloatArray,
    first: FloatArray,
    end: FloatArray,
    count: int,
    rate: float,
) -> tuple[FloatArray, FloatArray]:
    """Return both accelerations at points from `first` on, and the states at `end`.

    Of shapes (systems, 2, count) and (systems, 7); by doubling, since e^(2 A t) = (e^(A t))^2.
    """
    last = np.minimum((end - first).astype(np.int_), count - 1)
    times = np.empty((len(first), DIRECT + 2))
    times[:, :-1] = np.arange(DIRECT + 1)
    times[:, :DIRECT] += first[:, np.newaxis]
    times[:, -1] = end - first - last
    jumps = _exponentiate(matrices, times)
    path = np.empty((len(first), max(count, DIRECT), states.shape[1]))
    path[:, :DIRECT] = (jumps[:, :DIRECT] @ states[:, np.newaxis, :, np.newaxis])[..., 0]
    done, power = DIRECT, jumps[:, DIRECT].swapaxes(1, 2)
    while done < count:
        power = power @ power if done > DIRECT else power
        more = min(done, count - done)
        np.matmul(path[:, :more], power, out=path[:, done : done + more])
        done += more
    ends = jumps[:, -1] @ path[np.arange(len(path)), last, :, np.newaxis]
    return (rate * matrices[:, 2:4]) @ path.swapaxes(1, 2), ends[..., 0]


def _exponentiate(matrices: FloatArray, times: FloatArray) -> FloatArray:
    """Return e^(A t) of each system at its own times, shape (systems, times, d, d)."""
    count, size, _ = matrices.shape
    identity = np.eye(size)
    norm = float(np.abs(matrices).sum(axis=1).max() * times.max())
    squarings = max(math.frexp(norm)[1], 0)
    powers = np.empty((count, ORDER, size, size))
    powers[:, 0] = matrices
    for done in (1, 2, 4, 8):
        np.matmul(
            powers[:, :done], powers[:, done - 1, np.newaxis], out=powers[:, done : 2 * done]
        )
    terms = (0.5**squarings * times[..., np.newaxis]) / np.arange(1.0, ORDER + 1)
    series = np.multiply.accumulate(terms, axis=2)
    result: FloatArray = series @ powers.reshape(count, ORDER, -1)
    result = result.reshape(count, -1, size, size)
    # e^A - 1 is squared, which keeps the digits of small matrices beside large ones.
    for _ in range(squarings):
        result = result @ (result + 2.0 * identity)
    return result + identity


NEARLY_CRITICAL = 1e-5
"""Distance of both decay rates from their mean, over it, at least [-]: nearer ones count as so far
apart, which changes a trace by 1e-10, and keeps the digits of their difference."""


def _find_decays(
    body: Body, position: float, speed: float, late: float, rate: float
) -> tuple[tuple[complex, complex], tuple[complex, complex]]:
    """Return the two decays whose sum is the acceleration of a body left alone.

    First values, at a time `late` after the state, and rates per point.
    """
    stiffness = body.stiffness / body.mass
    half = body.damping_coefficient / body.mass / 2.0
    root = cmath.sqrt(half * half - stiffness)
    if abs(root) < NEARLY_CRITICAL * half:
        root = complex(NEARLY_CRITICAL * half)
    fast = -half - root
    # Their product is k / m: -c / 2m + root would lose its digits to a large c.
    slow = stiffness / fast
    values = (
        slow**2 * (speed - fast * position) / (slow - fast) * cmath.exp(slow * late),
        fast**2 * (slow * position - speed) / (slow - fast) * cmath.exp(fast * late),
    )
    return values, (slow / rate, fast / rate)


def _let_decay(
    decays: Sequence[tuple[tuple[complex, complex], tuple[complex, complex]]], count: int
) -> FloatArray:
    """Return sums of two decays each, of first values and rates per point, shape (n, count)."""
    block = math.isqrt(count - 1) + 1
    powers = np.empty((len(decays), block, 4), dtype=np.complex128)
    powers[:, 0] = [(*values, 1.0, 1.0) for values, _ in decays]
    powers[:, 1:] = [
        [[cmath.exp(part * each) for part in (block, 1.0) for each in rates]]
        for _, rates in decays
    ]
    np.multiply.accumulate(powers, axis=1, out=powers)
    far, near = np.conj(powers[..., :2]), powers[..., 2:].copy()
    # The real parts of all products.
    sums: FloatArray = far.view(np.float64) @ near.view(np.float64).swapaxes(1, 2)
    return sums.reshape(len(sums), -1)[:, :count]
