"""Whether a hit counts, with every reason why it does not."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from impact_rig.core.given.errors import SignalError
from impact_rig.core.given.findings import Finding, Reason
from impact_rig.core.given.records import ChannelBlock, FloatArray, Record
from impact_rig.core.given.setup import AnalysisSettings
from impact_rig.core.hit.detection import SPREAD_OF_MEDIAN
from impact_rig.core.hit.pulse_width import PulseWidth, find_crossing, find_peaks, measure_pulse

SHOWS_NOTHING = frozenset({Reason.NO_TRIGGER, Reason.DEAD_CHANNEL, Reason.NO_PULSE})
"""Reasons of hits that will not become better by striking again and again."""
SHARE_NO_MEAN = frozenset({Reason.OTHER_KIND, Reason.POLARITY, Reason.COPY})
"""Reasons that a person cannot overrule: a mean of both would describe neither, or one twice."""


SAME = 1e-9
"""Difference of extremes that are one count, over the peak [-]: rounding by a scale."""
LEAST_EXTREME = 0.3
"""Of a rail, over the peak [-]: a quiet baseline repeats its extremes."""
TOP_NOISE = 3.0
"""Standard deviations by which noise holds a point on a step [-]."""
STEPS = 3.0
"""By which noise moves no point [counts]: by one it does, seldom by two."""
REACH = 4
"""On either side that show whether a point belongs to them [points]."""
LEAST_JUMP = 0.02
"""Of a trace, over its range [-], our choice."""
FEWEST_TOP_POINTS = 12
"""Of w50 that show shoulders [points], our choice."""
FEWEST_POINTS = 3
"""Of w50 [points]: below, the flanks have no points."""
LEAST_CREST = 8
"""Standard deviations in the peak of an impact [-]: vibration has crests of 3 to 5."""


def find_longest_rail_run(trace: ChannelBlock, quiet: int) -> int:
    """Return how many points in a row stand at a rail [points].

    The rail is full scale where that is known. Whether it is or not, extremes that are equal in a
    row more often than chance allows stand at one.

    The trace is finite; `quiet` points before the pulse, 1 or more, show noise and baseline.
    """
    values = trace.acceleration
    bottom, top = trace.extremes
    run = 0
    if trace.full_scale > 0.0:
        # A converter of b bits ends one step below its positive full scale, at 2^(b-1) - 1; four
        # steps of 12 bits are room for an offset.
        rail = (1.0 - 2e-3) * trace.full_scale - trace.resolution
        if max(top, -bottom) >= rail:
            run = _find_longest_run(np.abs(values) >= rail)[1]
    # No rail lies nearer to the baseline than the last points before a pulse do.
    middle = float(values[0])
    same = SAME * max(top, -bottom)
    for sign, extreme in ((1.0, top), (-1.0, bottom)):
        if sign * (extreme - middle) <= LEAST_EXTREME * (top - bottom):
            continue
        at_extreme = values >= extreme - same if sign > 0.0 else values <= extreme + same
        start, found = _find_longest_run(at_extreme)
        # Two equal points are the top of any symmetric pulse.
        if found > max(run, 2):
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
    # A top may be half as long again as that of a versed-sine; a linear spring's is 1.06 times it.
    within = step + TOP_NOISE * noise
    rounded = 1.5 * 2.0 * math.sqrt(2.0 * within / curvature) + 1.0
    alike = math.erf(step / (2.0 * math.sqrt(2.0) * noise)) if noise > 0.0 else 1.0
    if alike > 1.0 - SAME:
        return rounded
    if alike == 0.0:  # noise beyond all counts
        return 1.0
    # By noise in one record of a million, our choice.
    return min(rounded, 1.0 + math.log(1e-6 / max(width, 1)) / math.log(alike))


def find_step(values: FloatArray, extreme: float) -> float:
    """Return the least difference of the largest values, rounding apart: one count there.

    A file that gives three digits has 1.01 after 1.00, and 0.999 before: the step is the last
    difference where that is so much larger, and ten times the least of high values at most.
    """
    if not 0.0 < extreme < math.inf:
        return 0.0
    steps = np.diff(np.unique(values[values > LEAST_EXTREME * extreme]))
    steps = steps[steps > SAME * extreme]
    if steps.size == 0:
        return extreme
    # Noise leaves out some counts below a rail. The steps of two decades differ by ten, or nearly.
    last, top = float(steps[-1]), float(steps[-4:].min())
    return min(last if last > 8.0 * top else top, 10.0 * float(steps.min()))


def _find_longest_run(flags: NDArray[np.bool_]) -> tuple[int, int]:
    """Return where the longest run of true flags begins, and how long it is [points]."""
    places = np.flatnonzero(flags)
    if places.size == 0:
        return 0, 0
    ends = np.flatnonzero(np.diff(places) > 1) + 1
    longest = max(np.split(places, ends), key=len)
    return int(longest[0]), longest.size


def find_dropout(
    name: str, trace: ChannelBlock, quiet: int, sampling_rate: float
) -> Finding | None:
    """Find a single point off a smooth curve through its neighbours.

    The trace is finite and as recorded, since a low-pass would smear the point; `quiet` points
    before the pulse show the noise.
    """
    values, reach = trace.acceleration, REACH
    if values.size <= 2 * reach:
        return None
    # It is far off both neighbours, and these on the same side: by a twentieth, our choice.
    steps = values[1:] - values[:-1]
    least = 0.05 * (trace.extremes[1] - trace.extremes[0])
    if min(float(steps.max()), -float(steps.min())) < least:
        return None
    index = 1 + int(np.abs(np.diff(steps)).argmax())
    if not reach <= index < values.size - reach:
        return None
    near = values[index - reach : index + reach + 1].copy()
    curve = (4.0 * (near[reach - 1] + near[reach + 1]) - near[reach - 2] - near[reach + 2]) / 6.0
    off = abs(float(near[reach] - curve))
    near[reach] = curve
    left = float(np.abs(np.diff(near, n=2)).max()) / 2.0
    noise = float(np.std(values[:quiet]))
    upright = np.abs(values)
    step = trace.resolution or find_step(upright, float(upright.max()))
    least = max(least, 10.0 * noise, STEPS * step)
    # A bend that is left without the point is a sharp signal.
    if off < least or left > 0.25 * off + TOP_NOISE * noise:
        return None
    text = (
        f"a single point of the {name}, {index / sampling_rate * 1e6:.0f} µs into the record, is"
        f" {off:.4g} m/s^2 off its neighbours"
    )
    return Finding(Reason.DROPOUT, text)


def find_jump(name: str, trace: ChannelBlock, quiet: int, sampling_rate: float) -> Finding | None:
    """Find the largest step between two points of a trace that is smooth on both sides.

    An overload: the counts wrap around; a gap: points are missing. The trace is finite and as
    recorded; `quiet` points before the pulse show the noise.
    """
    values, reach = trace.acceleration, 2 * REACH
    steps = values[1:] - values[:-1]
    if steps.size <= 2 * reach:
        return None
    extent = trace.extremes[1] - trace.extremes[0]
    place = int(steps.argmax()) if steps.max() > -steps.min() else int(steps.argmin())
    if abs(steps[place]) < LEAST_JUMP * extent or not reach <= place < steps.size - reach:
        return None
    noise = math.sqrt(2.0) * float(np.std(values[:quiet]))
    # Noise reaches 8 standard deviations once in 10^12 records.
    least = max(8.0 * noise, LEAST_JUMP * extent, STEPS * trace.resolution)
    baseline = float(np.median(values[:quiet]))
    before, after = (float(value) - baseline for value in values[place : place + 2])
    height = after - before
    # Near the baseline a contact may begin or end at once.
    if min(abs(before), abs(after)) <= 0.1 * extent or abs(height) < least:
        return None
    if abs(height) > 0.6 * extent:
        reason, what = Reason.OVERLOAD, "its counts wrap around"
        is_found = before * after < 0.0
    else:
        reason, what = Reason.GAP, "points are missing"
        near = steps[place - reach : place + reach + 1]
        slope = float(np.median(near))
        off = near - slope
        height = float(off[reach])
        others = float(np.abs(np.delete(off, reach)).max())
        # Beside steps of half its height it is a sharp signal.
        is_alone = abs(height) >= least and others <= 0.5 * abs(height)
        # Missing points go on in the direction of the trace; a zero that shifts may not.
        is_found = is_alone and height * slope > 0.0
    text = (
        f"the {name} jumps by {abs(height):.4g} m/s^2 between two points"
        f" {place / sampling_rate * 1e6:.0f} µs into the record: {what}"
    )
    return Finding(reason, text) if is_found else None


def is_flat(trace: FloatArray) -> bool:
    """Return whether the largest pulse of a trace, baseline zero, is cut off at its top."""
    peak_index = int(np.argmax(np.abs(trace)))
    upright = trace if trace[peak_index] > 0.0 else -trace
    half, low, high = (
        find_crossing(upright, peak_index, part * float(upright[peak_index]), 1)
        - find_crossing(upright, peak_index, part * float(upright[peak_index]), -1)
        for part in (0.5, 0.95, 0.985)
    )
    # Its top over its shoulders: sensors that ring have up to 3.8, clipped at 85 % it is 5.2.
    return half > FEWEST_TOP_POINTS and high > 4.5 * (low - high)


def shows_plateau(record: Record) -> bool:
    """Return whether a flat top is the contact's: both bodies have it, apart in their ranges.

    A body that yields holds the force, on both bodies at once; channels clip each at its own rail.
    """
    if len(record.channels) == 1 or not all(trace.full_scale > 0.0 for trace in record.channels):
        return False
    quiet, tops, parts = _count_quiet(record), [], []
    for trace in record.channels:
        upright = np.abs(trace.acceleration - np.median(trace.acceleration[:quiet]))
        tops.append(upright > 0.97 * upright.max())
        parts.append(float(upright.max()) / (0.95 * trace.full_scale))
    least, most = sorted(parts)
    shared, either = (np.count_nonzero(top) for top in (tops[0] & tops[1], tops[0] | tops[1]))
    # At the same part of both ranges an amplifier may cut off both.
    return bool(most < 1.0 and least < 0.9 * most and shared > 0.8 * either)


def _count_quiet(record: Record) -> int:
    """Return how many points before the pulse show noise and baseline."""
    # Half the default pre-trigger: a weak pulse begins early.
    quiet = int(0.05 * record.hammer.acceleration.size)
    if record.pulse_index is not None:
        quiet = min(quiet, record.pulse_index)
    return max(quiet, 1)


@dataclass(frozen=True)
class SecondPulse:
    """A bump in the record of a hit, beside its pulse."""

    height: float  # over the height of the largest pulse [-]
    delay: float  # middle to middle [points]; negative: it comes before the largest pulse
    reason: Reason = Reason.DOUBLE_HIT  # or what a contact cannot be told from


def find_second_pulse(
    trace: FloatArray,
    pulse: PulseWidth,
    level: float,
    noise: float = 0.0,
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
    """
    upright = trace if pulse.peak > 0 else -trace
    # A pulse of just that level is seen; noise of 6 standard deviations is, once in 10^4 records.
    least = max(0.9 * level * abs(pulse.peak), 6.0 * noise)
    width = pulse.half_amplitude_width
    foot = 1.5 * width if math.isnan(pulse.width_ratio) else pulse.tenth_amplitude_width
    peaks = find_peaks(np.append(upright, upright.min()), least)
    doubtful = None
    for index in sorted(peaks, key=lambda index: -upright[index]):
        if index == pulse.peak_index:
            continue
        height = float(upright[index])
        rise, fall = (find_crossing(upright, index, 0.5 * height, step) for step in (-1, 1))
        rise = 0.0 if math.isnan(rise) else rise
        fall = float(upright.size) if math.isnan(fall) else fall
        is_cut = fall > upright.size - 1
        delay = (index if is_cut else (rise + fall) / 2.0) - pulse.middle
        # Sooner it is the same contact; of less than 5 % it may be how the hammer answers to it.
        apart = 1.3 * width if height > 0.05 * abs(pulse.peak) else 1.36 * foot
        if abs(delay) < apart:
            continue
        # A softer hit lasts longer (Hertz).
        shortest = 0.0 if is_cut else 0.5 * width
        found = SecondPulse(height / abs(pulse.peak), delay)
        # A wave undershoots by its own height, a contact not at all.
        if _find_swing(upright, pulse, index) >= 0.5 * height:
            doubtful = doubtful or replace(found, reason=Reason.RINGING)
        elif fall - rise < shortest:
            continue
        elif _find_wander(upright, pulse, rise, fall) > 0.1 * height:
            doubtful = doubtful or replace(found, reason=Reason.UNSTEADY_ZERO)
        else:
            return found
    return doubtful


