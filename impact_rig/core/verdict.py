"""Whether a hit counts, with every reason why it does not."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from impact_rig.core.detection import SPREAD_OF_MEDIAN
from impact_rig.core.errors import SignalError
from impact_rig.core.pulse_width import PulseWidth, find_crossing, measure_pulse
from impact_rig.core.pulses import HALF_SINE, VERSED_SINE
from impact_rig.core.records import FloatArray, Record, Trace
from impact_rig.core.setup import AnalysisSettings


class Reason(Enum):
    """Why a hit is rejected, or what was found in it."""

    NO_TRIGGER = "no_trigger"
    GAP = "gap"
    NON_FINITE = "non_finite"
    DEAD_CHANNEL = "dead_channel"
    NO_PULSE = "no_pulse"
    OVERLOAD = "overload"
    DROPOUT = "dropout"
    WEAK = "weak"
    STRONG = "strong"
    TRUNCATED = "truncated"
    DOUBLE_HIT = "double_hit"
    ZERO_SHIFT = "zero_shift"
    DROOP = "droop"
    DRIFT = "drift"
    RINGING = "ringing"
    SMOOTHED = "smoothed"
    FEW_POINTS = "few_points"
    UNSTEADY_ZERO = "unsteady_zero"
    POLARITY = "polarity"
    INCONSISTENT = "inconsistent"
    SURPLUS = "surplus"
    OPERATOR = "operator"


@dataclass(frozen=True)
class Rejection:
    """One reason against a hit, with a sentence that has the figures."""

    reason: Reason
    explanation: str

    def __str__(self) -> str:
        """Return ``code: explanation``."""
        return f"{self.reason.value}: {self.explanation}"


@dataclass(frozen=True)
class Limits:
    """From where on a hit is doubted."""

    rail_tolerance: float = 2e-3  # [full scale] four steps of 12 bits, room for an offset
    rail_steps: float = 1.0  # [counts] of b bits the largest is 2^(b-1) - 1
    same: float = 1e-9  # [peak] of extremes that are one count: rounding by a scale
    least_extreme: float = 0.3  # [peak] of a rail; a quiet baseline repeats its extremes
    fewest_equal: int = 3  # [points] two are the top of any symmetric pulse
    chance: float = 1e-6  # [-] probability of a run by noise, our choice
    top_values: int = 4  # [-] noise leaves out some counts below a rail
    decade: float = 8.0  # [-] ratio of the steps of two decades, 10
    flatness: float = 1.5  # [-] top within a step over a versed-sine's; a linear spring's 1.06
    top_noise: float = 3.0  # [-] standard deviations by which noise holds a point on a step
    least_dropout: float = 0.05  # [range] our choice
    dropout_noise: float = 10.0  # [-] standard deviations, our choice
    dropout_steps: float = 3.0  # [counts] noise moves a point by one, seldom two
    dropout_rest: float = 0.25  # [dropout] bend without the point; more is a sharp signal
    reach: int = 4  # [points] on either side that show whether a point belongs to them
    jump_noise: float = 8.0  # [-] standard deviations; noise does it once in 10^12 records
    least_jump: float = 0.02  # [range] our choice
    jump_rest: float = 0.5  # [jump] of the steps beside it; more is a sharp signal
    jump_level: float = 0.1  # [range] from the baseline; a contact may begin or end at once
    wrapped: float = 0.6  # [range] from which a jump is of counts that wrap around, our choice
    top_share: float = 0.985  # [peak] between this and the next a top has its shoulders
    shoulder_share: float = 0.95  # [peak] our choice
    flat_top: float = (
        4.5  # [shoulders] pulses of sensors that ring have up to 3.8, clipped at 85 % 5.2
    )
    fewest_top_points: float = 12.0  # [points] of w50 that show shoulders, our choice
    level_margin: float = 0.9  # [level] so that no pulse of just that level goes unseen
    second_pulse_delay: float = 1.2  # [contact time] sooner it is the same contact
    delay_margin: float = 0.9  # [delay] the contact time is known within 5 % by the shape
    ringing_swing: float = 0.5  # [bump] to the other side: a wave has 1, a contact 0
    swing_reach: float = 1.5  # [contact time] half a period of what comes again
    shortest_second_pulse: float = 0.5  # [w50] a softer hit lasts longer (Hertz)
    noise_margin: float = 6.0  # [-] standard deviations; noise does it once in 10^4 records
    wander: float = 0.1  # [bump] of the rest of the record; beside a contact there is noise alone
    dead_level: float = 0.005  # [full scale] half of the smallest signal worth a range
    dead_noise: float = 6.0  # [-] standard deviations; noise does it once in 10^5 records
    quiet_part: float = 0.05  # [record] half the default pre-trigger: a weak pulse begins early
    highest_wander: float = 0.05  # [peak] of a bump; it changes tau_p by some 3 %
    fewest_points: float = 3.0  # [points] of w50; below, the flanks have no points
    least_crest: float = 8.0  # [-] standard deviations; vibration has crests of 3 to 5
    low_pass_change: float = 0.01  # [-] of width or peak that is worth a warning
    low_pass_noise: float = 6.0  # [-] standard deviations of what noise changes of them
    tail_contacts: float = 1.0  # [w50] that must follow the pulse, our choice


LIMITS = Limits()


def find_longest_rail_run(trace: Trace, quiet: int) -> int:
    """Return how many points in a row stand at a rail [points].

    The rail is full scale where that is known. Whether it is or not, extremes that are equal in a
    row more often than chance allows stand at one.

    The trace is finite; `quiet` points before the pulse, 1 or more, show noise and baseline.
    """
    values = trace.acceleration
    bottom, top = trace.extremes
    run = 0
    if trace.full_scale > 0.0:
        # A converter of b bits ends one step below its positive full scale.
        rail = (
            1.0 - LIMITS.rail_tolerance
        ) * trace.full_scale - LIMITS.rail_steps * trace.resolution
        if max(top, -bottom) >= rail:
            run = _find_longest_run(np.abs(values) >= rail)[1]
    # No rail lies nearer to the baseline than the last points before a pulse do.
    middle = float(values[0])
    same = LIMITS.same * max(top, -bottom)
    for sign, extreme in ((1.0, top), (-1.0, bottom)):
        if sign * (extreme - middle) <= LIMITS.least_extreme * (top - bottom):
            continue
        at_extreme = values >= extreme - same if sign > 0.0 else values <= extreme + same
        start, found = _find_longest_run(at_extreme)
        if found > max(run, LIMITS.fewest_equal - 1):
            baseline = float(np.median(values[:quiet]))
            upright = sign * (values - baseline)
            if found > count_chance_run(upright, start, quiet, trace.resolution):
                run = found
    return run


def count_chance_run(upright: FloatArray, start: int, quiet: int, step: float) -> float:
    """Return how many equal extremes in a row a top may have that is not clipped [points].

    A rounded top stays within one step of the converter for 2 sqrt(2 q / curvature) points; noise
    of more than a step breaks such runs up: each further point is alike with a probability of
    erf(q / (2 sqrt(2) s)) at most.

    Parameters
    ----------
    upright : ndarray, shape (n,)
        Baseline zero, the extreme above it.
    start : int
        Where the extreme is first reached.
    quiet : int
        Points before the pulse.
    step : float
        q, one count; 0: not known.
    """
    height = float(upright[start])
    if height <= 0.0:
        return math.inf  # no top of anything: the baseline is not that of a hit
    if step <= 0.0:
        step = find_step(upright, height)
    noise = float(np.std(upright[:quiet]))
    below = upright < 0.5 * height
    before, after = below[:start][::-1], below[start:]
    width = (int(before.argmax()) if before.any() else start) + (
        int(after.argmax()) if after.any() else after.size
    )
    curvature = 0.5 * height * (math.pi / max(width, 1)) ** 2
    rounded = (
        LIMITS.flatness * 2.0 * math.sqrt(2.0 * (step + LIMITS.top_noise * noise) / curvature)
        + 1.0
    )
    alike = math.erf(step / (2.0 * math.sqrt(2.0) * noise)) if noise > 0.0 else 1.0
    if alike > 1.0 - LIMITS.same:
        return rounded
    if alike == 0.0:  # noise beyond all counts
        return 1.0
    return min(rounded, 1.0 + math.log(LIMITS.chance / max(width, 1)) / math.log(alike))


def find_step(values: FloatArray, extreme: float) -> float:
    """Return the least difference of the largest values, rounding apart: one count there.

    A file that gives three digits has 1.01 after 1.00, and 0.999 before: the step is the last
    difference where that is so much larger, and ten times the least of high values at most.
    """
    if not 0.0 < extreme < math.inf:
        return 0.0
    steps = np.diff(np.unique(values[values > LIMITS.least_extreme * extreme]))
    steps = steps[steps > LIMITS.same * extreme]
    if steps.size == 0:
        return extreme
    last, top = float(steps[-1]), float(steps[-LIMITS.top_values :].min())
    return min(last if last > LIMITS.decade * top else top, 10.0 * float(steps.min()))


def _find_longest_run(flags: NDArray[np.bool_]) -> tuple[int, int]:
    """Return where the longest run of true flags begins, and how long it is [points]."""
    places = np.flatnonzero(flags)
    if places.size == 0:
        return 0, 0
    ends = (np.flatnonzero(places[1:] - places[:-1] > 1) + 1).tolist()
    first, stop = max(pairwise([0, *ends, places.size]), key=lambda run: run[1] - run[0])
    return int(places[first]), stop - first


def find_dropout(trace: Trace, quiet: int) -> tuple[int, float] | None:
    """Find a single point off a smooth curve through its neighbours: where, and by how much.

    The trace is finite and as recorded, since a low-pass would smear the point; `quiet` points
    before the pulse show the noise.
    """
    values, reach = trace.acceleration, LIMITS.reach
    if values.size <= 2 * reach:
        return None
    # It is far off both neighbours, and these on the same side.
    steps = values[1:] - values[:-1]
    least = LIMITS.least_dropout * (trace.extremes[1] - trace.extremes[0])
    if min(float(steps.max()), -float(steps.min())) < least:
        return None
    index = 1 + int(np.abs(np.diff(steps)).argmax())
    if not reach <= index < values.size - reach:
        return None
    near = values[index - reach : index + reach + 1].copy()
    curve = (4.0 * (near[reach - 1] + near[reach + 1]) - near[reach - 2] - near[reach + 2]) / 6.0
    off = float(near[reach] - curve)
    near[reach] = curve
    left = float(np.abs(np.diff(near, n=2)).max()) / 2.0
    noise = float(np.std(values[:quiet]))
    upright = np.abs(values)
    step = trace.resolution or find_step(upright, float(upright.max()))
    least = max(least, LIMITS.dropout_noise * noise, LIMITS.dropout_steps * step)
    is_alone = left <= LIMITS.dropout_rest * abs(off) + LIMITS.top_noise * noise
    return (index, off) if abs(off) >= least and is_alone else None


def find_jump(trace: Trace, quiet: int) -> tuple[Reason, int, float] | None:
    """Find the largest step between two points of a trace that is smooth on both sides.

    An overload: the counts wrap around; a gap: points are missing. With the point before it, and
    its height. The trace is finite and as recorded; `quiet` points before the pulse show the
    noise.
    """
    values, reach = trace.acceleration, 2 * LIMITS.reach
    steps = values[1:] - values[:-1]
    if steps.size <= 2 * reach:
        return None
    extent = trace.extremes[1] - trace.extremes[0]
    place = int(steps.argmax()) if steps.max() > -steps.min() else int(steps.argmin())
    if abs(steps[place]) < LIMITS.least_jump * extent or not reach <= place < steps.size - reach:
        return None
    noise = math.sqrt(2.0) * float(np.std(values[:quiet]))
    least = max(
        LIMITS.jump_noise * noise,
        LIMITS.least_jump * extent,
        LIMITS.dropout_steps * trace.resolution,
    )
    baseline = float(np.median(values[:quiet]))
    before, after = (float(value) - baseline for value in values[place : place + 2])
    is_far = min(abs(before), abs(after)) > LIMITS.jump_level * extent
    if not is_far or abs(after - before) < least:
        return None
    if abs(after - before) > LIMITS.wrapped * extent:
        return (Reason.OVERLOAD, place, after - before) if before * after < 0.0 else None
    near = steps[place - reach : place + reach + 1]
    slope = float(np.median(near))
    off = near - slope
    height = float(off[reach])
    others = float(np.abs(np.delete(off, reach)).max())
    # Missing points go on in the direction of the trace; a zero that shifts may not.
    is_gap = abs(height) >= least and others <= LIMITS.jump_rest * abs(height)
    return (Reason.GAP, place, height) if is_gap and height * slope > 0.0 else None


def is_flat(trace: FloatArray) -> bool:
    """Tell whether the largest pulse of a trace, baseline zero, is cut off at its top."""
    peak_index = int(np.argmax(np.abs(trace)))
    upright = trace if trace[peak_index] > 0.0 else -trace
    half, low, high = (
        find_crossing(upright, peak_index, part * float(upright[peak_index]), 1)
        - find_crossing(upright, peak_index, part * float(upright[peak_index]), -1)
        for part in (0.5, LIMITS.shoulder_share, LIMITS.top_share)
    )
    return half > LIMITS.fewest_top_points and high > LIMITS.flat_top * (low - high)


@dataclass(frozen=True)
class SecondPulse:
    """A bump in the record of a hit, beside its pulse."""

    height: float  # over the height of the largest pulse [-]
    delay: float  # middle to middle [points]; negative: it comes before the largest pulse
    reason: Reason = Reason.DOUBLE_HIT  # or what a contact cannot be told from


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
    least = max(LIMITS.level_margin * level * abs(pulse.peak), LIMITS.noise_margin * noise)
    duration = estimate_duration(pulse)
    apart = LIMITS.delay_margin * LIMITS.second_pulse_delay * duration
    peaks, _ = scipy.signal.find_peaks(np.append(upright, -math.inf), height=least)
    if peaks.size <= 1:
        return None
    ended = np.append(upright, upright.min())
    peaks = peaks[scipy.signal.peak_prominences(ended, peaks)[0] >= least]
    doubtful = None
    for index in sorted(map(int, peaks), key=lambda index: -upright[index]):
        if index == pulse.peak_index:
            continue
        rise, fall = _find_half_crossings(upright, index)
        is_cut = fall > upright.size - 1
        delay = (index if is_cut else (rise + fall) / 2.0) - pulse.middle
        is_apart = apart <= abs(delay) <= window
        shortest = 0.0 if is_cut else LIMITS.shortest_second_pulse * pulse.half_amplitude_width
        if not is_apart or fall - rise < shortest:
            continue
        height = float(upright[index])
        reason = Reason.DOUBLE_HIT
        if _find_swing(upright, pulse, index, duration) >= LIMITS.ringing_swing * height:
            reason = Reason.RINGING
        elif _find_wander(upright, pulse, rise, fall, duration) > LIMITS.wander * height:
            reason = Reason.UNSTEADY_ZERO
        found = SecondPulse(height / abs(pulse.peak), delay, reason)
        if reason is Reason.DOUBLE_HIT:
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
    reach = int(LIMITS.swing_reach * duration)
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


CHANNELS = ("hammer", "sample")
"""For people; the first tells how strong a hit was."""


def check_stream(record: Record) -> tuple[Rejection, ...]:
    """Find what is wrong with a record before anyone looks for a pulse in it."""
    if not record.triggered:
        return (Rejection(Reason.NO_TRIGGER, "the arming ended without a trigger"),)
    found = [Rejection(Reason.GAP, flaw) for flaw in record.flaws]
    if record.hammer.acceleration.size == 0:
        return (*found, Rejection(Reason.NO_PULSE, "the record is empty"))
    for name, trace in _name_channels(record):
        if not all(map(math.isfinite, trace.extremes)):
            bad = int(np.count_nonzero(~np.isfinite(trace.acceleration)))
            found.append(
                Rejection(Reason.NON_FINITE, f"{bad} points of the {name} trace are no numbers")
            )
    return tuple(found)


def check_channels(record: Record, settings: AnalysisSettings) -> tuple[Rejection, ...]:
    """Find dead and overloaded channels of a finite record, and points that cannot be."""
    channels = _name_channels(record)
    quiet = int(LIMITS.quiet_part * record.hammer.acceleration.size)
    if record.pulse_index is not None:
        quiet = min(quiet, record.pulse_index)
    quiet = max(quiet, 1)
    dead = [name for name, trace in channels if _is_dead(trace, quiet)]
    found = []
    if dead and len(dead) < len(channels):
        found.append(Rejection(Reason.DEAD_CHANNEL, f"the {dead[0]} channel shows no signal"))
    elif record.pulse_index is None:
        found.append(Rejection(Reason.NO_PULSE, "the hammer trace never leaves its baseline"))
    for name, trace in channels:
        run = find_longest_rail_run(trace, quiet)
        if run >= settings.overload_run:
            rail = float(np.max(np.abs(trace.acceleration)))
            found.append(
                Rejection(
                    Reason.OVERLOAD,
                    f"{run} points in a row of the {name} at the rail of {rail:.4g} m/s^2"
                    f" ({rail / scipy.constants.g:.4g} g)",
                )
            )
        elif trace.overloaded:
            found.append(
                Rejection(Reason.OVERLOAD, f"the device says that the {name} channel overloaded")
            )
        dropout = find_dropout(trace, quiet)
        if dropout is not None:
            point, off = dropout
            found.append(
                Rejection(
                    Reason.DROPOUT,
                    f"a single point of the {name},"
                    f" {point / record.sampling_rate * 1e6:.0f} µs into the record, is"
                    f" {abs(off):.4g} m/s^2 off its neighbours",
                )
            )
        jump = find_jump(trace, quiet)
        if jump is not None:
            reason, point, height = jump
            what = "points are missing" if reason is Reason.GAP else "its counts wrap around"
            found.append(
                Rejection(
                    reason,
                    f"the {name} jumps by {abs(height):.4g} m/s^2 between two points"
                    f" {point / record.sampling_rate * 1e6:.0f} µs into the record: {what}",
                )
            )
    return tuple(found)


def check_tops(traces: FloatArray) -> tuple[Rejection, ...]:
    """Find filtered traces, shape (channels, n), baseline zero, whose pulse has no top."""
    return tuple(
        Rejection(
            Reason.OVERLOAD,
            f"the {name}'s pulse is flat at its top, as of an amplifier that is overloaded",
        )
        for name, trace in zip(CHANNELS, traces, strict=False)
        if is_flat(trace)
    )


def check_strength(
    record: Record, peaks: Sequence[float], settings: AnalysisSettings, *, overloaded: bool
) -> tuple[Rejection, ...]:
    """Find whether a hit is too weak or too strong for the ranges of its channels.

    Parameters
    ----------
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
        if name == CHANNELS[0] and peak < least:
            found.append(
                Rejection(Reason.WEAK, f"{name} peak {peak:.4g} m/s^2 is below {least:.4g} m/s^2")
            )
        if trace.full_scale > 0.0 and peak > most and not overloaded:
            found.append(
                Rejection(Reason.STRONG, f"{name} peak {peak:.4g} m/s^2 is above {most:.4g} m/s^2")
            )
    return tuple(found)


