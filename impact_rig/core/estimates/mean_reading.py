"""Pulse and peaks of a mean hit, read once, with their uncertainty."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from impact_rig.core.estimates.contact_law import NO_LAW, ContactLaw, look_at_law
from impact_rig.core.estimates.damping import LogDecrement, check_window, estimate_log_decrement
from impact_rig.core.estimates.equations import UncertainNumber
from impact_rig.core.estimates.pulse_shape import (
    LARGE_RESIDUAL,
    NO_SHAPE,
    PulseShapeEstimate,
    compute_unexplained,
    estimate_pulse_shape,
)
from impact_rig.core.estimates.uncertainty import (
    LEAST_HITS,
    ONE_HIT,
    PULSE_SHAPE,
    Known,
    RigNumbers,
    make_ensemble,
    make_input,
    make_rig_numbers,
)
from impact_rig.core.given.errors import NotDeterminedError, RigError
from impact_rig.core.given.findings import Note, Subject
from impact_rig.core.given.records import FloatArray
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.judging import FilteredHit
from impact_rig.core.hit.momenta import Hold
from impact_rig.core.hit.pulse_width import (
    BASE,
    BY_NOISE,
    WIDENING,
    TraceQuality,
    compute_peak_excess,
    compute_quantisation_error,
    compute_trend,
    estimate_pulse_errors,
    find_ends,
    measure_pulse,
)
from impact_rig.core.hit.pulses import PULSE_SHAPES
from impact_rig.core.mean.mean_hit import MeanHit, TraceSum, follow_mean, make_mean, shift_hit
from impact_rig.core.mean.trends import follow_series

DAMPING = (Subject.C1, Subject.C2)
"""Subjects of notes on the damping of hammer and sample."""


MOVES_ON = (
    "no log decrement, since the sample moves on after the contact as a free body does:"
    " what rings is its sensor's mount or an inner mode, or waves go to and fro in it"
)
"""Why there is none of a sample on no spring."""


@dataclass(frozen=True)
class HammerPulse:
    """Shape of the hammer's mean pulse."""

    shape: PulseShapeEstimate  # which of the known shapes it has
    law: ContactLaw  # which law of contact makes such a pulse
    notes: tuple[Note, ...] = ()  # why the shape is not determined


UNSEEN = HammerPulse(NO_SHAPE, NO_LAW)
"""Placeholder until the pulse's shape is fitted; estimates with it have no uncertainty."""


def look_at_pulse(mean: MeanHit, setup: RigSetup, sample: str) -> HammerPulse:
    """Return shape and law of the mean pulse on `sample`."""
    law = look_at_law(mean, setup, sample)
    try:
        shape = estimate_pulse_shape(mean, setup.find_chains(mean.sampling_rate)[0])
    except RigError as error:
        return HammerPulse(NO_SHAPE, law, (Note(Subject.PULSE_SHAPE, str(error)),))
    return HammerPulse(shape, law)


def compute_shape_error(
    pulse: HammerPulse, noise: float, half_amplitude_width: float, contact_time: float
) -> tuple[float, float]:
    """Return tau_p's uncertainty from the unknown pulse shape: the spread over possible shapes.

    The contact lasts anywhere between tau_p and the durations that are possible, evenly
    distributed. A law that the data allow, or the shapes that come nearest, say which these are.
    As they leave more of the pulse than noise, all other shapes become possible, too.

    Parameters
    ----------
    noise : float
        Of the mean trace, over its peak [-].
    half_amplitude_width, contact_time : float
        w50 and tau_p [s].

    Returns
    -------
    spread, standard : float
        Standard uncertainty by the shape, signed and alike on all samples, and of the law's
        duration [s].
    """
    law, shape = pulse.law, pulse.shape
    unexplained, own = shape.unexplained, 0.0
    durations = {
        item.name: item.pulse_factor * half_amplitude_width - contact_time for item in PULSE_SHAPES
    }
    nearest = [durations[name] for name in shape.possible]
    if law.is_known:
        durations["law"] = law.duration.value - contact_time
        nearest = [durations["law"]]
        unexplained = compute_unexplained(law.residual_percent / 100.0, noise)
        own = float(np.nan_to_num(law.duration.standard))
    near = max(nearest, key=abs, default=0.0)
    far = max(durations.values(), key=abs)
    # The side of the nearest stays, whichever side the farthest lies on.
    part = min(unexplained / LARGE_RESIDUAL, 1.0)
    size = abs(near) + (abs(far) - abs(near)) * part
    side = near if abs(near) > 1e-6 * abs(far) else far
    return math.copysign(size, side) / math.sqrt(3.0), own


@dataclass(frozen=True)
class MeanReading:
    """A mean hit, read once; its numbers are uncertain, and of one and the same hits.

    Read a second time its scatter would be another input: results that are correlated, as k1 and
    k2 of the control sample, are calculated from one reading.
    """

    mean: MeanHit
    pulse: HammerPulse
    rig: RigNumbers
    width: Known  # w50 [s]
    base_width: Known | None  # time above a hundredth of the peak [s]; None: noise hides it
    width_ratio: float
    contact_time: Known  # tau_p [s]
    decrements: Mapping[int, tuple[LogDecrement, Known]]  # by channel, where determined
    notes: Mapping[int, Note]  # by channel, where not: why


