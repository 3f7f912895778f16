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

    @property
    def is_plate(self) -> bool:
        """Whether the force is k δⁿ alone: what is lost goes into waves."""
        return self is LossForm.PLATE

    def find_power(self, exponent: FloatArray) -> FloatArray:
        """Return m of the term δᵐ δ' that takes energy from the motion."""
        powers = {LossForm.ROOT: 0.5, LossForm.FOURTH_ROOT: 0.25, LossForm.DASHPOT: 0.0}
        if self.is_plate:
            # Of δ'' = -F / m - F' / Z.
            return exponent - 1.0
        return np.full_like(exponent, powers[self]) if self in powers else exponent


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

SMALLEST_COSINE = 1e-6
"""Below it rounding is more than what is left out [-]."""
_PHASE = np.linspace(0.0, 1.0, LIMITS.nodes)


def _find_angle(phase: FloatArray | float) -> FloatArray:
    """Return the angle, from 0 at touch to pi at x = 0, crowded at both ends."""
    return np.asarray(math.pi * phase**3 * (10.0 - 15.0 * phase + 6.0 * phase**2))


def _find_motion(
    angle: FloatArray, log_radius: FloatArray, exponent: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return x and x' from the energy left, r^2 / 2 = x'^2 / 2 + x^(n+1) / (n+1)."""
    power = exponent + 1.0
    sine, cosine = np.sin(angle), np.cos(angle)
    x = (power / 2.0 * np.exp(2.0 * log_radius)) ** (1.0 / power) * np.maximum(sine, 0.0)
    left = -np.expm1(power * np.log(np.maximum(sine, 1e-300)))
    return x, np.exp(log_radius) * np.sign(cosine) * np.sqrt(left)


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


@lru_cache(maxsize=len(LossForm))
def _tabulate(form: LossForm) -> FloatArray:
    """Return Chebyshev's coefficients of ln r and time, shape (degrees, degrees, 2 nodes)."""
    degrees = (LIMITS.exponent_degree, LIMITS.loss_degree)
    points = [chebyshev.chebpts1(degree + 1) for degree in degrees]
    grid = [part.ravel() for part in np.meshgrid(*points, indexing="ij")]
    exponent = _stretch(grid[0], LIMITS.exponents)
    loss = _stretch(grid[1], LOSSES[form]) * (exponent if form.is_plate else 1.0)
    power = form.find_power(exponent)
    state = np.zeros((2, exponent.size))
    found = [state]
    step = 1.0 / ((LIMITS.nodes - 1) * LIMITS.substeps)

    def differ(phase: float, state: FloatArray) -> FloatArray:
        return _differentiate(phase, state[0], exponent, power, loss)

    for count in range((LIMITS.nodes - 1) * LIMITS.substeps):
        phase = count * step
        first = differ(phase, state)
        second = differ(phase + step / 2.0, state + step / 2.0 * first)
        third = differ(phase + step / 2.0, state + step / 2.0 * second)
        fourth = differ(phase + step, state + step * third)
        state = state + step / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
        if (count + 1) % LIMITS.substeps == 0:
            found.append(state)
    values = np.stack(found, axis=-1).transpose(1, 0, 2).reshape(*(d + 1 for d in degrees), -1)
    into = [
        np.linalg.inv(chebyshev.chebvander(part, degree))
        for part, degree in zip(points, degrees, strict=True)
    ]
    coefficients = np.einsum("ai,bj,ijk->abk", *into, values)
    return make_read_only(np.ascontiguousarray(coefficients.reshape(-1, values.shape[-1])))


def _stretch(point: FloatArray, limits: tuple[float, float]) -> FloatArray:
    return np.asarray((limits[0] + limits[1] + point * (limits[1] - limits[0])) / 2.0)


def _shrink(value: FloatArray, limits: tuple[float, float]) -> FloatArray:
    return np.asarray((2.0 * value - limits[0] - limits[1]) / (limits[1] - limits[0]))


@dataclass(frozen=True)
class ScaledPulses:
    """Pulses of one form, each in its own scaled units: time in T, x in v T, speed in v.

    Arrays of shape (pulses, nodes) reach from first touch to x = 0. The contact ends where the
    force comes back to zero: bodies that do not stick do not pull at each other.
    """

    form: LossForm
    exponent: FloatArray  # n [-], shape (pulses, 1)
    loss: FloatArray  # B [-], shape (pulses, 1)
    time: FloatArray
    compression: FloatArray
    speed: FloatArray

    @cached_property
    def _end(self) -> tuple[FloatArray, FloatArray]:
        """Time and speed where the contact ends, shape (pulses,)."""
        if self.form in (LossForm.PROPORTIONAL, LossForm.PLATE):
            return self.time[:, -1], self.speed[:, -1]
        rows, top = np.arange(len(self.time)), LIMITS.nodes // 2
        pulls = self._find_pull(self.compression, self.speed)[:, top:] < 0.0
        last = top + np.where(pulls.any(axis=1), np.argmax(pulls, axis=1), pulls.shape[1] - 1)
        ends = self.time[rows, last - 1, None], self.time[rows, last, None]
        fine = ends[0] + np.linspace(0.0, 1.0, LIMITS.nodes) * (ends[1] - ends[0])
        x, v = self._interpolate(fine)
        pull = self._find_pull(x, v)
        found = [
            [np.interp(0.0, -row, values) for row, values in zip(pull, wanted, strict=True)]
            for wanted in (fine, v)
        ]
        return np.array(found[0]), np.array(found[1])

    def _find_pull(self, x: FloatArray, v: FloatArray) -> FloatArray:
        """Return the force over xᵐ, which is nearly straight where it comes to zero."""
        return np.asarray(x ** (self.exponent - self._power) + self.loss * v)

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
        fine = np.linspace(0.0, 1.0, PEAK_POINTS) * self.duration[:, None]
        return np.asarray(self.compute_force(fine).max(axis=1))

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
        x, v = self._interpolate(np.clip(time, 0.0, self.duration[:, None]))
        passed = 1.0 - v
        return passed - self.loss * x**self.exponent if self.form.is_plate else passed

    def _find_force(self, x: FloatArray, v: FloatArray) -> FloatArray:
        if self.form.is_plate:
            return np.asarray(x**self.exponent)
        return np.asarray(x**self.exponent + self.loss * x**self._power * v)

    @property
    def _power(self) -> FloatArray:
        return self.form.find_power(self.exponent)

    def _interpolate(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return x and x' by cubic polynomials between the nodes, from their known slopes."""
        places = [
            nodes[1:-1].searchsorted(row, side="right")
            for nodes, row in zip(self.time, time, strict=True)
        ]
        place = np.stack(places) + LIMITS.nodes * np.arange(len(places))[:, None]
        nodes = self.time.ravel()
        start = nodes[place]
        step = nodes[place + 1] - start
        phase = np.clip((time - start) / step, 0.0, 1.0)
        x = _interpolate(self.compression, self.speed, place, step, phase)
        return np.maximum(x, 1e-30), _interpolate(
            self.speed, self._deceleration, place, step, phase
        )

    @cached_property
    def _deceleration(self) -> FloatArray:
        x = np.maximum(self.compression, 1e-30)
        loss = self.loss * (self.exponent if self.form.is_plate else 1.0)
        return np.asarray(-(x**self.exponent) - loss * x**self._power * self.speed)


PEAK_POINTS = 2001
"""In a pulse, to read its peak [-], our choice: good to 1e-6."""


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


def compute_pulses(
    exponent: FloatArray, loss: FloatArray, form: LossForm = LossForm.PROPORTIONAL
) -> ScaledPulses:
    """Compute pulses x'' = -(xⁿ + B xᵐ x') of one form from touch to separation.

    Parameters
    ----------
    exponent, loss : ndarray, shape (pulses,)
        n and B [-], within `LIMITS.exponents` and `LOSSES`.
    """
    by_exponent = chebyshev.chebvander(_shrink(exponent, LIMITS.exponents), LIMITS.exponent_degree)
    by_loss = chebyshev.chebvander(_shrink(loss, LOSSES[form]), LIMITS.loss_degree)
    weights = (by_exponent[:, :, None] * by_loss[:, None, :]).reshape(exponent.size, -1)
    log_radius, time = np.split(weights @ _tabulate(form), 2, axis=1)
    exponent, loss = exponent[:, None], loss[:, None]
    x, speed = _find_motion(_find_angle(_PHASE), log_radius, exponent)
    return ScaledPulses(form, exponent, loss, time, x, speed)