def check_pulse(
    hammer: FloatArray,
    pulse: PulseWidth,
    noise: float,
    sampling_rate: float,
    settings: AnalysisSettings,
) -> tuple[tuple[Rejection, ...], tuple[Rejection, ...]]:
    """Find what is wrong with the course of a pulse that could be measured.

    Parameters
    ----------
    hammer : ndarray, shape (n,)
        Filtered hammer trace, baseline zero [m/s^2].
    noise : float
        Standard deviation of the trace [m/s^2].
    sampling_rate : float
        [Hz]
    settings : AnalysisSettings
        `double_hit_level` and `double_hit_window` are used.

    Returns
    -------
    tuple of tuple of Rejection
        What is against the hit, and what looks like it but cannot be told from what is harmless.
    """
    against, doubtful = [], []
    if pulse.half_amplitude_width < LIMITS.fewest_points:
        text = (
            f"its width at half amplitude is {pulse.half_amplitude_width:.2g} points, it takes"
            f" {LIMITS.fewest_points:g}: sample faster"
        )
        against.append(Rejection(Reason.FEW_POINTS, text))
    if abs(pulse.peak) < LIMITS.least_crest * noise:
        text = (
            f"the largest pulse is {abs(pulse.peak) / noise:.2g} times the standard deviation of"
            f" what comes before it, an impact is {LIMITS.least_crest:g} or more"
        )
        against.append(Rejection(Reason.NO_PULSE, text))
    if pulse.fall + LIMITS.tail_contacts * pulse.half_amplitude_width > hammer.size - 1:
        against.append(Rejection(Reason.TRUNCATED, "the record ends too soon after the pulse"))
    level, window = settings.double_hit_level, settings.double_hit_window
    second = find_second_pulse(hammer, pulse, level, noise, window * sampling_rate or math.inf)
    if second is not None:
        height = f"{float(f'{second.height * 100:.2g}'):g} % of the largest"
        place = (
            f"{'follows after' if second.delay > 0 else 'precedes it by'}"
            f" {abs(second.delay) / sampling_rate * 1e6:.0f} µs"
        )
        counts = f"from {level * 100:g} % on"
        counts += f" within {window * 1e6:g} µs one counts" if window else " one counts"
        if second.reason is Reason.DOUBLE_HIT:
            text = f"a second pulse of {height} {place}; {counts}"
            against.append(Rejection(Reason.DOUBLE_HIT, text))
        elif second.reason is Reason.RINGING:
            text = f"a bump of {height} {place}: ringing, or a second contact in it"
            doubtful.append(Rejection(Reason.RINGING, text))
        else:
            text = (
                f"a bump of {height} {place}, as the zero wanders: noise of a cable, strain of the"
                " sensor's base"
            )
            target = against if second.height >= max(LIMITS.highest_wander, level) else doubtful
            target.append(Rejection(Reason.UNSTEADY_ZERO, text))
    return tuple(against), tuple(doubtful)


