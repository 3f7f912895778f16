"""The pulses of contact laws F = k δⁿ + c δᵐ δ', as tables of the scaled equation."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from impact_rig.core.given.records import FloatArray, make_read_only


class LossForm(Enum):
    """Forms of loss: what stands beside k δⁿ."""

    PROPORTIONAL = "δⁿ δ'"  # Hunt and Crossley 1975
    # The next four may stand beside it; all pull at the end of the contact.
    LINEAR = "δ δ'"  # of no published law, but between the others
    ROOT = "√δ δ'"  # Kuwabara and Kono 1987
    FOURTH_ROOT = "δ^¼ δ'"  # Tsuji, Tanaka and Ishida 1992
    DASHPOT = "δ'"  # Kelvin and Voigt
    PLATE = "waves in a plate"  # Zener 1941: the plate yields at the speed F / Z
    MEMORY = "a part of k that relaxes"  # a standard linear solid, where n is 1


EXPONENTS = (0.75, 3.25)
"""Smallest and largest n of the tables [-], our choice: of a yielding and of a slow contact."""
LOSSES = (-0.1, 1.0)
"""The same of both losses, see `find_losses`: from e above 1 to 0.3 [-]."""
NODES = 65
"""Points of a pulse [-], our choice: the force is good to 1e-5 of its peak."""
FORMS = tuple(LossForm)
PLATE, MEMORY = FORMS.index(LossForm.PLATE), FORMS.index(LossForm.MEMORY)
DEGREES = ((14, 0, 8), (14, 9, 8), *3 * [(14, 7, 8)], (14, 0, 8), (8, 11, 8))
"""Degrees of each form's polynomials in both losses and n [-], our choice: good to 1e-5."""
SMALLEST_TERM = 3e-6
"""Of a polynomial's term at any node [-], our choice: half of them are smaller, and left out."""
LARGEST = 4.0
"""B of the form of loss δⁿ δ' at which that loss alone gives e = 0.25 [-]."""
SECOND = np.array(
    [
        (1.0, 0.0, 0.0),
        (1.0, 3.0, 0.85),
        (0.5, 1.75, 0.5),
        (0.25, 1.25, 0.42),
        (0.0, 0.82, 0.34),
        (1.0, 0.0, 0.0),
        (1.0, 0.0, 0.0),
    ]
)
"""m, B n^s and s of each form's other loss alone where e is about 0.3 [-]; rows by `FORMS`."""
LARGEST_YIELD = 0.8
"""The same of a plate by δ'' = -F / m - F' / Z [-]."""
LARGEST_LAG = 0.32
"""Tangent of the loss angle at 1 / T of what relaxes where the first loss is 1 [-]: more would
hold the bodies together."""


@dataclass(frozen=True)
class Losses:
    """The losses of pulses, in units of the scaled equation; arrays of one shape."""

    proportional: FloatArray  # B of a loss B xⁿ x'
    pulling: FloatArray  # C of a loss C xᵐ x'
    power: FloatArray  # m
    yielding: FloatArray  # T F / (Z x'), by which a plate yields
    lag: FloatArray  # tangent of the loss angle at the frequency 1 / (2 pi T)
    rate: FloatArray  # of the relaxation, of the stiffness lag (1 / rate + rate)

    def relax(self, spring: FloatArray, held: FloatArray) -> FloatArray:
        """Return the force of what relaxes, from xⁿ and what of it is past; 1 / T finds xⁿ."""
        rate = self.rate
        return np.asarray(self.lag * (rate * spring - (rate + 1.0 / rate) * held))


def find_losses(
    exponent: FloatArray, loss: FloatArray, pull: FloatArray, forms: NDArray[np.intp]
) -> Losses:
    """Return the losses of the scaled equation.

    Parameters
    ----------
    loss, pull : ndarray
        0 to 1, where e is about 0.3: `loss` is a part of what `pull` leaves room for. Of a form
        with memory they say how much of k relaxes, and how fast.
    """
    power, largest, slope = SECOND[forms].T
    is_plate, is_memory = forms == PLATE, forms == MEMORY
    alone = LARGEST * loss * (1.0 - 0.85 * pull)
    lag = np.where(is_memory, LARGEST_LAG * loss, 0.0)
    # Our choice: slower and faster it is as a loss by δ', and more would hold the bodies together.
    slowest, fastest = 0.1 + 1.2 * lag, 10.0 / (1.0 + 5.0 * lag)
    return Losses(
        proportional=np.where(is_plate | is_memory, 0.0, alone),
        pulling=largest * pull * exponent**-slope,
        power=power,
        yielding=np.where(is_plate, LARGEST_YIELD * loss, 0.0),
        lag=lag,
        rate=slowest * (fastest / slowest) ** ((pull + 0.1) / 1.1),
    )


