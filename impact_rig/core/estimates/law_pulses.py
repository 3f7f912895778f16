"""The pulses of contact laws F = k δⁿ + c δᵐ δ', as tables of the scaled equation."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from impact_rig.core.given.records import FloatArray, make_read_only


class LossForm(Enum):
    """Forms of loss: the term beside k δⁿ."""

    PROPORTIONAL = "δⁿ δ'"  # Hunt and Crossley 1975
    # The others may stand beside it; all pull at the end of the contact but the plate's.
    LINEAR = "δ δ'"  # of no published law, but between the others
    ROOT = "√δ δ'"  # Kuwabara and Kono 1987
    FOURTH_ROOT = "δ^¼ δ'"  # Tsuji, Tanaka and Ishida 1992
    DASHPOT = "δ'"  # Kelvin and Voigt
    PLATE = "waves in a plate"  # Zener 1941: the plate yields at the speed F / Z


EXPONENTS = (0.75, 3.25)
"""Smallest and largest n of the tables [-], our choice: of a yielding and of a slow contact."""
LOSSES = (-0.1, 1.0)
"""The same of both losses, see `find_losses`: from e above 1 to 0.3 [-]."""
NODES = 65
"""Points of a pulse [-], our choice: the force is good to 1e-5 of its peak."""
DEGREES = (8, 14, 7)
"""Degrees of Chebyshev's polynomials in n and both losses [-], our choice: good to 1e-5."""
FORMS = tuple(LossForm)
PLATE = FORMS.index(LossForm.PLATE)
LARGEST = 4.0
"""B of the loss δⁿ δ' alone where e is 0.25 [-]."""
SECOND = np.array(
    [
        (0.0, 0.0, 0.0),
        (1.0, 3.0, 0.85),
        (0.5, 1.75, 0.5),
        (0.25, 1.25, 0.42),
        (0.0, 0.82, 0.34),
        (0.0, 0.0, 0.0),
    ]
)
"""m, B n^s and s of each form's other loss alone where e is about 0.3 [-]; rows by `FORMS`."""
LARGEST_YIELD = 0.8
"""The same of a plate by δ'' = -F / m - F' / Z [-]."""


