"""Pulses of the contact law F = k delta^n (1 + alpha delta'), of Hunt and Crossley (1975).

n = 3/2 is Hertz, n = 1 a linear spring; alpha takes energy out. Two bodies that are free along
the line of impact meet at speed v: m_eq delta'' = -F. With T = (m_eq / (k v^(n-1)))^(1/(n+1)),
delta = v T x and A = alpha v this is x'' = -x^n (1 + A x'), x(0) = 0, x'(0) = 1: a family of two
numbers. Nothing has to be integrated step by step: with u = A x' and
y(u) = sign(u) sqrt(2 (u - ln(1 + u))) the energy gives

    x^(n+1) = (n + 1) (y(A)^2 - y(u)^2) / (2 A^2),

so that x and x' follow from each other, the rebound has y(-A e) = -y(A) whatever n is, and time is
one integral of a smooth function.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from impact_rig.core.signals.record import FloatArray, make_read_only

NODES = 65
"""Points of a pulse [-], our choice: the force between them is good to 1e-6 of the peak."""
SMALLEST_DAMPING, LARGEST_DAMPING = -0.5, 20.0
"""Of A [-], our choice: restitution from 1.66, which only noise can seem to have, down to 0.05."""
SMALLEST_EXPONENT, LARGEST_EXPONENT = 0.5, 4.0
"""Of n [-], our choice: a spring that yields, n < 1, to a contact that comes to bear slowly."""
SERIES_BELOW = 0.01
"""|u| below which y(u)/u comes from its series [-], our choice: the closed form loses digits."""
SPEED_NODES = 20_001
"""Points of the table of u(y)/y [-], our choice: good to 1e-8."""

_ANGLE = np.linspace(0.0, math.pi, NODES)
_COSINE = np.cos(_ANGLE)
_COSINE[NODES // 2] = 0.0
# ln(sin), at both ends of what is as good as zero.
_LOG_SINE = np.log(np.maximum(np.sin(_ANGLE), 1e-300))
_LOG_SINE[[0, -1]] = -690.0
_INTEGRATION = make_read_only(
    np.ascontiguousarray(CubicSpline(_ANGLE, np.eye(NODES)).antiderivative()(_ANGLE))
)
"""Integrals from the first node to each, of what is given at the nodes."""


def _compute_energy_root(u: FloatArray) -> FloatArray:
    """Return y(u)/u, 1 at u = 0."""
    near = np.abs(u) < SERIES_BELOW
    if not near.any():
        return np.asarray(np.sqrt(2.0 * (u - np.log1p(u)) / u**2))
    series = 1 - u * (2 / 3 - u * (1 / 2 - u * (2 / 5 - u * (1 / 3 - u * (2 / 7)))))
    far = np.where(near, 1.0, u)
    return np.sqrt(np.where(near, series, 2.0 * (far - np.log1p(far)) / far**2))


def _tabulate_speed() -> tuple[FloatArray, FloatArray]:
    # Evenly in ln(1 + u), which crowds the points where u nears -1, a body that hardly rebounds.
    u = np.expm1(np.linspace(-LARGEST_DAMPING, math.log1p(LARGEST_DAMPING), SPEED_NODES))
    ratio = _compute_energy_root(u)
    return u * ratio, 1.0 / ratio


_ENERGY_ROOTS, _SPEED_RATIOS = _tabulate_speed()


@dataclass(frozen=True)
class ScaledPulses:
    """Pulses of the family, each in its own scaled units: time in T, x in v T, speed in v.

    Attributes
    ----------
    exponent, damping : ndarray, shape (pulses,)
        n and A [-].
    time, compression, speed : ndarray, shape (pulses, NODES)
        From first touch to separation.
    """

    exponent: FloatArray
    damping: FloatArray
    time: FloatArray
    compression: FloatArray
    speed: FloatArray

    @property
    def duration(self) -> FloatArray:
        """From first touch to separation, shape (pulses,)."""
        return np.asarray(self.time[:, -1])

    @property
    def restitution(self) -> FloatArray:
        """Speed of separation over impact speed e, shape (pulses,)."""
        return np.asarray(-self.speed[:, -1])

    @property
    def largest_compression(self) -> FloatArray:
        """Where the speed is zero, shape (pulses,)."""
        return np.asarray(self.compression[:, NODES // 2])

    def compute_peak_force(self) -> FloatArray:
        """Return the largest force, shape (pulses,), by a parabola through its three nodes."""
        force = self.compression ** self.exponent[:, None] * (
            1.0 + self.damping[:, None] * self.speed
        )
        rows = np.arange(force.shape[0])
        top = np.clip(np.argmax(force, axis=1), 1, NODES - 2)
        times, forces = (
            np.stack([values[rows, top + shift] for shift in (-1, 0, 1)])
            for values in (self.time, force)
        )
        left, right = times[0] - times[1], times[2] - times[1]
        down, up = forces[0] - forces[1], forces[2] - forces[1]
        curvature = (down / left - up / right) / (left - right)
        slope = down / left - curvature * left
        return np.asarray(forces[1] - slope**2 / (4.0 * curvature))

    def compute_force(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return force and its derivative in time of each pulse, zero outside it.

        Compression and speed are cubic between the nodes, from their known slopes; the force,
        whose foot has no such polynomial, follows from them.

        Parameters
        ----------
        time : ndarray, shape (n,)
            In T of each pulse.

        Returns
        -------
        force, slope : ndarray, shape (pulses, n)
        """
        exponent, damping = self.exponent[:, None], self.damping[:, None]
        place = np.stack([nodes[1:-1].searchsorted(time, side="right") for nodes in self.time])
        place += NODES * np.arange(len(place))[:, None]
        nodes = self.time.ravel()
        start = nodes[place]
        step = nodes[place + 1] - start
        phase = np.clip((time - start) / step, 0.0, 1.0)
        deceleration = self.compression**exponent * (1.0 + damping * self.speed)
        x = _interpolate(self.compression, self.speed, place, step, phase)
        v = _interpolate(self.speed, -deceleration, place, step, phase)
        inside = (time >= 0.0) & (time < self.time[:, -1:])
        x = np.maximum(x, 1e-30)
        elastic, factor = x**exponent, 1.0 + damping * v
        force = elastic * factor
        slope = elastic * (exponent * v * factor / x - damping * force)
        return np.where(inside, force, 0.0), np.where(inside, slope, 0.0)


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