SMALLEST_COSINE = 1e-6
"""Below it rounding is more than what is left out [-]."""


@dataclass(frozen=True)
class _Motion:
    """The motion of many contacts as a function of the angle: see `_tabulate`."""

    exponent: FloatArray  # n of each, shape (k,)
    losses: Losses

    def find_state(self, phase: float, state: FloatArray) -> tuple[FloatArray, ...]:
        """Return xⁿ, the loss beside it over x', x', the deceleration by losses, and the rate."""
        # From 0 at touch to pi at x = 0, crowded at both ends.
        angle = math.pi * phase**3 * (10.0 - 15.0 * phase + 6.0 * phase**2)
        log_radius, _, held = state
        sine, cosine = max(math.sin(angle), 0.0), math.cos(angle)
        half, losses = (self.exponent + 1.0) / 2.0, self.losses
        log_sine = math.log(max(sine, 1e-300))
        # At the top x' comes to zero.
        bend = np.sqrt(half)
        if abs(cosine) > SMALLEST_COSINE:
            bend = np.sqrt(-np.expm1(2.0 * half * log_sine)) / abs(cosine)
        # Exponentials of logarithms take a third of the time of powers.
        log_reach = (np.log(half) + 2.0 * log_radius) / (2.0 * half)
        log_x, speed = log_reach + log_sine, np.exp(log_radius) * cosine * bend
        spring = np.exp(self.exponent * log_x)
        loss = losses.proportional * spring + losses.pulling * np.exp(losses.power * log_x)
        drag = loss + 0.0
        if sine:
            drag += losses.yielding * self.exponent * spring * np.exp(-log_x)
        drag = drag * speed + losses.relax(spring, held)
        rate = np.sqrt(half) * np.exp((half - 1.0) * log_reach) + sine * drag * np.exp(-log_radius)
        return spring, loss, speed, drag, bend * rate / half

    def differentiate(self, phase: float, state: FloatArray) -> FloatArray:
        """Return the derivatives of ln r, of time and of what is remembered in the phase."""
        slope = math.pi * 30.0 * (phase * (1.0 - phase)) ** 2
        if not slope:
            return np.zeros_like(state)
        spring, _, speed, drag, rate = self.find_state(phase, state)
        time = slope / rate
        relaxed = self.losses.rate * (spring - state[2])
        return (
            np.stack((-drag * speed * np.exp(-2.0 * state[0]), np.ones_like(time), relaxed)) * time
        )

    def describe(self, phase: float, state: FloatArray) -> FloatArray:
        """Return time, what is left of the momentum, and the force."""
        spring, loss, speed, *_ = self.find_state(phase, state)
        force = spring + loss * speed + self.losses.relax(spring, state[2])
        return np.stack((state[1], speed + self.losses.yielding * spring, force))


def _make_grid(form: int) -> FloatArray:
    """Return the pulses of one form's table, shape (3, ...): both losses and n of each."""
    points = [chebyshev.chebpts1(degree + 1) for degree in DEGREES[form]]
    axes = zip(points, (LOSSES, LOSSES, EXPONENTS), strict=True)
    return np.array(
        np.meshgrid(*(_stretch(point, limits) for point, limits in axes), indexing="ij")
    )