def _find_swing(upright: FloatArray, pulse: PulseWidth, index: int) -> float:
    """Return how far the trace swings to the other side near a bump, one that comes again."""
    reach = int(2.7 * pulse.half_amplitude_width)
    low, high = max(index - reach, 0), index + reach + 1
    if index > pulse.peak_index:
        low = max(low, math.ceil(pulse.fall))
    else:
        high = min(high, math.floor(pulse.rise) + 1)
    return -float(np.min(upright[low:high]))


def _find_wander(upright: FloatArray, pulse: PulseWidth, rise: float, fall: float) -> float:
    """Return how far the trace typically is from zero behind the pulse and beside a bump."""
    near = 1.8 * pulse.half_amplitude_width
    tail = np.arange(upright.size) > pulse.fall + near
    tail[max(int(rise - near), 0) : int(fall + near)] = False
    return SPREAD_OF_MEDIAN * float(np.median(np.abs(upright[tail]))) if tail.any() else 0.0


CHANNELS = ("hammer", "sample")
"""For people; the first tells how strong a hit was."""


def check_stream(record: Record) -> list[Finding]:
    """Find what is wrong with a record before anyone looks for a pulse in it."""
    if record.disarmed:
        return [Finding(Reason.DISARMED, record.disarmed)]
    if not record.triggered:
        return [Finding(Reason.NO_TRIGGER, "the arming ended without a trigger")]
    found = [Finding(Reason.GAP, flaw) for flaw in record.flaws]
    if record.hammer.acceleration.size == 0:
        return [*found, Finding(Reason.NO_PULSE, "the record is empty")]
    for name, trace in zip(CHANNELS, record.channels, strict=False):
        if not all(map(math.isfinite, trace.extremes)):
            bad = int(np.count_nonzero(~np.isfinite(trace.acceleration)))
            text = f"{bad} points of the {name} trace are no numbers"
            found.append(Finding(Reason.NON_FINITE, text))
    return found


