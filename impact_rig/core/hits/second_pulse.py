"""A second pulse beside the first, told from the ringing of one contact.

A second hit is a contact like the first: it starts from the baseline, goes to one side, and lasts
about as long. Ringing swings to both sides, or is much shorter.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks, peak_prominences

from impact_rig.core.hits.pulse_width import PulseWidth, find_crossing
from impact_rig.core.model.pulses import HALF_SINE, VERSED_SINE
from impact_rig.core.signals.record import FloatArray

LEVEL_MARGIN = 0.9
"""Where the second pulse is read, part of the level asked for [-], our choice: noise and what the
first contact leaves behind must not let a pulse of exactly that level through."""
SECOND_PULSE_DELAY = 1.2
"""Least distance of two contacts, in contact times [-], our choice: what follows sooner belongs
to the same contact."""
DELAY_MARGIN = 0.9
"""Where that distance is read, part of it [-], our choice: the contact time is known within some
5 % by the shape of the pulse, and the middle of a small pulse within as much by its noise."""
RINGING_SWING = 0.5
"""How far ringing swings to the other side next to a bump, part of its height [-], our choice: a
lightly damped wave has nearly 1, a contact 0."""
SHORTEST_SECOND_PULSE = 0.5
"""Width of a second contact over that of the first [-], our choice: a softer hit lasts longer, if
anything (Hertz: with the speed to the power of -1/5)."""


@dataclass(frozen=True)
class SecondPulse:
    """Another contact in the record of a hit.

    Attributes
    ----------
    height : float
        Over the height of the largest pulse [-].
    delay : float
        Middle to middle, in points; negative: it comes before the largest pulse.
    """

    height: float
    delay: float


def estimate_duration(pulse: PulseWidth) -> float:
    """Estimate how long a pulse lasts [points], whatever its shape.

    The factor of the width at half amplitude goes from that of a half-sine to that of a
    versed-sine with the ratio of widths w10 / w50 [-]; for sin^1.5 and Hertz this is within 5 %.
    The shortest where the ratio is not known.
    """
    ratio = HALF_SINE.width_ratio if math.isnan(pulse.width_ratio) else pulse.width_ratio
    factor = np.interp(
        ratio,
        (HALF_SINE.width_ratio, VERSED_SINE.width_ratio),
        (HALF_SINE.pulse_factor, VERSED_SINE.pulse_factor),
    )
    return float(factor) * pulse.half_amplitude_width


def find_second_pulse(trace: FloatArray, pulse: PulseWidth, level: float) -> SecondPulse | None:
    """Find the largest pulse beside the largest of all that is a contact of its own.

    Where ringing reaches half the height of a second contact, the two cannot be told apart, and
    none is reported.

    Parameters
    ----------
    trace : ndarray, shape (n,)
        Filtered hammer trace, baseline zero.
    pulse : PulseWidth
        Its largest pulse.
    level : float
        Least height that counts, part of the largest pulse [-].
    """
    upright = trace if pulse.peak > 0 else -trace
    least = LEVEL_MARGIN * level * abs(pulse.peak)
    peaks, _ = find_peaks(upright, height=least)
    if peaks.size <= 1:
        return None
    peaks = peaks[peak_prominences(upright, peaks)[0] >= least]
    duration = estimate_duration(pulse)
    for index in sorted(map(int, peaks), key=lambda index: -upright[index]):
        if index == pulse.peak_index:
            continue
        rise, fall = _find_half_crossings(upright, index)
        delay = (rise + fall) / 2.0 - pulse.middle
        is_contact = (
            abs(delay) >= DELAY_MARGIN * SECOND_PULSE_DELAY * duration
            and fall - rise >= SHORTEST_SECOND_PULSE * pulse.half_amplitude_width
            and _find_swing(upright, pulse, index, duration) < RINGING_SWING * upright[index]
        )
        if is_contact:
            return SecondPulse(float(upright[index]) / abs(pulse.peak), delay)
    return None


def _find_half_crossings(upright: FloatArray, index: int) -> tuple[float, float]:
    """Return where a pulse crosses half its height; the trace's end where it does not [points]."""
    half = 0.5 * float(upright[index])
    rise, fall = (find_crossing(upright, index, half, step) for step in (-1, 1))
    return (
        0.0 if math.isnan(rise) else rise,
        upright.size - 1.0 if math.isnan(fall) else fall,
    )


def _find_swing(upright: FloatArray, pulse: PulseWidth, index: int, duration: float) -> float:
    """Return how far the trace swings to the other side within one contact time of a bump."""
    low, high = max(index - int(duration), 0), index + int(duration) + 1
    if index > pulse.peak_index:
        low = max(low, math.ceil(pulse.fall))
    else:
        high = min(high, math.floor(pulse.rise) + 1)
    return -float(np.min(upright[low:high]))
