"""The pulse shapes of the literature."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy

from impact_rig.core.given.errors import check_between, check_positive
from impact_rig.core.given.records import FloatArray

PULSE_NAME = "versed-sine"
"""Name of the shape of equation (4)."""
LARGEST_ASYMMETRY = 0.9
"""Either way [-], our choice: a twentieth of the duration is left for the shorter side."""


@dataclass(frozen=True)
class PulseShape:
    """A symmetric pulse of unit peak on the unit interval."""

    name: str
    # Force at phase 0 to 1 over the peak, and its derivative in the phase.
    differentiate: Callable[[FloatArray], tuple[FloatArray, FloatArray]]
    half_amplitude_width: float  # w50 over the duration

    @property
    def pulse_factor(self) -> float:
        """F in tau_p = F * w50 [-]."""
        return 1.0 / self.half_amplitude_width


def _make_sine_power(name: str, power: float) -> PulseShape:
    def differentiate(phase: FloatArray) -> tuple[FloatArray, FloatArray]:
        angle = np.pi * phase
        sine = np.sin(angle)
        return sine**power, power * np.pi * sine ** (power - 1.0) * np.cos(angle)

    return PulseShape(
        name=name,
        differentiate=differentiate,
        half_amplitude_width=1.0 - 2.0 / np.pi * float(np.arcsin(0.5 ** (1.0 / power))),
    )


HALF_SINE = _make_sine_power("half-sine", 1.0)
VERSED_SINE = _make_sine_power(PULSE_NAME, 2.0)


# The compression of a Hertz contact without loss obeys d'' = -(5/4) d^(3/2) in scaled units, so
# d'^2 = 1 - d^(5/2) for a unit largest compression, and the time to reach d is an incomplete
# beta function of d^(5/2); the force is d^(3/2). The inverse of that function is slow: it is
# tabulated once, with its slope, which is known.
HERTZ_DURATION = 2.9432751843247047  # in those units: 0.8 B(2/5, 1/2)


@cache
def _tabulate_compression() -> "scipy.interpolate.CubicHermiteSpline":
    # So many points are good to 1e-11 of the peak.
    phase = np.linspace(0.0, 0.5, 513)
    compression = scipy.special.betaincinv(0.4, 0.5, 2.0 * phase) ** 0.4
    speed = HERTZ_DURATION * np.sqrt(np.maximum(1.0 - compression**2.5, 0.0))
    return scipy.interpolate.CubicHermiteSpline(phase, compression, speed)


def _limit(values: FloatArray) -> FloatArray:
    """Return values between 0 and 1: `np.clip` takes longer than all else about a short pulse."""
    return np.asarray(np.minimum(np.maximum(values, 0.0), 1.0))


def _differentiate_hertz_force(phase: FloatArray) -> tuple[FloatArray, FloatArray]:
    compression = _limit(_tabulate_compression()(0.5 - np.abs(0.5 - phase)))
    force = compression**1.5
    speed = HERTZ_DURATION * np.sqrt(1.0 - force * compression)
    return force, np.sign(0.5 - phase) * 1.5 * np.sqrt(compression) * speed


HERTZ = PulseShape(
    name="Hertz",
    differentiate=_differentiate_hertz_force,
    half_amplitude_width=0.5493874475299448,  # 1 - I(2/5, 1/2) at 0.5^(5/3)
)

# sin^1.5 is a common stand-in for a Hertz contact.
PULSE_SHAPES = (VERSED_SINE, HALF_SINE, _make_sine_power("sin^1.5", 1.5), HERTZ)


def compute_pulse(
    time: FloatArray, duration: float, shape: PulseShape = VERSED_SINE, asymmetry: float = 0.0
) -> FloatArray:
    """Compute a pulse of unit peak that starts at t = 0.

    Parameters
    ----------
    time : ndarray, shape (n,)
        [s]
    duration : float
        tau_p [s].
    shape : PulseShape
        Of both halves.
    asymmetry : float
        The rise takes (1 + asymmetry) / 2 of the duration, the fall the rest [-]; the width at
        any level stays the same.

    Returns
    -------
    ndarray, shape (n,)
        Zero outside [0, duration].

    Raises
    ------
    ParameterError
        If the duration is not a positive number, or the asymmetry leaves no rise or no fall.
    """
    return differentiate_pulse(time, duration, shape, asymmetry)[0]


def differentiate_pulse(
    time: FloatArray, duration: float, shape: PulseShape = VERSED_SINE, asymmetry: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Compute a pulse as `compute_pulse` does, and its derivatives.

    Parameters and errors as there.

    Returns
    -------
    pulse : ndarray, shape (n,)
        Zero outside [0, duration].
    derivatives : ndarray, shape (3, n)
        In the pulse's start [1/s], in the duration [1/s] and in the asymmetry [-].
    """
    check_positive("pulse duration", duration, "s")
    check_between("asymmetry", asymmetry, -LARGEST_ASYMMETRY, LARGEST_ASYMMETRY)
    rise = duration * (1.0 + asymmetry) / 2.0
    # 0 to 1 with the peak at 1/2.
    phase = _limit(
        np.where(
            time < rise,
            0.5 * time / rise,
            1.0 - 0.5 * (duration - time) / (duration - rise),
        )
    )
    inside = (time >= 0.0) & (time <= duration)
    rising = 2.0 * phase < 1.0
    pulse, slope = shape.differentiate(phase)
    derivatives = np.empty((3, time.size))
    derivatives[0] = np.where(inside, slope, 0.0) * np.where(
        rising, -1.0 / (duration * (1.0 + asymmetry)), -1.0 / (duration * (1.0 - asymmetry))
    )
    derivatives[1] = derivatives[0] * (time / duration)
    derivatives[2] = derivatives[0] * (duration * np.where(rising, phase, 1.0 - phase))
    return np.where(inside, pulse, 0.0), derivatives
