"""Contact time and log decrements of a mean hit with their uncertainties.

Type A is the scatter of the hits, all quantities of one series taken as one correlated ensemble.
Type B is what all hits have in common: quantisation, a baseline that is not level, sampling, the
low-pass, the clock. What is random from hit to hit is in the scatter already.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from impact_rig.core.arithmetic import UncertainNumber
from impact_rig.core.damping.log_decrement import LogDecrement
from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.hits.hit import FilteredHit
from impact_rig.core.hits.pulse_uncertainty import (
    PulseErrors,
    TraceQuality,
    compute_peak_excess,
    compute_quantisation_error,
    compute_trend,
    estimate_pulse_errors,
)
from impact_rig.core.hits.pulse_width import PulseWidth
from impact_rig.core.hits.zero import ZERO_AFTER
from impact_rig.core.quantity import Quantity
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.record import FloatArray
from impact_rig.core.uncertainty.results import compute_quantity, make_ensemble, make_input

LEAST_HITS = 2
"""Hits that have a scatter [-]."""
ONE_HIT = (
    "uncertainty: not determined, since one accepted hit shows no scatter; it takes"
    f" {LEAST_HITS} or more"
)
PULSE_SHAPE = "shape of the pulse"
"""Source of what another shape than the paper's makes of tau_p."""
LARGEST_STEP = 0.1
"""Quantisation error of the second peak, part of it, up to which its logarithm is taken as linear
[-], our choice: without noise to smooth the converter's steps, a peak of three counts."""


@dataclass(frozen=True)
class ContactNumbers:
    """What the hits of one series say, as uncertain numbers with their correlation.

    Attributes
    ----------
    contact_time : UncertainNumber
        tau_p [s], clock included.
    log_decrements : mapping of int to UncertainNumber
        Delta [-] by channel, where its uncertainty is determined.
    notes : mapping of int to str
        By channel, where not: why.
    """

    contact_time: UncertainNumber
    log_decrements: Mapping[int, UncertainNumber] = field(default_factory=dict)
    notes: Mapping[int, str] = field(default_factory=dict)


def estimate_contact_numbers(
    mean: MeanHit,
    pulse: PulseWidth,
    decrements: Mapping[int, LogDecrement],
    settings: AnalysisSettings,
    clock_uncertainty: float,
    sample: str,
    shape_error: tuple[float, float] = (0.0, 0.0),
) -> ContactNumbers:
    """Estimate tau_p and log decrements of a mean hit with their uncertainties.

    Parameters
    ----------
    decrements : mapping of int to LogDecrement
        Peaks of the mean traces by channel.
    settings : AnalysisSettings
        `pulse_factor` and `cutoff_frequency` are used.
    clock_uncertainty : float
        Relative standard uncertainty of the sampling rate [-].
    shape_error : tuple of float
        Standard uncertainty of tau_p by the shapes that the pulse may have, signed, and that of
        this sample's own contact [s].

    Raises
    ------
    NotDeterminedError
        If there is one hit only.
    """
    if len(mean.hits) < LEAST_HITS:
        raise NotDeterminedError(ONE_HIT)
    factor = settings.pulse_factor / mean.sampling_rate
    channels = sorted(decrements)
    estimates = [factor * pulse.half_amplitude_width]
    estimates += [decrements[channel].log_decrement for channel in channels]
    rows = [[factor * hit.pulse.half_amplitude_width for hit in mean.hits]]
    rows += _read_decrements(mean, decrements)
    scatter = np.atleast_2d(np.cov(np.array(rows), ddof=1)) / mean.count
    contact_time, *changes = make_ensemble(
        f"scatter of the hits on {sample}", estimates, scatter, len(rows[0]) - 1, owner=sample
    )
    errors = estimate_pulse_errors(
        mean.traces[0], pulse, _describe_mean(mean, 0, settings.cutoff_frequency)
    )
    contact_time = contact_time + _make_common_errors(errors, factor, sample)
    if any(shape_error):
        # The same law on all samples makes the same error on all.
        contact_time = contact_time + shape_error[0] * make_input(PULSE_SHAPE, 0.0, 1.0)
        contact_time = contact_time + make_input(PULSE_SHAPE, 0.0, shape_error[1], sample)
    clock = make_input("sampling clock", 1.0, clock_uncertainty)
    numbers: dict[int, UncertainNumber] = {}
    notes: dict[int, str] = {}
    for channel, change in zip(channels, changes, strict=True):
        quality = _describe_mean(mean, channel, settings.cutoff_frequency)
        try:
            numbers[channel] = change + _make_decrement_errors(
                mean.traces[channel], decrements[channel], quality, f"{sample} {channel}"
            )
        except NotDeterminedError as error:
            notes[channel] = str(error)
    return ContactNumbers(contact_time * clock, numbers, notes)


