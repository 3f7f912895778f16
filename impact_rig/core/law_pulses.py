"""The pulses of contact laws F = k δⁿ + c δᵐ δ', as tables of the scaled equation."""

import math
from dataclasses import dataclass
from enum import Enum
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from impact_rig.core.records import FloatArray, make_read_only


class LossForm(Enum):
    """How a contact loses energy, by the term beside k δⁿ."""

    PROPORTIONAL = "δⁿ δ'"  # Hunt and Crossley 1975
    ROOT = "√δ δ'"  # Kuwabara and Kono 1987
    FOURTH_ROOT = "δ^¼ δ'"  # Tsuji, Tanaka and Ishida 1992
    DASHPOT = "δ'"  # Kelvin and Voigt
    PLATE = "waves in a plate"  # Zener 1941: the plate yields at the speed F / Z


@dataclass(frozen=True)
class Limits:
    """Of the tables."""

    exponents: tuple[float, float] = (0.75, 3.25)  # n [-] our choice: a yielding to a slow contact
    nodes: int = 65  # of a pulse [-] our choice: the force is good to 1e-5 of its peak
    substeps: int = 2  # of Runge-Kutta's method between two nodes [-] our choice: good to 1e-7
    exponent_degree: int = 11  # of Chebyshev's polynomials [-] our choice: good to 1e-6
    loss_degree: int = 15  # the same in the loss


LIMITS = Limits()
LOSSES = {
    LossForm.PROPORTIONAL: (-0.3, 3.0),
    LossForm.ROOT: (-0.2, 0.9),
    LossForm.FOURTH_ROOT: (-0.2, 0.7),
    LossForm.DASHPOT: (-0.2, 0.55),
    LossForm.PLATE: (-0.2, 0.9),
}
"""B of each form [-]: from e above 1, which only noise can seem to have, to e of about 0.4."""
POWERS = {
    LossForm.PROPORTIONAL: (1.0, 0.0),
    LossForm.ROOT: (0.0, 0.5),
    LossForm.FOURTH_ROOT: (0.0, 0.25),
    LossForm.DASHPOT: (0.0, 0.0),
    LossForm.PLATE: (1.0, -1.0),
}
"""m = p n + q of each form, as (p, q) [-]; of the plate by δ'' = -F / m - F' / Z."""

SMALLEST_COSINE = 1e-6
"""Below it rounding is more than what is left out [-]."""


def _find_angle(phase: FloatArray | float) -> FloatArray:
    """Return the angle, from 0 at touch to pi at x = 0, crowded at both ends."""
    return np.asarray(math.pi * phase**3 * (10.0 - 15.0 * phase + 6.0 * phase**2))


_ANGLE = _find_angle(np.linspace(0.0, 1.0, LIMITS.nodes))