def find_losses(
    exponent: FloatArray, loss: FloatArray, pull: FloatArray, forms: NDArray[np.intp]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return B of δⁿ δ', B of the other loss, and that of a plate's motion [-].

    Parameters
    ----------
    loss, pull : ndarray
        Of both losses, 0 to 1, where e is about 0.3: `loss` is a part of what `pull` leaves room
        for.
    """
    _, largest, slope = SECOND[forms].T
    is_plate = forms == PLATE
    proportional = np.where(is_plate, 0.0, LARGEST * loss * (1.0 - 0.85 * pull))
    return (
        proportional,
        largest * pull * exponent**-slope,
        np.where(is_plate, LARGEST_YIELD * loss, 0.0),
    )


SMALLEST_COSINE = 1e-6
"""Below it rounding is more than what is left out [-]."""


def _find_angle(phase: FloatArray | float) -> FloatArray:
    """Return the angle, from 0 at touch to pi at x = 0, crowded at both ends."""
    return np.asarray(math.pi * phase**3 * (10.0 - 15.0 * phase + 6.0 * phase**2))


_ANGLE = _find_angle(np.linspace(0.0, 1.0, NODES))


def _find_motion(
    angle: FloatArray, log_radius: FloatArray, exponent: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return x and x' from the energy left, r^2 / 2 = x'^2 / 2 + x^(n+1) / (n+1)."""
    power = exponent + 1.0
    sine, cosine = np.sin(angle), np.cos(angle)
    with np.errstate(invalid="ignore"):  # a search that leaves the family finds nothing there
        x = (power / 2.0 * np.exp(2.0 * log_radius)) ** (1.0 / power) * np.maximum(sine, 0.0)
        left = -np.expm1(power * np.log(np.maximum(sine, 1e-300)))
        return np.maximum(x, 1e-30), np.exp(log_radius) * np.sign(cosine) * np.sqrt(left)


def _differentiate(
    phase: float,
    log_radius: FloatArray,
    exponent: FloatArray,
    terms: Sequence[tuple[FloatArray, FloatArray]],
) -> FloatArray:
    """Return the derivatives of ln r and of time in the phase; losses by power and factor."""
    angle = float(_find_angle(phase))
    sine, cosine = max(math.sin(angle), 0.0), math.cos(angle)
    slope = math.pi * 30.0 * (phase * (1.0 - phase)) ** 2
    if not (slope and sine):
        return np.zeros((2, *log_radius.shape))
    half = (exponent + 1.0) / 2.0
    # At the top x' comes to zero.
    bend = np.sqrt(half)
    if abs(cosine) > SMALLEST_COSINE:
        bend = np.sqrt(-np.expm1(2.0 * half * math.log(sine)) / cosine**2)
    log_reach = (np.log(half) / 2.0 + log_radius) / half
    log_depth = log_reach + math.log(sine)
    loss = sum(factor * np.exp(power * log_depth) for power, factor in terms)
    rate = np.sqrt(half) * np.exp((half - 1.0) * log_reach) + loss * (sine * cosine * bend)
    time = slope * half / bend / rate
    return np.stack((-loss * (cosine * bend) ** 2 * time, time))


@lru_cache(maxsize=1)
def _tabulate() -> FloatArray:
    """Return Chebyshev's coefficients of ln r and time, shape (forms, degrees, 2 nodes)."""
    points = [chebyshev.chebpts1(degree + 1) for degree in DEGREES]
    axes = zip(points, (EXPONENTS, LOSSES, LOSSES), strict=True)
    stretched = [_stretch(point, limits) for point, limits in axes]
    grid = np.meshgrid(*stretched, indexing="ij")
    each, loss, pull = (np.tile(axis.ravel(), len(FORMS)) for axis in grid)
    form = np.repeat(np.arange(len(FORMS)), grid[0].size)
    shape = len(FORMS), points[0].size, -1
    proportional, other, motion = (
        factor.reshape(shape) for factor in find_losses(each, loss, pull, form)
    )
    exponent = stretched[0][:, np.newaxis]
    is_plate = (np.arange(len(FORMS)) == PLATE)[:, np.newaxis, np.newaxis]
    terms = [
        (exponent - is_plate, proportional + exponent * motion),
        (SECOND[:, :1, np.newaxis], other),
    ]
    state = np.zeros((2, *proportional.shape))
    found = [state]
    # Two steps of Runge-Kutta's method between two nodes: good to 1e-7.
    steps = 2 * (NODES - 1)
    step = 1.0 / steps
    for count in range(steps):
        phase, log_radius = count * step, state[0]
        first = _differentiate(phase, log_radius, exponent, terms)
        middle = phase + step / 2.0
        second = _differentiate(middle, log_radius + step / 2.0 * first[0], exponent, terms)
        third = _differentiate(middle, log_radius + step / 2.0 * second[0], exponent, terms)
        fourth = _differentiate(phase + step, log_radius + step * third[0], exponent, terms)
        state = state + step / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
        if count % 2:
            found.append(state)
    # Of each form, n and losses: ln r at all nodes, and time at all nodes.
    values = np.stack(found).reshape(NODES, 2, -1).transpose(2, 1, 0)
    values = values.reshape(len(FORMS), *(point.size for point in points), -1)
    for axis, (point, degree) in enumerate(zip(points, DEGREES, strict=True), start=1):
        into = np.linalg.inv(chebyshev.chebvander(point, degree))
        values = np.moveaxis(np.tensordot(into, values, (1, axis)), 0, axis)
    return make_read_only(np.ascontiguousarray(values.reshape(len(FORMS), -1, 2 * NODES)))


def _stretch(point: FloatArray, limits: tuple[float, float]) -> FloatArray:
    return np.asarray((limits[0] + limits[1] + point * (limits[1] - limits[0])) / 2.0)


FINE = np.linspace(0.0, 1.0, 65)
"""Where a crossing or a peak between two nodes is looked for."""


@dataclass(frozen=True)
class ScaledPulses:
    """Pulses x'' = -(xⁿ + B xⁿ x' + C xᵐ x'), in scaled units: time in T, x in v T.

    Arrays of shape (pulses, nodes) reach from first touch to x = 0. The contact ends where the
    force comes back to zero: bodies that do not stick do not pull at each other.
    """

    exponent: FloatArray  # n [-], shape (pulses, 1)
    power: FloatArray  # m [-], the same
    proportional: FloatArray  # B [-], the same
    pulling: FloatArray  # C [-], the same
    yielding: FloatArray  # loss that is motion of a plate [-], the same
    time: FloatArray
    compression: FloatArray
    speed: FloatArray

    @cached_property
    def _end(self) -> tuple[FloatArray, FloatArray]:
        """Time and speed where the contact ends, shape (pulses,)."""
        rows, top = np.arange(len(self.time)), NODES // 2
        pull = self._find_pull(self.compression, self.speed)
        if np.all(pull[:, top:] >= 0.0):
            return self.time[:, -1], self.speed[:, -1]
        last = top + _find_last(pull[:, top:])
        start, stop = self.time[rows, last - 1, None], self.time[rows, last, None]
        fine = start + FINE * (stop - start)
        x, speed = self._interpolate(fine)
        pull = self._find_pull(x, speed)
        last = _find_last(pull)
        before, after = pull[rows, last - 1], np.minimum(pull[rows, last], 0.0)
        part = before / (before - after)
        duration, slowest = (
            values[rows, last - 1] + part * (values[rows, last] - values[rows, last - 1])
            for values in (fine, speed)
        )
        return duration, slowest

    def _find_pull(self, x: FloatArray, speed: FloatArray) -> FloatArray:
        """Return the force over xᵐ, which is nearly straight where it comes to zero."""
        spring = x ** (self.exponent - self.power) * (1.0 + self.proportional * speed)
        return np.asarray(spring + self.pulling * speed)

    @property
    def duration(self) -> FloatArray:
        """From first touch to separation, shape (pulses,)."""
        return self._end[0]

    @property
    def restitution(self) -> FloatArray:
        """Speed of separation over impact speed e, shape (pulses,)."""
        return -self._end[1]

    @property
    def largest_compression(self) -> FloatArray:
        """Where the speed is zero, shape (pulses,)."""
        return np.asarray(self.compression[:, NODES // 2])

    @property
    def is_passive(self) -> NDArray[np.bool_]:
        """Whether both losses together take energy at every depth, shape (pulses,)."""
        x = self.compression[:, 1 : NODES // 2 + 1]
        loss = self.proportional * x**self.exponent + self.pulling * x**self.power
        return np.asarray(loss.min(axis=1) >= 0.0)

    def compute_peak_force(self) -> FloatArray:
        """Return the largest force, shape (pulses,)."""
        rows = np.arange(len(self.time))
        top = np.argmax(self._find_force(self.compression, self.speed), axis=1)
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
        force = self._find_force(*self._interpolate(time))
        inside = (time >= 0.0) & (time < self.duration[:, None])
        return np.where(inside, np.maximum(force, 0.0), 0.0)

    def compute_impulse(self, time: FloatArray) -> FloatArray:
        """Return the integral of the force up to each time, shape (pulses, n)."""
        time = np.broadcast_to(time, (len(self.time), time.shape[-1]))
        place = self._place(np.minimum(time, self.duration[:, None]))
        impulse = 1.0 - _interpolate(self.speed, self._deceleration, *place)
        if np.any(self.yielding):
            x = np.maximum(_interpolate(self.compression, self.speed, *place), 1e-30)
            impulse -= self.yielding * x**self.exponent
        return impulse

    def _find_force(self, x: FloatArray, speed: FloatArray) -> FloatArray:
        spring = x**self.exponent * (1.0 + self.proportional * speed)
        return np.asarray(spring + self.pulling * x**self.power * speed)

    def _interpolate(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return x and x' by cubic polynomials between the nodes, from their known slopes."""
        place = self._place(time)
        x = np.maximum(_interpolate(self.compression, self.speed, *place), 1e-30)
        return x, _interpolate(self.speed, self._deceleration, *place)

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

    @cached_property
    def _deceleration(self) -> FloatArray:
        x, speed = self.compression, self.speed
        # A plate yields by the rate of the force.
        yielding = self.exponent * self.yielding * x ** (self.exponent - 1.0) * speed
        return np.asarray(-self._find_force(x, speed) - yielding)


def _find_last(pull: FloatArray) -> NDArray[np.intp]:
    """Return the first place in each row where bodies pull, or else its end."""
    pulls = pull < 0.0
    pulls[:, -1] = True
    return np.asarray(np.argmax(pulls, axis=1))


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
    weights = _compute_polynomials(exponent, EXPONENTS, DEGREES[0])
    for part, degree in ((loss, DEGREES[1]), (pull, DEGREES[2])):
        more = _compute_polynomials(part, LOSSES, degree)
        weights = (weights[:, :, None] * more[:, None, :]).reshape(exponent.size, -1)
    found = np.empty((exponent.size, 2 * NODES))
    for form in set(forms.tolist()):
        rows = forms == form
        found[rows] = weights[rows] @ _tabulate()[form]
    log_radius, time = found[:, :NODES], found[:, NODES:]
    x, speed = _find_motion(_ANGLE, log_radius, exponent[:, None])
    proportional, pulling, yielding = find_losses(exponent, loss, pull, forms)
    return ScaledPulses(
        exponent=exponent[:, None],
        power=SECOND[forms, :1],
        proportional=proportional[:, None],
        pulling=pulling[:, None],
        yielding=yielding[:, None],
        time=time,
        compression=x,
        speed=speed,
    )


def _compute_polynomials(
    value: FloatArray, limits: tuple[float, float], degree: int
) -> FloatArray:
    """Return Chebyshev's polynomials of values between limits, shape (pulses, degree + 1)."""
    least, most = limits
    point = np.minimum(np.maximum((2.0 * value - least - most) / (most - least), -1.0), 1.0)
    return np.asarray(np.cos(np.arange(degree + 1) * np.arccos(point)[..., None]))