def check_channels(record: Record) -> list[Finding]:
    """Find dead and overloaded channels of a finite record, and points that cannot be."""
    channels = list(zip(CHANNELS, record.channels, strict=False))
    quiet = _count_quiet(record)
    dead = [name for name, trace in channels if _is_dead(trace, quiet)]
    found: list[Finding | None] = []
    if dead and len(dead) < len(channels):
        found.append(Finding(Reason.DEAD_CHANNEL, f"the {dead[0]} channel shows no signal"))
    elif record.pulse_index is None:
        found.append(Finding(Reason.NO_PULSE, "the hammer trace never leaves its baseline"))
    for name, trace in channels:
        run = find_longest_rail_run(trace, quiet)
        # One point may be chance.
        if run > 1 and not shows_plateau(record):
            rail = float(np.max(np.abs(trace.acceleration)))
            text = (
                f"{run} points in a row of the {name} at the rail of {rail:.4g} m/s^2"
                f" ({rail / scipy.constants.g:.4g} g)"
            )
            found.append(Finding(Reason.OVERLOAD, text))
        elif trace.overloaded:
            text = f"the device says that the {name} channel overloaded"
            found.append(Finding(Reason.OVERLOAD, text))
        found.append(find_dropout(name, trace, quiet, record.sampling_rate))
        found.append(find_jump(name, trace, quiet, record.sampling_rate))
    return [item for item in found if item is not None]


