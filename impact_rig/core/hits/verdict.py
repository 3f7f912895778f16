"""Every reason against a hit, named.

A second hit is a contact like the first: it starts from the baseline, goes to one side, and lasts
about as long. Ringing of one contact swings to both sides, or is much shorter.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.constants import g
from scipy.signal import find_peaks, peak_prominences

from impact_rig.core.hits.pulse_width import PulseWidth, find_crossing
from impact_rig.core.hits.reasons import Reason, Rejection
from impact_rig.core.model.pulses import HALF_SINE, VERSED_SINE
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.record import FloatArray, Record, Trace

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


RAIL_TOLERANCE = 2e-3
"""How near to full scale a point counts as at the rail, part of full scale [-], our choice: four
steps of 12 bits, room for an offset."""
RAIL_STEPS = 1.0
"""The same for the converter's steps [-]: of b bits the largest count is 2^(b-1) - 1."""
CORNER_STEP = 0.01
"""Where full scale is unknown: the least step into a flat top that makes it a clipped one, part
of the peak [-], our choice. A rounded top that merely repeats a value has none."""
DEAD_LEVEL = 0.005
"""Largest deviation of a channel that shows nothing, part of full scale [-], our choice: half of
the smallest signal worth a range."""
DEAD_NOISE = 6.0
"""The same in standard deviations of the channel's own pre-trigger noise [-], our choice: one
record of 100 000 has such a point by chance."""
QUIET_PART = 0.05
"""Part of a record in which its noise is looked for [-], our choice: half the default pre-trigger,
since a weak pulse has long begun when it reaches the detection level."""
TAIL_CONTACTS = 1.0
"""What must follow the pulse, in its half-amplitude widths [-], our choice."""
HAMMER = "hammer"
"""The channel that tells how strong a hit was, for people."""
BASELINE_POINTS = 3
"""What must come before the pulse, in points, for a baseline."""


def check_stream(record: Record) -> tuple[Rejection, ...]:
    """Find what is wrong with a record before anyone looks for a pulse in it."""
    if not record.triggered:
        return (Rejection(Reason.NO_TRIGGER, "the arming ended without a trigger"),)
    found = [Rejection(Reason.GAP, flaw) for flaw in record.flaws]
    for name, trace in _name_channels(record):
        bad = int(np.count_nonzero(~np.isfinite(trace.acceleration)))
        if bad:
            found.append(
                Rejection(Reason.NON_FINITE, f"{bad} points of the {name} trace are no numbers")
            )
    if record.hammer.acceleration.size == 0:
        found.append(Rejection(Reason.NO_PULSE, "the record is empty"))
    return tuple(found)


def check_channels(record: Record, settings: AnalysisSettings) -> tuple[Rejection, ...]:
    """Find dead and overloaded channels of a finite record."""
    channels = _name_channels(record)
    quiet = int(QUIET_PART * record.hammer.acceleration.size)
    if record.pulse_index is not None:
        quiet = min(quiet, record.pulse_index)
    dead = [name for name, trace in channels if _is_dead(trace, max(quiet, 1))]
    found = []
    if dead and len(dead) < len(channels):
        found.append(Rejection(Reason.DEAD_CHANNEL, f"the {dead[0]} channel shows no signal"))
    elif record.pulse_index is None:
        found.append(Rejection(Reason.NO_PULSE, "the hammer trace never leaves its baseline"))
    for name, trace in channels:
        run = find_longest_rail_run(trace)
        if run >= settings.overload_run:
            rail = float(np.max(np.abs(trace.acceleration)))
            found.append(
                Rejection(
                    Reason.OVERLOAD,
                    f"{run} points in a row of the {name} at the rail of {rail:.4g} m/s^2"
                    f" ({rail / g:.4g} g)",
                )
            )
        elif trace.overloaded:
            found.append(
                Rejection(Reason.OVERLOAD, f"the device says that the {name} channel overloaded")
            )
    return tuple(found)


