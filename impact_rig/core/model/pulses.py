"""Contact force pulses of unit peak, and what reading them at half amplitude gives.

The paper calls the pulse a versed-sine (4), yet its equation (5) is the half period of an
undamped spring-mass pair, whose force is a half-sine. The factor F in tau_p = F * w50 tells them
apart.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import beta, betainc, betaincinv

from impact_rig.core.checks import check_between, check_positive
from impact_rig.core.signals.record import FloatArray

LARGEST_ASYMMETRY = 0.9
"""Either way [-], our choice: a twentieth of the duration is left for the shorter side."""


@dataclass(frozen=True)
class PulseShape:
    """A symmetric pulse of unit peak on the unit interval.

    Attributes
    ----------
    name : str
        As in the literature.
    value : callable
        Force at phase 0 to 1, relative to the peak.
    half_amplitude_width : float
        w50 over the duration [-].
    tenth_amplitude_width : float
        w10 over the duration [-].
    mean : float
        Impulse over peak and duration [-].
    """

    name: str
    value: Callable[[FloatArray], FloatArray]
    half_amplitude_width: float
    tenth_amplitude_width: float
    mean: float

    @property
    def pulse_factor(self) -> float:
        """F in tau_p = F * w50 [-]."""
        return 1.0 / self.half_amplitude_width

    @property
    def width_ratio(self) -> float:
        """w10 / w50 [-]."""
        return self.tenth_amplitude_width / self.half_amplitude_width


def _make_sine_power(name: str, power: float, mean: float) -> PulseShape:
    def find_width(level: float) -> float:
        return 1.0 - 2.0 / np.pi * float(np.arcsin(level ** (1.0 / power)))

    return PulseShape(
        name=name,
        value=lambda phase: np.sin(np.pi * phase) ** power,
        half_amplitude_width=find_width(0.5),
        tenth_amplitude_width=find_width(0.1),
        mean=mean,
    )


HALF_SINE = _make_sine_power("half-sine", 1.0, 2.0 / np.pi)
SINE_POWER_1_5 = _make_sine_power("sin^1.5", 1.5, float(beta(1.25, 0.5)) / np.pi)
"""A common stand-in for a Hertz contact."""
VERSED_SINE = _make_sine_power("versed-sine", 2.0, 0.5)


def _find_hertz_width(level: float) -> float:
    return 1.0 - float(betainc(0.4, 0.5, level ** (5.0 / 3.0)))


# The compression of a Hertz contact without loss obeys d'' = -(5/4) d^(3/2) in scaled units, so
# d'^2 = 1 - d^(5/2) for a unit largest compression, and the time to reach d is an incomplete
# beta function of w = d^(5/2); the force is w^(3/5).
HERTZ = PulseShape(
    name="Hertz",
    value=lambda phase: betaincinv(0.4, 0.5, 1.0 - np.abs(1.0 - 2.0 * phase)) ** 0.6,
    half_amplitude_width=_find_hertz_width(0.5),
    tenth_amplitude_width=_find_hertz_width(0.1),
    mean=2.0 / float(beta(0.4, 0.5)),
)

PULSE_SHAPES = (VERSED_SINE, HALF_SINE, SINE_POWER_1_5, HERTZ)


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
    check_positive("pulse duration", duration, "s")
    check_between("asymmetry", asymmetry, -LARGEST_ASYMMETRY, LARGEST_ASYMMETRY)
    rise = duration * (1.0 + asymmetry) / 2.0
    phase = np.where(
        time < rise,
        0.5 * time / rise,
        1.0 - 0.5 * (duration - time) / (duration - rise),
    )
    inside = (time >= 0.0) & (time <= duration)
    return np.where(inside, shape.value(np.clip(phase, 0.0, 1.0)), 0.0)