def check_tops(traces: FloatArray) -> list[Finding]:
    """Find filtered traces, shape (channels, n), baseline zero, whose pulse has no top."""
    text = "the {}'s pulse is flat at its top, as of an amplifier that is overloaded"
    return [
        Finding(Reason.OVERLOAD, text.format(name))
        for name, trace in zip(CHANNELS, traces, strict=False)
        if is_flat(trace)
    ]


LEAST_STRENGTH = 100.0
"""Peak over noise and one step of the converter together [-], our choice: w50 to a hundredth."""


def check_strength(
    record: Record,
    peaks: Sequence[float],
    noise: float,
    settings: AnalysisSettings,
    *,
    overloaded: bool,
) -> list[Finding]:
    """Find whether a hit is too weak or too strong for the ranges of its channels.

    Parameters
    ----------
    peaks : sequence of float
        Largest |acceleration| after the low-pass of hammer, then sample where measured [m/s^2].
    noise : float
        Of the hammer's trace after the low-pass [m/s^2].
    settings : AnalysisSettings
        `minimum_peak` and `maximum_peak` are used; where full scale is not known, nothing is
        weak or strong.
    overloaded : bool
        A channel stood at its rail: then the peak is not known, and the overload says so.
    """
    found = []
    for name, trace, peak in zip(CHANNELS, record.channels, peaks, strict=False):
        least = LEAST_STRENGTH * math.hypot(noise, trace.resolution)
        least = max(settings.minimum_peak * trace.full_scale, least)
        most = settings.maximum_peak * trace.full_scale
        what = f"{name} peak {peak:.4g} m/s^2 is"
        if name == CHANNELS[0] and trace.full_scale > 0.0 and peak < least:
            text = f"{what} below {least:.4g} m/s^2: swing higher, or use a more sensitive range"
            found.append(Finding(Reason.WEAK, text))
        if trace.full_scale > 0.0 and peak > most and not overloaded:
            text = f"{what} above {most:.4g} m/s^2: swing lower, or use a less sensitive range"
            found.append(Finding(Reason.STRONG, text))
    return found