def check_low_pass(
    raw: FloatArray,
    filtered: PulseWidth,
    noise: float,
    sampling_rate: float,
    settings: AnalysisSettings,
) -> tuple[tuple[Rejection, ...], tuple[Rejection, ...]]:
    """Hold a pulse against the same trace without the low-pass.

    Parameters
    ----------
    raw : ndarray, shape (n,)
        Hammer trace before the low-pass, baseline zero [m/s^2].
    filtered : PulseWidth
        What is left of its pulse.
    noise : float
        Standard deviation of `raw` [m/s^2].

    Returns
    -------
    tuple of tuple of Rejection
        A second contact that the low-pass hides, and what it does to the pulse where that is worth
        a warning.
    """
    try:
        pulse = measure_pulse(raw)
    except SignalError:
        return (), ()
    width = filtered.half_amplitude_width / pulse.half_amplitude_width
    peak = abs(filtered.peak / pulse.peak)
    allowed = LIMITS.low_pass_change + LIMITS.low_pass_noise * noise / abs(pulse.peak)
    if max(abs(width - 1.0), abs(peak - 1.0)) <= allowed:
        return (), ()
    widths = [item.half_amplitude_width / sampling_rate * 1e6 for item in (filtered, pulse)]
    text = (
        f"width at half amplitude {widths[0]:.4g} µs with the {settings.cutoff_frequency / 1e3:g}"
        f" kHz low-pass, {widths[1]:.4g} µs without; peak {peak * 100:.1f} % of that without"
    )
    against, _ = check_pulse(raw, pulse, noise, sampling_rate, settings)
    hidden = tuple(item for item in against if item.reason is Reason.DOUBLE_HIT)
    return hidden, (Rejection(Reason.SMOOTHED, text),)


def _is_dead(trace: Trace, quiet_count: int) -> bool:
    values, quiet = trace.acceleration, trace.acceleration[:quiet_count]
    largest = float(np.max(np.abs(values - np.median(quiet))))
    level = LIMITS.dead_level * trace.full_scale
    return largest <= max(level, LIMITS.dead_noise * float(np.std(quiet)))


def _name_channels(record: Record) -> list[tuple[str, Trace]]:
    traces = (record.hammer, record.specimen)
    return [(n, trace) for n, trace in zip(CHANNELS, traces, strict=True) if trace is not None]