def estimate_hit_contact_time(
    hit: FilteredHit, settings: AnalysisSettings, clock_uncertainty: float
) -> Quantity:
    """Estimate tau_p of one hit [s], as it was; the next may well differ by more.

    Parameters
    ----------
    settings : AnalysisSettings
        `pulse_factor` and `cutoff_frequency` are used.
    clock_uncertainty : float
        Relative standard uncertainty of the sampling rate [-].
    """
    factor = settings.pulse_factor / hit.sampling_rate
    quality = TraceQuality(
        noise=float(hit.noise[0]),
        raw_noise=float(hit.raw_noise[0]),
        dither=float(hit.raw_noise[0]),
        resolution=float(hit.resolution[0]),
        baseline_points=hit.baseline_points,
        relative_cutoff=settings.cutoff_frequency / hit.sampling_rate,
        zero_uncertainty=hit.zero_uncertainty,
    )
    errors = estimate_pulse_errors(hit.traces[0], hit.pulse, quality)
    number = factor * hit.pulse.half_amplitude_width + _make_common_errors(errors, factor, "hit")
    number = number + make_input("noise", 0.0, factor * errors.noise, "hit")
    number = number + make_input("zero of the baseline", 0.0, factor * errors.zero, "hit")
    return compute_quantity(
        settings.pulse_factor * (hit.pulse.half_amplitude_width / hit.sampling_rate),
        number * make_input("sampling clock", 1.0, clock_uncertainty),
    )


def _make_common_errors(errors: PulseErrors, factor: float, owner: str) -> UncertainNumber:
    """Return what is wrong with all hits of a series alike, in s."""
    total = make_input("quantisation", 0.0, factor * errors.quantisation, owner)
    total = total + make_input("trend of the baseline", 0.0, factor * errors.trend, owner)
    total = total + make_input("sampling", 0.0, factor * errors.sampling, owner)
    total = total + make_input("peak reading", 0.0, factor * errors.peak_reading, owner)
    if errors.correction:
        total = total + make_input(ZERO_AFTER, 0.0, factor * errors.correction, owner)
    # A known error that is not corrected (GUM F.2.4.5), alike on every sample of the rig.
    return total + factor * errors.low_pass * make_input("low-pass", 0.0, 1.0)


def _describe_mean(mean: MeanHit, channel: int, cutoff_frequency: float) -> TraceQuality:
    """Return how well one trace of a mean hit is known."""
    return TraceQuality(
        noise=float(mean.noise[channel]),
        raw_noise=float(mean.raw_noise[channel]),
        dither=float(mean.summary.least_noise[channel]),
        resolution=float(mean.summary.largest_step[channel]),
        baseline_points=mean.baseline_points,
        relative_cutoff=cutoff_frequency / mean.sampling_rate,
        zero_uncertainty=0.0 if channel else mean.zero_uncertainty,
    )


def _read_decrements(mean: MeanHit, decrements: Mapping[int, LogDecrement]) -> list[list[float]]:
    """Return Delta of every hit, shape (channels, hits), about that of the mean.

    Read at the mean's two peaks and linearised: a weak second peak may drown in one hit's noise,
    and the highest point near it would be too high.
    """
    if not decrements:
        return []
    cuts = list(mean.cut_hits())
    rows = []
    for channel in sorted(decrements):
        peaks = decrements[channel]
        first = float(mean.traces[channel, peaks.first_index])
        second = float(mean.traces[channel, peaks.second_index])
        rows.append(
            [
                float(cut[channel, peaks.first_index]) / first
                - float(cut[channel, peaks.second_index]) / second
                for cut in cuts
            ]
        )
    return rows


def _make_decrement_errors(
    trace: FloatArray, peaks: LogDecrement, quality: TraceQuality, owner: str
) -> UncertainNumber:
    """Return what is wrong with Delta in all hits alike [-]."""
    step = compute_quantisation_error(quality.resolution, quality.dither)
    if step > LARGEST_STEP * peaks.second_peak:
        raise NotDeterminedError(
            "uncertainty of zeta and c: not determined, since the second peak is"
            f" {peaks.second_peak / quality.resolution:.2g} counts high and no noise smooths the"
            " converter's steps; use a smaller full scale"
        )
    quantisation = step * math.hypot(1.0 / peaks.first_peak, 1.0 / peaks.second_peak)
    start = (quality.baseline_points - 1) / 2.0
    trend = compute_trend(trace, quality) * abs(
        (peaks.second_index - start) / peaks.second_peak
        - (peaks.first_index - start) / peaks.first_peak
    )
    # Between both peaks lies one period of the decay: the second is a cosine's top.
    curvature = peaks.second_peak * (2.0 * math.pi / (peaks.second_index - peaks.first_index)) ** 2
    excess = compute_peak_excess(quality.noise, curvature, quality.relative_cutoff)
    total = make_input("quantisation of the peaks", 0.0, quantisation, owner)
    total = total + make_input("trend of the baseline", 0.0, trend, owner)
    return total + make_input("second peak reading", 0.0, excess / peaks.second_peak, owner)