def check_pulse(
    hammer: FloatArray,
    pulse: PulseWidth,
    noise: float,
    sampling_rate: float,
    settings: AnalysisSettings,
) -> list[Finding]:
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
        `double_hit_level` is used.
    """
    found = []
    if pulse.half_amplitude_width < FEWEST_POINTS:
        text = (
            f"its width at half amplitude is {pulse.half_amplitude_width:.2g} points, it takes"
            f" {FEWEST_POINTS}: sample faster"
        )
        found.append(Finding(Reason.FEW_POINTS, text))
    if abs(pulse.peak) < LEAST_CREST * noise:
        text = (
            f"the largest pulse is {abs(pulse.peak) / noise:.2g} times the standard deviation of"
            f" what comes before it, an impact is {LEAST_CREST} or more"
        )
        found.append(Finding(Reason.NO_PULSE, text))
    if pulse.fall + pulse.half_amplitude_width > hammer.size - 1:
        found.append(Finding(Reason.TRUNCATED, "the record ends too soon after the pulse"))
    level = settings.double_hit_level
    second = find_second_pulse(hammer, pulse, level, noise)
    if second is not None:
        place = (
            f"of {float(f'{second.height * 100:.2g}'):g} % of the largest"
            f" {'follows after' if second.delay > 0 else 'precedes it by'}"
            f" {abs(second.delay) / sampling_rate * 1e6:.0f} µs"
        )
        is_harmless = second.reason is Reason.RINGING
        if second.reason is Reason.DOUBLE_HIT:
            text = f"a second pulse {place}; from {level * 100:g} % on one counts"
        elif is_harmless:
            text = f"a bump {place}: ringing, or a second contact in it"
        else:
            text = f"a bump {place}, as the zero wanders: noise of a cable, strain of the"
            text += " sensor's base"
            # It changes tau_p by some 3 %.
            is_harmless = second.height < max(0.05, level)
        found.append(Finding(second.reason, text, is_harmless))
    return found


def check_low_pass(
    raw: FloatArray,
    filtered: PulseWidth,
    noise: float,
    sampling_rate: float,
    settings: AnalysisSettings,
) -> list[Finding]:
    """Find a second contact that the low-pass hides, and whether it changes the pulse.

    Parameters
    ----------
    raw : ndarray, shape (n,)
        Hammer trace before the low-pass, baseline zero [m/s^2].
    filtered : PulseWidth
        What is left of its pulse.
    noise : float
        Standard deviation of `raw` [m/s^2].
    """
    try:
        pulse = measure_pulse(raw)
    except SignalError:
        return []
    width = filtered.half_amplitude_width / pulse.half_amplitude_width
    peak = abs(filtered.peak / pulse.peak)
    # A hundredth is worth a warning, beyond what noise may change of them.
    allowed = 0.01 + 6.0 * noise / abs(pulse.peak)
    if max(abs(width - 1.0), abs(peak - 1.0)) <= allowed:
        return []
    widths = [item.half_amplitude_width / sampling_rate * 1e6 for item in (filtered, pulse)]
    text = (
        f"width at half amplitude {widths[0]:.4g} µs with the {settings.cutoff_frequency / 1e3:g}"
        f" kHz low-pass, {widths[1]:.4g} µs without; peak {peak * 100:.1f} % of that without"
    )
    found = check_pulse(raw, pulse, noise, sampling_rate, settings)
    hidden = [item for item in found if item.reason is Reason.DOUBLE_HIT]
    return [*hidden, Finding(Reason.SMOOTHED, text, is_harmless=True)]


def _is_dead(trace: ChannelBlock, quiet_count: int) -> bool:
    values, quiet = trace.acceleration, trace.acceleration[:quiet_count]
    largest = float(np.max(np.abs(values - np.median(quiet))))
    # Half of the smallest signal worth a range, and noise once in 10^5 records.
    return largest <= max(0.005 * trace.full_scale, 6.0 * float(np.std(quiet)))
