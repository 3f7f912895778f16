"""A second contact in the record of a hit.

It is a contact like the first: it starts from the baseline, goes to one side, and lasts as long
or longer. Ringing of one contact swings to both sides, or is much shorter.
"""

import math
from dataclasses import dataclass
from enum import Enum, auto

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
SWING_REACH = 1.5
"""How far from a bump that is looked for, in contact times [-], our choice: half a period of what
comes again after one contact time and more, as any second contact."""
SHORTEST_SECOND_PULSE = 0.5
"""Width of a second contact over that of the first [-], our choice: a softer hit lasts longer, if
anything (Hertz: with the speed to the power of -1/5)."""


NOISE_MARGIN = 6.0
"""Least height of a bump in standard deviations of the trace's noise [-], our choice: noise alone
reaches it in one record of 10 000."""
WANDER = 0.1
"""Typical deviation of the rest of the record, over a bump's height [-], from which on the zero
wanders and the bump may be part of that, our choice: beside a contact there is noise alone."""
SPREAD_OF_MEDIAN = 1.4826
"""Standard deviation over median absolute deviation of normal noise [-]."""


class Kind(Enum):
    """What a bump beside the largest pulse is."""

    CONTACT = auto()
    RINGING = auto()
    WANDER = auto()


@dataclass(frozen=True)
class SecondPulse:
    """A bump in the record of a hit, beside its pulse.

    Attributes
    ----------
    height : float
        Over the height of the largest pulse [-].
    delay : float
        Middle to middle, in points; negative: it comes before the largest pulse.
    kind : Kind
        A contact; or what it cannot be told from.
    """

    height: float
    delay: float
    kind: Kind = Kind.CONTACT


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


def find_second_pulse(
    trace: FloatArray,
    pulse: PulseWidth,
    level: float,
    noise: float = 0.0,
    window: float = math.inf,
) -> SecondPulse | None:
    """Find the largest bump beside the largest of all: a contact first, then what may be one.

    Where ringing reaches half the height of a second contact, or the zero wanders by a tenth of
    it, the two cannot be told apart. A pulse that the record cuts off counts as far as it goes.

    Parameters
    ----------
    trace : ndarray, shape (n,)
        Filtered hammer trace, baseline zero.
    level : float
        Least height that counts, part of the largest pulse [-].
    noise : float
        Standard deviation of the trace's noise [unit of the trace].
    window : float
        Largest distance of two contacts that counts, middle to middle [points].
    """
    upright = trace if pulse.peak > 0 else -trace
    least = max(LEVEL_MARGIN * level * abs(pulse.peak), NOISE_MARGIN * noise)
    duration = estimate_duration(pulse)
    apart = DELAY_MARGIN * SECOND_PULSE_DELAY * duration
    # Around the middle of a bump the trace is above half the bump's height.
    before, after = (
        upright[: int(max(pulse.middle - apart, 0.0))],
        upright[math.ceil(pulse.middle + apart) :],
    )
    if max(before.max(initial=0.0), after.max(initial=0.0)) < least / 2.0:
        return None
    peaks, _ = find_peaks(np.append(upright, -math.inf), height=least)
    if peaks.size <= 1:
        return None
    ended = np.append(upright, upright.min())
    peaks = peaks[peak_prominences(ended, peaks)[0] >= least]
    doubtful = None
    for index in sorted(map(int, peaks), key=lambda index: -upright[index]):
        if index == pulse.peak_index:
            continue
        rise, fall = _find_half_crossings(upright, index)
        is_cut = fall > upright.size - 1
        delay = (index if is_cut else (rise + fall) / 2.0) - pulse.middle
        is_apart = apart <= abs(delay) <= window
        shortest = 0.0 if is_cut else SHORTEST_SECOND_PULSE * pulse.half_amplitude_width
        if not is_apart or fall - rise < shortest:
            continue
        height = float(upright[index])
        kind = Kind.CONTACT
        if _find_swing(upright, pulse, index, duration) >= RINGING_SWING * height:
            kind = Kind.RINGING
        elif _find_wander(upright, pulse, rise, fall, duration) > WANDER * height:
            kind = Kind.WANDER
        found = SecondPulse(height / abs(pulse.peak), delay, kind)
        if kind is Kind.CONTACT:
            return found
        doubtful = doubtful or found
    return doubtful


def _find_half_crossings(upright: FloatArray, index: int) -> tuple[float, float]:
    """Return where a pulse crosses half its height; the trace's end where it does not [points].

    Behind the last point where it is cut off there.
    """
    half = 0.5 * float(upright[index])
    rise, fall = (find_crossing(upright, index, half, step) for step in (-1, 1))
    return (
        0.0 if math.isnan(rise) else rise,
        float(upright.size) if math.isnan(fall) else fall,
    )


def _find_swing(upright: FloatArray, pulse: PulseWidth, index: int, duration: float) -> float:
    """Return how far the trace swings to the other side near a bump."""
    reach = int(SWING_REACH * duration)
    low, high = max(index - reach, 0), index + reach + 1
    if index > pulse.peak_index:
        low = max(low, math.ceil(pulse.fall))
    else:
        high = min(high, math.floor(pulse.rise) + 1)
    return -float(np.min(upright[low:high]))


def _find_wander(
    upright: FloatArray, pulse: PulseWidth, rise: float, fall: float, duration: float
) -> float:
    """Return how far the trace typically is from zero behind the pulse and beside a bump."""
    tail = np.arange(upright.size) > pulse.fall + duration
    tail[max(int(rise - duration), 0) : int(fall + duration)] = False
    return SPREAD_OF_MEDIAN * float(np.median(np.abs(upright[tail]))) if tail.any() else 0.0