def read_mean_hit(
    mean: MeanHit, setup: RigSetup, rig: RigNumbers, sample: str, form: HammerPulse
) -> MeanReading:
    """Read pulse and peaks of the mean hit on `sample`, with their uncertainty.

    What its pulse looks like tells how far tau_p may be from the contact's duration.

    Raises
    ------
    SignalError
        If the mean hammer trace has no whole pulse.
    """
    pulse, settings = measure_pulse(mean.traces[0]), setup.analysis
    width = pulse.half_amplitude_width / mean.sampling_rate
    factor = settings.pulse_factor / mean.sampling_rate
    noise = float(mean.noise[0]) / abs(pulse.peak)
    has_scatter = len(mean.hits) >= LEAST_HITS
    later = Note(Subject.UNCERTAINTY, "it comes with the pulse's shape, later")
    reasons = (later,) if form is UNSEEN else ()
    peaks, notes = _find_peaks(mean, setup, sample)
    doubled, *changes = _make_readings(mean, settings.pulse_factor * width, factor, peaks, sample)
    quality = _describe_mean(mean, 0, settings.cutoff_frequency)
    errors = estimate_pulse_errors(mean.traces[0], pulse, quality)
    doubled = doubled + _make_errors(errors, factor, rig, doubled.u)
    clock = rig.follow(follow_series(mean)).clock
    width_number = doubled * clock / settings.pulse_factor
    # The same law on all samples makes the same error on all.
    spread, own = compute_shape_error(form, noise, width, settings.pulse_factor * width)
    contact_time = doubled + spread * rig.pulse_shape
    contact_time = contact_time + make_input(PULSE_SHAPE, 0.0, own)
    base, (rise, fall) = None, find_ends(mean.traces[0], pulse)
    # Noise of more crosses the level by itself.
    if noise < BASE / 3.0 and math.isfinite(fall - rise):
        errors = estimate_pulse_errors(mean.traces[0], pulse, quality, BASE)
        own_errors = _make_errors(errors, 1.0 / mean.sampling_rate, rig, 0.0)
        # From hit to hit it scatters as w50 does.
        base = Known(width_number * ((fall - rise) / pulse.half_amplitude_width) + own_errors)
    why = reasons if has_scatter else (ONE_HIT,)
    return MeanReading(
        mean,
        form,
        rig,
        Known(width_number),
        base,
        pulse.width_ratio,
        Known(contact_time * clock, reasons),
        {
            channel: (
                found,
                Known(change + _make_decrement_errors(mean, setup, channel, found), why),
            )
            for (channel, found), change in zip(peaks.items(), changes, strict=True)
        },
        notes,
    )


def _find_peaks(
    mean: MeanHit, setup: RigSetup, sample: str
) -> tuple[dict[int, LogDecrement], dict[int, Note]]:
    """Return the peaks of log decrements by channel, and why others have none.

    The hits on the control sample say something of both bodies, correlated; those on another
    sample are asked for that sample alone.
    """
    peaks: dict[int, LogDecrement] = {}
    notes: dict[int, Note] = {}
    for channel in (0, 1) if sample == setup.samples.control_sample else (1,):
        if channel >= mean.traces.shape[0]:
            notes[channel] = Note(Subject.C2, "the sample's trace was not measured")
            continue
        # Steps that no noise smooths make peaks of their own.
        step = compute_quantisation_error(
            float(mean.largest_step[channel]), float(mean.least_noise[channel])
        )
        try:
            found = estimate_log_decrement(
                mean.traces[channel], max(float(mean.noise[channel]), step)
            )
            check_window(mean, channel, setup.analysis.cutoff_frequency)
            _check_own_decay(mean, channel, found)
            passed = follow_mean(mean, setup.find_chains(mean.sampling_rate)) if channel else None
            if passed is not None and passed[-1].hold is Hold.FREE:
                raise NotDeterminedError(MOVES_ON)
            peaks[channel] = found
        except RigError as error:
            notes[channel] = Note(DAMPING[channel], str(error))
    return peaks, notes


def _make_readings(
    mean: MeanHit, doubled: float, factor: float, peaks: Mapping[int, LogDecrement], sample: str
) -> tuple[UncertainNumber, ...]:
    """Return F w50 [s], which is w50 in points times `factor`, and Deltas, as the hits scatter."""
    scatter = np.zeros((1 + len(peaks), 1 + len(peaks)))
    if len(mean.hits) >= LEAST_HITS:
        rows = [factor * np.array([hit.pulse.half_amplitude_width for hit in mean.hits])]
        rows += [_read_decrements(mean, channel, found) for channel, found in peaks.items()]
        scatter += np.cov(np.array(rows), ddof=1) / mean.count
    return make_ensemble(
        f"scatter of the hits on {sample}",
        [doubled, *(found.log_decrement for found in peaks.values())],
        scatter,
        max(len(mean.hits) - 1, 1),
    )