@lru_cache(maxsize=1)
def _tabulate() -> tuple[list[tuple[NDArray[np.intp], FloatArray]], FloatArray]:
    """Return tables of all forms, and patterns by which nodes move, shape (patterns, 3 nodes).

    A table is its degrees, shape (3, terms), and coefficients (terms, patterns).

    A pulse is found by its angle in the plane of compression and speed, which grows from 0 at
    touch to pi where x is 0 again: with that as the clock every pulse of the table has its nodes
    at like places, and what stands there is smooth in n and both losses. An example is Hertz
    without loss, n = 3/2: node 0 is touch, with time 0, momentum 1 and force 0; node 32 the top,
    at 1.609 T, with momentum 0 and force 1.143 m v / T; node 64 the end, at 3.218 T, with
    momentum -1 and force 0. The first numbers of each degree stand for the middle of the table,
    the others say how a node moves with n and the losses.
    """
    grids = [_make_grid(form) for form in range(len(FORMS))]
    sizes = [grid[0].size for grid in grids]
    forms = np.repeat(np.arange(len(FORMS)), sizes)
    loss, pull, exponent = np.concatenate([grid.reshape(3, -1) for grid in grids], axis=1)
    pull = np.where(np.array(DEGREES)[forms, 1] > 0, pull, 0.0)
    motion = _Motion(exponent, find_losses(exponent, loss, pull, forms))
    state = np.zeros((3, exponent.size))
    described = [motion.describe(0.0, state)]
    # Runge-Kutta's method from node to node: good to 2e-6.
    step = 1.0 / (NODES - 1)
    for count in range(NODES - 1):
        phase = count * step
        first = motion.differentiate(phase, state)
        middle = phase + step / 2.0
        second = motion.differentiate(middle, state + step / 2.0 * first)
        third = motion.differentiate(middle, state + step / 2.0 * second)
        fourth = motion.differentiate(phase + step, state + step * third)
        state = state + step / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
        described.append(motion.describe(phase + step, state))
    nodes = np.stack(described, axis=1).reshape(3 * NODES, -1)
    tables = []
    for form, values in enumerate(np.split(nodes, np.cumsum(sizes)[:-1], axis=1)):
        found = values.reshape(-1, *grids[form].shape[1:])
        for axis, degree in enumerate(DEGREES[form], start=1):
            into = np.linalg.inv(chebyshev.chebvander(chebyshev.chebpts1(degree + 1), degree))
            found = np.moveaxis(np.tensordot(into, found, (1, axis)), 0, axis)
        degrees = np.argwhere(np.abs(found).max(axis=0) > SMALLEST_TERM).T
        tables.append((degrees, found[:, *degrees].T))
    # Nodes move together: half as many patterns hold all that they do.
    all_terms = np.concatenate([terms for _, terms in tables])
    strength, patterns = np.linalg.eigh(all_terms.T @ all_terms)
    patterns = patterns[:, strength > SMALLEST_TERM**2]
    return [(degrees, make_read_only(terms @ patterns)) for degrees, terms in tables], patterns.T


def _stretch(point: FloatArray, limits: tuple[float, float]) -> FloatArray:
    return np.asarray((limits[0] + limits[1] + point * (limits[1] - limits[0])) / 2.0)


LEAST_PULL = 1e-4
"""Pull between the bodies that is one [m v / T], our choice: the tables may be off by less."""
FINE = np.linspace(0.0, 1.0, 65)
"""Where a crossing or a peak between two nodes is looked for."""


