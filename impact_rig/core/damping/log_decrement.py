"""Damping by the logarithmic decrement of the mean trace, equations (7) and (8)."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks

from impact_rig.core.arithmetic import (
    Quantity,
    compute_hypotenuse,
    compute_square_root,
    get_value,
)
from impact_rig.core.checks import check_not_negative, check_positive
from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.hits.pulse_width import measure_pulse
from impact_rig.core.signals.record import FloatArray

PEAK_PROMINENCE = 5.0
"""How far U2 must stand out of the noise, in its standard deviations [-], our choice: the baseline
tells them within a sixth, and of some 5000 filtered points fewer than one in a hundred records
exceeds four."""


@dataclass(frozen=True)
class LogDecrement:
    """Two consecutive peaks of the same sign.

    Attributes
    ----------
    first_peak, second_peak : float
        U1 and U2 [unit of the trace].
    first_index, second_index : int
        Where they stand, in points.
    """

    first_peak: float
    second_peak: float
    first_index: int
    second_index: int

    @property
    def log_decrement(self) -> float:
        """Delta = ln(U1 / U2) [-], equation (7a)."""
        return math.log(self.first_peak / self.second_peak)


def estimate_log_decrement(trace: FloatArray, noise: float) -> LogDecrement:
    """Find U1, the largest peak, and U2, the next one of the same sign.

    U1 lies inside the contact, where the response is still forced, so this estimate is biased
    unless the body really decays freely from there: equation (7a) as published, with its bias.

    Parameters
    ----------
    trace : ndarray, shape (n,)
        Mean filtered acceleration, baseline zero, either polarity.
    noise : float
        Standard deviation of the trace's noise [unit of the trace].

    Returns
    -------
    LogDecrement

    Raises
    ------
    NotDeterminedError
        If no second peak stands out of the noise, or the second is no lower than the first.
    SignalError
        If the trace has no pulse.
    """
    pulse = measure_pulse(trace)
    upright = trace if pulse.peak > 0 else -trace
    first = pulse.peak_index
    tail_start = math.ceil(pulse.fall)
    tail = upright[tail_start:]
    needed = max(PEAK_PROMINENCE * noise, np.finfo(float).eps * abs(pulse.peak))
    candidates, _ = find_peaks(tail, height=needed, prominence=needed)
    if candidates.size == 0:
        raise NotDeterminedError(
            "no log decrement, since no second peak stands out of the noise"
            f" ({needed / abs(pulse.peak) * 100:.2g} % of the first)"
        )
    second = tail_start + int(candidates[np.argmax(tail[candidates])])
    if upright[second] >= abs(pulse.peak):
        raise NotDeterminedError(
            "log decrement: the second peak is as high as the first, so that nothing decays"
        )
    return LogDecrement(
        first_peak=abs(pulse.peak),
        second_peak=float(upright[second]),
        first_index=first,
        second_index=second,
    )


def estimate_damping_ratio(log_decrement: Quantity) -> Quantity:
    """Return zeta = Delta / sqrt(4 pi^2 + Delta^2) [-].

    Equation (7b) prints a minus under the root; the plus is the exact relation of a damped
    oscillator. Of a float or an uncertain number.
    """
    check_positive("log decrement", get_value(log_decrement), "")
    return log_decrement / compute_hypotenuse(2.0 * math.pi, log_decrement)


def compute_log_decrement(damping_ratio: float) -> float:
    """Return Delta = 2 pi zeta / sqrt(1 - zeta^2) [-] of an under-damped body."""
    check_not_negative("damping ratio", damping_ratio, "")
    if damping_ratio >= 1.0:
        raise NotDeterminedError(
            f"log decrement: a damping ratio of {damping_ratio:g} leaves no oscillation; it must"
            " be below 1"
        )
    return 2.0 * math.pi * damping_ratio / math.sqrt(1.0 - damping_ratio**2)


def estimate_damping_coefficient(
    damping_ratio: Quantity, stiffness: Quantity, mass: Quantity
) -> Quantity:
    """Return c = 2 zeta sqrt(k m) [N s/m], equation (8), from N/m and kg.

    Of floats or of uncertain numbers.
    """
    check_not_negative("damping ratio", get_value(damping_ratio), "")
    check_positive("stiffness", get_value(stiffness), "N/m")
    check_positive("mass", get_value(mass), "kg")
    return 2.0 * damping_ratio * compute_square_root(stiffness * mass)


def estimate_damping_ratio_from_coefficient(
    damping_coefficient: Quantity, stiffness: Quantity, mass: Quantity
) -> Quantity:
    """Return zeta = c / (2 sqrt(k m)) [-], equation (8), from N s/m, N/m and kg.

    Of floats or of uncertain numbers.
    """
    check_not_negative("damping coefficient", get_value(damping_coefficient), "N s/m")
    check_positive("stiffness", get_value(stiffness), "N/m")
    check_positive("mass", get_value(mass), "kg")
    return damping_coefficient / (2.0 * compute_square_root(stiffness * mass))