def check_strength(
    record: Record, peaks: Sequence[float], settings: AnalysisSettings, *, overloaded: bool
) -> tuple[Rejection, ...]:
    """Find whether a hit is too weak or too strong for the ranges of its channels.

    Parameters
    ----------
    record : Record
        The hit.
    peaks : sequence of float
        Largest |acceleration| after the low-pass of hammer, then sample where measured [m/s^2].
    settings : AnalysisSettings
        `minimum_peak` and `maximum_peak` are used; where full scale is not known, nothing is
        weak or strong.
    overloaded : bool
        A channel stood at its rail: then the peak is not known, and the overload says so.
    """
    found = []
    for (name, trace), peak in zip(_name_channels(record), peaks, strict=True):
        least, most = (
            part * trace.full_scale for part in (settings.minimum_peak, settings.maximum_peak)
        )
        if name == HAMMER and peak < least:
            found.append(
                Rejection(Reason.WEAK, f"{name} peak {peak:.4g} m/s^2 is below {least:.4g} m/s^2")
            )
        if trace.full_scale > 0.0 and peak > most and not overloaded:
            found.append(
                Rejection(Reason.STRONG, f"{name} peak {peak:.4g} m/s^2 is above {most:.4g} m/s^2")
            )
    return tuple(found)


def check_pulse(
    record: Record, hammer: FloatArray, pulse: PulseWidth, settings: AnalysisSettings
) -> tuple[Rejection, ...]:
    """Find what is wrong with the course of a pulse that could be measured.

    Parameters
    ----------
    record : Record
        The hit.
    hammer : ndarray, shape (n,)
        Filtered hammer trace, baseline zero [m/s^2].
    pulse : PulseWidth
        Its pulse.
    settings : AnalysisSettings
        `double_hit_level` is used.
    """
    found = []
    if pulse.fall + TAIL_CONTACTS * pulse.half_amplitude_width > hammer.size - 1:
        found.append(Rejection(Reason.TRUNCATED, "the record ends too soon after the pulse"))
    second = find_second_pulse(hammer, pulse, settings.double_hit_level)
    if second is not None:
        delay = abs(second.delay) / record.sampling_rate
        found.append(
            Rejection(
                Reason.DOUBLE_HIT,
                f"a second pulse of {second.height * 100:.0f} % of the largest"
                f" {'follows after' if second.delay > 0 else 'precedes it by'}"
                f" {delay * 1e6:.0f} us",
            )
        )
    return tuple(found)


def find_longest_rail_run(trace: Trace) -> int:
    """Return how many points in a row stand at the rail [points].

    The rail is full scale where that is known; else a flat top is a rail if the trace steps
    into it.
    """
    values = trace.acceleration
    if values.size == 0:
        return 0
    peak = max(float(values.max()), -float(values.min()))
    rail = peak * (1.0 - 1e-9)
    if trace.full_scale > 0.0:
        # A converter of b bits ends one step below its positive full scale.
        rail = (1.0 - RAIL_TOLERANCE) * trace.full_scale - RAIL_STEPS * trace.resolution
        if peak < rail:
            return 0
    at_rail = np.abs(values) >= rail
    run = _find_longest_run(at_rail)
    if trace.full_scale > 0.0:
        return run
    first = int(np.argmax(at_rail))
    step = peak - abs(float(values[first - 1])) if first > 0 else 0.0
    return run if step > CORNER_STEP * peak else 1


def _find_longest_run(flags: NDArray[np.bool_]) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False]))))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def _is_dead(trace: Trace, quiet_count: int) -> bool:
    values, quiet = trace.acceleration, trace.acceleration[:quiet_count]
    level = DEAD_LEVEL * trace.full_scale
    # No deviation is less than half the range of all, no standard deviation more than half the
    # range of the quiet part: a good hit is told from a dead channel by these alone.
    if _find_half_range(values) > max(level, DEAD_NOISE * _find_half_range(quiet)):
        return False
    largest = float(np.max(np.abs(values - np.median(quiet))))
    return largest <= max(level, DEAD_NOISE * float(np.std(quiet)))


def _find_half_range(values: FloatArray) -> float:
    return (float(values.max()) - float(values.min())) / 2.0


def _name_channels(record: Record) -> list[tuple[str, Trace]]:
    channels = [(HAMMER, record.hammer)]
    if record.specimen is not None:
        channels.append(("sample", record.specimen))
    return channels