def _make_errors(
    errors: Mapping[str, float], factor: float, rig: RigNumbers, scatter: float
) -> UncertainNumber:
    """Return what is wrong with a width, in s; of noise what the hits' scatter does not hold."""
    # A known error that is not corrected (GUM F.2.4.5), alike on every sample of the rig.
    total = factor * errors[WIDENING] * rig.low_pass
    # Hits that scatter less than their noise do so by chance, or are copies of one.
    noise = factor * math.hypot(*(errors[source] for source in BY_NOISE))
    rest = math.sqrt(max(1.0 - (scatter / noise) ** 2, 0.0)) if noise else 0.0
    for source, error in errors.items():
        part = rest if source in BY_NOISE else 1.0
        if source != WIDENING and part:
            total = total + make_input(source, 0.0, part * factor * error)
    return total


def _describe_mean(mean: MeanHit, channel: int, cutoff_frequency: float) -> TraceQuality:
    """Return how well one trace of a mean hit is known."""
    return TraceQuality(
        noise=float(mean.noise[channel]),
        raw_noise=float(mean.raw_noise[channel]),
        dither=float(mean.least_noise[channel]),
        resolution=float(mean.largest_step[channel]),
        baseline_points=mean.baseline_points,
        relative_cutoff=cutoff_frequency / mean.sampling_rate,
        zero_uncertainty=0.0 if channel else float(mean.zero_uncertainty[0]),
    )


def _read_decrements(mean: MeanHit, channel: int, peaks: LogDecrement) -> FloatArray:
    """Return the log decrement of every hit, linearised about that of the mean.

    It is read at the mean's two peaks: a weak second peak may drown in one hit's noise, and the
    highest point near it would be too high.
    """
    places = [peaks.first_index, peaks.second_index]
    means = mean.traces[channel, places]
    first, second = (mean.read_hits(channel, places) / means).T
    return np.asarray(first - second)


def _make_decrement_errors(
    mean: MeanHit, setup: RigSetup, channel: int, peaks: LogDecrement
) -> UncertainNumber:
    """Return the errors of Delta that all hits share [-]."""
    quality = _describe_mean(mean, channel, setup.analysis.cutoff_frequency)
    step = compute_quantisation_error(quality.resolution, quality.dither)
    quantisation = step * math.hypot(1.0 / peaks.first_peak, 1.0 / peaks.second_peak)
    start = (quality.baseline_points - 1) / 2.0
    trend = compute_trend(mean.traces[channel], quality) * abs(
        (peaks.second_index - start) / peaks.second_peak
        - (peaks.first_index - start) / peaks.first_peak
    )
    # Between both peaks lies one period of the decay: the second is a cosine's top.
    curvature = peaks.second_peak * (2.0 * math.pi / (peaks.second_index - peaks.first_index)) ** 2
    excess = compute_peak_excess(quality.noise, curvature, quality.relative_cutoff)
    total = make_input("quantisation of the peaks", 0.0, quantisation)
    total = total + make_input("trend of the baseline", 0.0, trend)
    return total + make_input("second peak reading", 0.0, excess / peaks.second_peak)


def read_hit(hit: FilteredHit, setup: RigSetup, sample: str) -> MeanReading:
    """Read one hit on `sample`, as a series of it alone; the next may well differ by more."""
    shifted = shift_hit(hit)
    mean = make_mean(TraceSum.of([shifted]), [shifted], alone=hit)
    form = look_at_pulse(mean, setup, sample)
    return read_mean_hit(mean, setup, make_rig_numbers(setup, sample), sample, form)


def _check_own_decay(mean: MeanHit, channel: int, peaks: LogDecrement) -> None:
    """Refuse a second peak that is no decay of the body's own.

    The force on both bodies, by the end of a contact or by a second one, shows on both in
    proportion; the decay of one does not. A sample that decays from its first peak swings through
    -sqrt(U1 U2) on the way to the second; noise, a second contact or a sensor's ringing does not.

    Raises
    ------
    NotDeterminedError
        If it is none.
    """
    if mean.traces.shape[0] == 1:
        return
    ours, other = mean.traces[channel], mean.traces[1 - channel]
    first, second = peaks.first_index, peaks.second_index
    shared = ours[first] / other[first] * other[second]
    # Noise makes a quarter of the least peak.
    if abs(ours[second] - shared) < 0.5 * peaks.second_peak:
        raise NotDeterminedError(
            "no log decrement, since the second peak is no decay of the body: the force on both"
            " bodies has it, as at the end of a contact or by a second one"
        )
    swing = -float(np.min(ours[first:second] * np.sign(ours[first])))
    # The swing is 1 for a free decay; a sensor that rings with 5 % of the pulse makes a quarter.
    if channel and swing < 0.5 * math.sqrt(peaks.first_peak * peaks.second_peak):
        raise NotDeterminedError(
            "no log decrement, since the second peak is no decay of the body, which would swing"
            " to the other side before it: noise, a second contact or a sensor that rings"
        )