def compute_pulses(exponent: FloatArray, damping: FloatArray) -> ScaledPulses:
    """Compute pulses of the family from touch to separation.

    Parameters
    ----------
    exponent, damping : ndarray, shape (pulses,)
        n and A = alpha v [-], within the limits above.
    """
    # x = x_max sin(angle): the time's derivative in the angle is smooth, foot and all.
    power = (exponent + 1.0)[:, None]
    root = _compute_energy_root(damping)[:, None]  # y(A) / A
    left = -np.expm1(power * _LOG_SINE)  # part of the energy that is kinetic
    with np.errstate(invalid="ignore"):
        ratio = np.sqrt(left / _COSINE**2)
    ratio[:, NODES // 2] = np.sqrt(power[:, 0] / 2.0)
    reach = root * ratio
    energy_root = reach * _COSINE  # y(u) / A
    per_root = np.interp(damping[:, None] * energy_root, _ENERGY_ROOTS, _SPEED_RATIOS)
    largest = (power * root**2 / 2.0) ** (1.0 / power)
    return ScaledPulses(
        exponent=exponent,
        damping=damping,
        time=(largest / (reach * per_root)) @ _INTEGRATION.T,
        compression=largest * np.exp(_LOG_SINE),
        speed=energy_root * per_root,
    )