def _find_motion(
    angle: FloatArray, log_radius: FloatArray, exponent: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return x and x' from the energy left, r^2 / 2 = x'^2 / 2 + x^(n+1) / (n+1)."""
    power = exponent + 1.0
    sine, cosine = np.sin(angle), np.cos(angle)
    x = (power / 2.0 * np.exp(2.0 * log_radius)) ** (1.0 / power) * np.maximum(sine, 0.0)
    left = -np.expm1(power * np.log(np.maximum(sine, 1e-300)))
    return np.maximum(x, 1e-30), np.exp(log_radius) * np.sign(cosine) * np.sqrt(left)


def _differentiate(
    phase: float, log_radius: FloatArray, exponent: FloatArray, power: FloatArray, loss: FloatArray
) -> FloatArray:
    """Return the derivatives of ln r and of time in the phase."""
    angle = float(_find_angle(phase))
    sine, cosine = max(math.sin(angle), 0.0), math.cos(angle)
    half = (exponent + 1.0) / 2.0
    with np.errstate(divide="ignore", invalid="ignore"):
        bend = np.sqrt(-np.expm1(2.0 * half * np.log(sine)) / cosine**2)
    # At the top, where x' comes to zero.
    bend = bend if abs(cosine) > SMALLEST_COSINE else np.sqrt(half)
    reach = (half * np.exp(2.0 * log_radius)) ** (0.5 / half)
    damping = loss * reach**power
    rate = np.sqrt(half) * reach ** (half - 1.0) + damping * sine ** (power + 1.0) * cosine * bend
    slope = math.pi * 30.0 * (phase * (1.0 - phase)) ** 2
    time = slope * half / bend / rate
    lost = damping * sine**power * (cosine * bend) ** 2 if sine else np.zeros_like(half)
    return np.stack((-lost * time, time))


@lru_cache(maxsize=1)
def _tabulate() -> FloatArray:
    """Return Chebyshev's coefficients of ln r and time, shape (forms, degrees, 2 nodes)."""
    degrees = (LIMITS.exponent_degree, LIMITS.loss_degree)
    points = [chebyshev.chebpts1(degree + 1) for degree in degrees]
    exponents = _stretch(points[0], LIMITS.exponents)
    grids = [
        np.meshgrid(exponents, _stretch(points[1], LOSSES[form]), indexing="ij")
        for form in LossForm
    ]
    exponent, loss = np.array(grids).transpose(1, 0, 2, 3)
    share, constant = np.array([POWERS[form] for form in LossForm]).T[..., None, None]
    power = share * exponent + constant
    damping = np.where(constant < 0.0, exponent * loss, loss)
    state = np.zeros((2, *exponent.shape))
    found = [state]
    step = 1.0 / ((LIMITS.nodes - 1) * LIMITS.substeps)

    def differ(phase: float, state: FloatArray) -> FloatArray:
        return _differentiate(phase, state[0], exponent, power, damping)

    for count in range((LIMITS.nodes - 1) * LIMITS.substeps):
        phase = count * step
        first = differ(phase, state)
        second = differ(phase + step / 2.0, state + step / 2.0 * first)
        third = differ(phase + step / 2.0, state + step / 2.0 * second)
        fourth = differ(phase + step, state + step * third)
        state = state + step / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
        if (count + 1) % LIMITS.substeps == 0:
            found.append(state)
    # Of each form, n and B: ln r at all nodes, and time at all nodes.
    values = np.stack(found).transpose(2, 3, 4, 1, 0).reshape(*exponent.shape, -1)
    into = [
        np.linalg.inv(chebyshev.chebvander(part, degree))
        for part, degree in zip(points, degrees, strict=True)
    ]
    coefficients = np.einsum("ai,bj,fijk->fabk", *into, values)
    return make_read_only(
        np.ascontiguousarray(coefficients.reshape(len(LossForm), -1, 2 * LIMITS.nodes))
    )


@lru_cache(maxsize=8)
def _select(forms: tuple[LossForm, ...]) -> tuple[FloatArray, FloatArray]:
    """Return the tables, and p, q, least and largest B of each form, shape (4, forms, 1)."""
    numbers = np.array([(*POWERS[form], *LOSSES[form]) for form in forms]).T[..., None]
    tables = _tabulate()[[list(LossForm).index(form) for form in forms]]
    return make_read_only(tables), make_read_only(numbers)


def _stretch(point: FloatArray, limits: tuple[float, float]) -> FloatArray:
    return np.asarray((limits[0] + limits[1] + point * (limits[1] - limits[0])) / 2.0)


FINE = np.linspace(0.0, 1.0, 65)
"""Where a crossing or a peak between two nodes is looked for."""


@dataclass(frozen=True)
class ScaledPulses:
    """Pulses x'' = -(xⁿ + B xᵐ x'), each in its own scaled units: time in T, x in v T, speed in v.

    Arrays of shape (pulses, nodes) reach from first touch to x = 0. The contact ends where the
    force comes back to zero: bodies that do not stick do not pull at each other.
    """

    exponent: FloatArray  # n [-], shape (pulses, 1)
    power: FloatArray  # m [-], the same
    felt: FloatArray  # B [-] that is force, the same
    yielding: FloatArray  # B [-] that is motion of a plate, the same; one of both is zero
    time: FloatArray
    compression: FloatArray
    speed: FloatArray

    @cached_property
    def _end(self) -> tuple[FloatArray, FloatArray]:
        """Time and speed where the contact ends, shape (pulses,)."""
        rows, top = np.arange(len(self.time)), LIMITS.nodes // 2
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
        return np.asarray(x ** (self.exponent - self.power) + self.felt * speed)

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
        return np.asarray(self.compression[:, LIMITS.nodes // 2])

    def compute_peak_force(self) -> FloatArray:
        """Return the largest force, shape (pulses,)."""
        rows = np.arange(len(self.time))
        top = np.argmax(self._find_force(self.compression, self.speed), axis=1)
        start = self.time[rows, np.maximum(top - 1, 0), None]
        stop = self.time[rows, np.minimum(top + 1, LIMITS.nodes - 1), None]
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
        return np.asarray(x**self.exponent + self.felt * x**self.power * speed)

    def _interpolate(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return x and x' by cubic polynomials between the nodes, from their known slopes."""
        place = self._place(time)
        x = np.maximum(_interpolate(self.compression, self.speed, *place), 1e-30)
        return x, _interpolate(self.speed, self._deceleration, *place)

    def _place(self, time: FloatArray) -> tuple[NDArray[np.intp], FloatArray, FloatArray]:
        """Return the node before each time, the step behind it, and what part of it has passed."""
        places = [
            nodes[1:-1].searchsorted(row, side="right") + LIMITS.nodes * number
            for number, (nodes, row) in enumerate(zip(self.time, time, strict=True))
        ]
        place = np.stack(places)
        nodes = self.time.ravel()
        start = nodes[place]
        step = nodes[place + 1] - start
        return place, step, np.minimum(np.maximum((time - start) / step, 0.0), 1.0)

    @cached_property
    def _deceleration(self) -> FloatArray:
        x = self.compression
        loss = self.felt + self.exponent * self.yielding
        return np.asarray(-(x**self.exponent) - loss * x**self.power * self.speed)


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


def compute_pulses(exponent: FloatArray, loss: FloatArray, *forms: LossForm) -> ScaledPulses:
    """Compute the pulses of forms of loss from touch to separation.

    Parameters
    ----------
    exponent, loss : ndarray, shape (pulses,)
        n and B [-], within `LIMITS.exponents` and `LOSSES`; as many of each form, in their order.
    """
    tables, (share, constant, least, most) = _select(forms)
    exponents, losses = exponent.reshape(len(forms), -1), loss.reshape(len(forms), -1)
    by_exponent = _compute_polynomials(exponents, *LIMITS.exponents, LIMITS.exponent_degree)
    by_loss = _compute_polynomials(losses, least, most, LIMITS.loss_degree)
    weights = (by_exponent[..., :, None] * by_loss[..., None, :]).reshape(*losses.shape, -1)
    found = (weights @ tables).reshape(exponent.size, -1)
    log_radius, time = found[:, : LIMITS.nodes], found[:, LIMITS.nodes :]
    x, speed = _find_motion(_ANGLE, log_radius, exponent[:, None])
    # A plate's loss is in its own motion, and not in the force.
    motion = np.where(constant < 0.0, losses, 0.0)
    return ScaledPulses(
        exponent=exponent[:, None],
        power=(share * exponents + constant).reshape(-1, 1),
        felt=(losses - motion).reshape(-1, 1),
        yielding=motion.reshape(-1, 1),
        time=time,
        compression=x,
        speed=speed,
    )


def _compute_polynomials(
    value: FloatArray, least: FloatArray | float, most: FloatArray | float, degree: int
) -> FloatArray:
    """Return Chebyshev's polynomials of values between limits, shape (..., degree + 1)."""
    point = np.minimum(np.maximum((2.0 * value - least - most) / (most - least), -1.0), 1.0)
    return np.asarray(np.cos(np.arange(degree + 1) * np.arccos(point)[..., None]))