@dataclass(frozen=True)
class ScaledPulses:
    """Pulses in scaled units: time in T, momentum in m v.

    The contact ends where the force comes back to zero: bodies that do not stick do not pull at
    each other.
    """

    exponent: FloatArray  # n [-], shape (pulses,)
    losses: Losses
    time: FloatArray  # of each node, shape (pulses, nodes)
    momentum: FloatArray  # that is left: 1 at first touch, -e at the end
    force: FloatArray
    changes: FloatArray  # of these three by both losses and n, shape (pulses, 3, 3, nodes)

    @cached_property
    def _end(self) -> tuple[FloatArray, FloatArray]:
        """Time and momentum where the contact ends, shape (pulses,)."""
        rows, top = np.arange(len(self.time)), NODES // 2
        pulls = self.force.min(axis=1, keepdims=True) < -LEAST_PULL
        last = top + _find_first((self.force[:, top:] < 0.0) & pulls)
        start = self.time[rows, last - 1]
        step, place = self.time[rows, last] - start, last - 1 + NODES * rows
        force = _interpolate(
            self._lever, self._lever_rate, place[:, np.newaxis], step[:, np.newaxis], FINE
        )
        after = _find_first(force < 0.0)
        before, behind = force[rows, after - 1], np.minimum(force[rows, after], 0.0)
        before = np.maximum(before, 0.0)
        part = np.divide(before, before - behind, out=np.ones_like(before), where=behind < 0.0)
        phase = (after - 1 + part) / (FINE.size - 1)
        return start + phase * step, _interpolate(self.momentum, -self.force, place, step, phase)

    @cached_property
    def _lever(self) -> FloatArray:
        """Force over xᵐ at each node: nearly straight where the force is steep, or comes to 0."""
        depth = np.maximum(self.compression[:, 1:-1], 1e-30)
        inner = depth ** self.losses.power[:, np.newaxis]
        lever = self.force[:, 1:-1] / inner
        return np.concatenate((lever[:, :1], lever, lever[:, -1:]), axis=1)

    @cached_property
    def _lever_rate(self) -> FloatArray:
        return _differentiate(self._lever, self.time)

    @property
    def duration(self) -> FloatArray:
        """From first touch to separation, shape (pulses,)."""
        return self._end[0]

    @property
    def restitution(self) -> FloatArray:
        """Speed of separation over impact speed e, shape (pulses,)."""
        return -self._end[1]

    @cached_property
    def compression(self) -> FloatArray:
        """Approach since first touch at each node, in v T, shape (pulses, nodes)."""
        step = np.diff(self.time)
        parts = step / 2.0 * (self.momentum[:, 1:] + self.momentum[:, :-1])
        parts += step**2 / 12.0 * np.diff(self.force)
        return np.concatenate((np.zeros((len(step), 1)), np.cumsum(parts, axis=1)), axis=1)

    @property
    def largest_compression(self) -> FloatArray:
        """Where the bodies approach no more, shape (pulses,)."""
        rows, top = np.arange(len(self.time)), np.argmax(self.compression, axis=1)
        beyond = self.momentum[rows, top] ** 2 / (2.0 * self.force[rows, top])
        return np.asarray(self.compression[rows, top] + beyond)

    @property
    def is_passive(self) -> NDArray[np.bool_]:
        """Whether both losses together take energy at every depth, shape (pulses,)."""
        losses = self.losses
        reach = self.largest_compression ** (self.exponent - losses.power)
        takes = (losses.pulling >= 0.0) & (losses.proportional * reach + losses.pulling >= 0.0)
        return np.asarray(takes & (losses.lag >= 0.0))

    def compute_peak_force(self) -> FloatArray:
        """Return the largest force, shape (pulses,)."""
        rows, top = np.arange(len(self.time)), np.argmax(self.force, axis=1)
        start = self.time[rows, np.maximum(top - 1, 0), None]
        stop = self.time[rows, np.minimum(top + 1, NODES - 1), None]
        return np.asarray(self.compute_force(start + FINE * (stop - start)).max(axis=1))

    def compute_force(self, time: FloatArray) -> FloatArray:
        """Return the force of each pulse, zero outside it, shape (pulses, n).

        Parameters
        ----------
        time : ndarray, shape (n,) or (pulses, n)
            In T of each pulse.
        """
        time = np.broadcast_to(time, (len(self.time), time.shape[-1]))
        place = self._place(time)
        depth = np.maximum(_interpolate(self.compression, self.momentum, *place), 0.0)
        force = _interpolate(self._lever, self._lever_rate, *place)
        force *= depth ** self.losses.power[:, np.newaxis]
        inside = (time >= 0.0) & (time < self.duration[:, np.newaxis])
        return np.where(inside, np.maximum(force, 0.0), 0.0)

    def compute_impulse(self, time: FloatArray) -> FloatArray:
        """Return the integral of the force up to each time, and its derivatives.

        Parameters
        ----------
        time : ndarray, shape (pulses, n)
            In T of each pulse.

        Returns
        -------
        ndarray, shape (4, pulses, n)
            The impulse; by both losses and n.
        """
        place = self._place(np.minimum(time, self.duration[:, np.newaxis]))
        # At one and the same time, where a node comes later.
        rate = _differentiate(self.force, self.time)
        later, slower, stronger = self.changes.transpose(2, 1, 0, 3)
        impulses = np.concatenate((1.0 - self.momentum[np.newaxis], -slower - self.force * later))
        forces = np.concatenate((self.force[np.newaxis], stronger - rate * later))
        each = zip(impulses, forces, strict=True)
        return np.stack([_interpolate(values, slopes, *place) for values, slopes in each])

    def _place(self, time: FloatArray) -> tuple[NDArray[np.intp], FloatArray, FloatArray]:
        """Return the node before each time, the step behind it, and what part of it has passed."""
        places = [
            nodes[1:-1].searchsorted(row, side="right") + NODES * number
            for number, (nodes, row) in enumerate(zip(self.time, time, strict=True))
        ]
        place = np.stack(places)
        nodes = self.time.ravel()
        start = nodes[place]
        step = nodes[place + 1] - start
        return place, step, np.minimum(np.maximum((time - start) / step, 0.0), 1.0)


def _find_first(marks: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the first marked place in each row but 0, or else its end."""
    marks[:, -1] = True
    return np.asarray(1 + np.argmax(marks[:, 1:], axis=1))


def _differentiate(values: FloatArray, time: FloatArray) -> FloatArray:
    """Return derivatives, by the parabola through each point and its neighbours."""
    step = np.diff(time)
    slope = np.diff(values) / step
    before, behind = step[:, :-1], step[:, 1:]
    inner = (slope[:, :-1] * behind + slope[:, 1:] * before) / (before + behind)
    return np.concatenate((slope[:, :1], inner, slope[:, -1:]), axis=1)


def _interpolate(
    values: FloatArray,
    slopes: FloatArray,
    place: NDArray[np.intp],
    step: FloatArray,
    phase: FloatArray,
) -> FloatArray:
    """Return cubic Hermite interpolation; `place` counts through all pulses."""
    values, slopes = values.ravel(), slopes.ravel()
    start = values[place]
    change = values[place + 1] - start
    first, second = slopes[place] * step - change, change - slopes[place + 1] * step
    return np.asarray(
        start + phase * (change + (1.0 - phase) * ((1.0 - phase) * first + phase * second))
    )


def find_places(forms: Iterable[LossForm]) -> NDArray[np.intp]:
    """Return the number of each form, for `compute_pulses`."""
    return np.array([FORMS.index(form) for form in forms])


def compute_pulses(
    exponent: FloatArray, loss: FloatArray, pull: FloatArray, forms: NDArray[np.intp]
) -> ScaledPulses:
    """Compute the pulses of contacts from touch to separation.

    Parameters
    ----------
    exponent, loss, pull : ndarray, shape (pulses,)
        n and both losses, see `find_losses`, within `EXPONENTS` and `LOSSES` [-].
    forms : ndarray, shape (pulses,)
        Number of the form of each, see `find_places`.
    """
    tables, patterns = _tabulate()
    found = np.empty((exponent.size, 4, len(patterns)))
    most = np.max(DEGREES, axis=0).tolist()
    axes = [
        _compute_polynomials(values, limits, degree)
        for values, limits, degree in zip(
            (loss, pull, exponent), (LOSSES, LOSSES, EXPONENTS), most, strict=True
        )
    ]
    for form in set(forms.tolist()):
        rows = np.flatnonzero(forms == form)
        degrees, coefficients = tables[form]
        # Of each pulse the terms, and their derivatives along the three axes.
        terms = np.ones(1)
        for axis, (polynomials, degree) in enumerate(zip(axes, degrees, strict=True), start=1):
            is_slope = (np.arange(4) == axis).astype(np.intp)
            terms = terms * polynomials[rows].take(degree, axis=-1)[:, is_slope]
        found[rows] = terms @ coefficients
    nodes = (found @ patterns).reshape(-1, 4, 3, NODES)
    losses = find_losses(exponent, loss, pull, forms)
    time, momentum, force = nodes[:, 0].swapaxes(0, 1)
    return ScaledPulses(exponent, losses, time, momentum, force, nodes[:, 1:])


def _compute_polynomials(
    value: FloatArray, limits: tuple[float, float], degree: int
) -> FloatArray:
    """Return Chebyshev's polynomials between limits, and derivatives, (pulses, 2, degree + 1)."""
    least, most = limits
    point = np.clip((2.0 * value - least - most) / (most - least), -1.0 + 1e-12, 1.0 - 1e-12)
    angle, numbers = np.arccos(point)[:, np.newaxis], np.arange(degree + 1)
    slopes = 2.0 / (most - least) * numbers * np.sin(numbers * angle) / np.sin(angle)
    return np.stack((np.cos(numbers * angle), slopes), axis=1)
