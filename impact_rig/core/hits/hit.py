"""One hit from raw record to verdict: baseline, low-pass, pulse, alignment, reasons."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from impact_rig.core.errors import SignalError
from impact_rig.core.hits.pulse_width import PulseWidth, measure_pulse
from impact_rig.core.hits.reasons import Reason, Rejection
from impact_rig.core.hits.verdict import (
    BASELINE_POINTS,
    CHANNELS,
    check_channels,
    check_pulse,
    check_stream,
    check_strength,
)
from impact_rig.core.hits.zero import judge_zeros
from impact_rig.core.origin import UNSTATED, Origin
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.filtering import check_cutoff, interpolate_between, low_pass
from impact_rig.core.signals.record import FloatArray, HitLabel, Record


def align_traces(traces: FloatArray, middle: float) -> tuple[FloatArray, int]:
    """Shift traces by a part of a point so that `middle` falls onto a point.

    Parameters
    ----------
    traces : ndarray, shape (channels, n)
        Filtered, so that cubic splines follow them.
    middle : float
        In points, fractional.

    Returns
    -------
    traces : ndarray, shape (channels, n - 1 or n)
        By cubic splines; exact where the shift is zero.
    origin : int
        The point of the middle.
    """
    origin = int(np.floor(middle))
    fraction = middle - origin
    if fraction == 0.0:
        return traces, origin
    return interpolate_between(traces, fraction), origin


BASELINE_PART = 0.7
"""Part of what precedes the detected pulse that is baseline [-], our choice: the pulse starts
before it reaches the detection level."""


@dataclass(frozen=True)
class FilteredHit:
    """Traces of one hit, ready to be averaged.

    Attributes
    ----------
    traces : ndarray, shape (channels, n)
        Hammer, then sample where measured: filtered, baseline zero [m/s^2].
    sampling_rate : float
        [Hz]
    pulse : PulseWidth
        Of the hammer.
    noise : ndarray, shape (channels,)
        Standard deviation of the filtered baseline [m/s^2].
    raw_noise : ndarray, shape (channels,)
        The same before the low-pass [m/s^2].
    resolution : ndarray, shape (channels,)
        Acceleration of one count [m/s^2]; 0: not known.
    baseline_points : int
        Points of the baseline that was removed.
    zero_uncertainty : float
        Standard uncertainty of the hammer's zero under the pulse by what was corrected [m/s^2].
    """

    traces: FloatArray
    sampling_rate: float
    pulse: PulseWidth
    noise: FloatArray
    raw_noise: FloatArray
    resolution: FloatArray
    baseline_points: int
    zero_uncertainty: float = 0.0

    @cached_property
    def aligned(self) -> tuple[FloatArray, int]:
        """Traces shifted so that the pulse's middle falls onto a point, and that point.

        Kept, since every new hit of a sample is averaged with all before it.
        """
        return align_traces(self.traces, self.pulse.middle)


@dataclass(frozen=True, slots=True)
class JudgedHit:
    """One hit with its verdict.

    Attributes
    ----------
    label : HitLabel
        Which hit.
    rejections : tuple of Rejection
        Every reason against it; empty: accepted.
    stamp : int
        Time of the record's first point, nanoseconds since the epoch.
    impact_time : float
        Middle of the hammer pulse from the record's first point [s]; NaN: no pulse.
    contact_time : float
        tau_p of this hit alone [s]; NaN: not determined.
    half_amplitude_width : float
        w50 of this hit alone [s]; NaN: not determined.
    width_ratio : float
        w10 / w50 [-]; NaN: not determined.
    hammer_peak, specimen_peak : float
        Largest |acceleration| after the low-pass [m/s^2]; NaN: no pulse, or not measured.
    filtered : FilteredHit or None
        The traces of a hit whose pulse could be measured, rejected or not.
    overruled : tuple of Rejection
        Reasons that were set aside by hand; empty: none.
    findings : tuple of Rejection
        What is not as it should be and was corrected, or cannot be told from what is harmless.
    origin : Origin
        Where its points come from.
    """

    label: HitLabel
    rejections: tuple[Rejection, ...]
    stamp: int = 0
    impact_time: float = math.nan
    contact_time: float = math.nan
    half_amplitude_width: float = math.nan
    width_ratio: float = math.nan
    hammer_peak: float = math.nan
    specimen_peak: float = math.nan
    filtered: FilteredHit | None = None
    overruled: tuple[Rejection, ...] = ()
    findings: tuple[Rejection, ...] = ()
    origin: Origin = UNSTATED

    @property
    def accepted(self) -> bool:
        """Whether the hit goes into the mean."""
        return not self.rejections


def judge_hit(
    record: Record, settings: AnalysisSettings, low_corners: Sequence[float] = ()
) -> JudgedHit:
    """Remove the baseline, filter, measure the pulse and name every reason against the hit.

    Parameters
    ----------
    record : Record
        As cut out of the stream.
    low_corners : sequence of float
        Stated lower corners of the channels [Hz]; 0: not stated. The droop of one that is stated
        stays: models are sent through it.

    Returns
    -------
    JudgedHit

    Raises
    ------
    ParameterError
        If the sampling rate is too low for the low-pass.
    """
    check_cutoff(settings.cutoff_frequency, record.sampling_rate)
    rejections = check_stream(record)
    if any(item.reason is not Reason.GAP for item in rejections):
        return JudgedHit(record.label, rejections, record.stamp)
    rejections += check_channels(record, settings)
    if record.pulse_index is None:
        return JudgedHit(record.label, rejections, record.stamp)
    baseline_stop = int(BASELINE_PART * record.pulse_index)
    if baseline_stop < BASELINE_POINTS:
        rejections += (Rejection(Reason.TRUNCATED, "the record starts too late for a baseline"),)
        return JudgedHit(record.label, rejections, record.stamp)
    try:
        filtered = _filter_record(record, baseline_stop, settings)
        filtered, corrected, unsure = _correct_zero(filtered, settings, low_corners)
    except SignalError as error:
        rejections += (Rejection(Reason.TRUNCATED, str(error)),)
        return JudgedHit(record.label, rejections, record.stamp)
    pulse, peaks = filtered.pulse, np.abs(filtered.traces).max(axis=1).tolist()
    overloaded = any(item.reason is Reason.OVERLOAD for item in rejections)
    rejections += check_strength(record, peaks, settings, overloaded=overloaded)
    against, harmless = check_pulse(
        filtered.traces[0], pulse, float(filtered.noise[0]), record.sampling_rate, settings
    )
    rejections += against
    if not rejections:
        # Whatever else is wrong may show in the tail.
        rejections += unsure
    width = pulse.half_amplitude_width / record.sampling_rate
    return JudgedHit(
        label=record.label,
        rejections=rejections,
        stamp=record.stamp,
        impact_time=pulse.middle / record.sampling_rate,
        contact_time=settings.pulse_factor * width,
        half_amplitude_width=width,
        width_ratio=pulse.width_ratio,
        hammer_peak=peaks[0],
        specimen_peak=peaks[1] if len(peaks) > 1 else math.nan,
        filtered=filtered,
        findings=corrected + harmless,
    )


def _correct_zero(
    hit: FilteredHit, settings: AnalysisSettings, low_corners: Sequence[float]
) -> tuple[FilteredHit, tuple[Rejection, ...], tuple[Rejection, ...]]:
    """Take off what the zero is after the impact; return what was, and what was not sure enough.

    Raises
    ------
    SignalError
        If no whole pulse is left.
    """
    corrected, unsure, traces = [], [], hit.traces
    zero_uncertainty = 0.0
    shifts = judge_zeros(
        traces,
        hit.pulse,
        hit.baseline_points,
        hit.raw_noise,
        hit.sampling_rate,
        settings,
    )
    for channel, (name, shift) in enumerate(zip(CHANNELS, shifts, strict=False)):
        is_stated = channel < len(low_corners) and low_corners[channel] > 0.0
        if shift is None or (is_stated and shift.reason is Reason.DROOP):
            continue
        named = Rejection(
            shift.reason, f"zero of the {name} after the impact: {shift.explanation}"
        )
        # A sample that is damped, or rings, comes back by itself as a charge does.
        is_own = channel > 0 and shift.reason is Reason.ZERO_SHIFT and shifts[0] is None
        if shift.correction is None or is_own:
            if channel == 0:
                unsure.append(named)
            continue
        corrected.append(named)
        traces = traces.copy()
        traces[channel] -= shift.correction
        if channel == 0:
            zero_uncertainty = shift.uncertainty
    if not corrected:
        return hit, (), tuple(unsure)
    traces.setflags(write=False)
    better = replace(
        hit, traces=traces, pulse=measure_pulse(traces[0]), zero_uncertainty=zero_uncertainty
    )
    return better, tuple(corrected), tuple(unsure)


def _filter_record(record: Record, baseline_stop: int, settings: AnalysisSettings) -> FilteredHit:
    channels = [record.hammer]
    if record.specimen is not None:
        channels.append(record.specimen)
    raw = np.stack([channel.acceleration for channel in channels])
    raw -= raw[:, :baseline_stop].mean(axis=1, keepdims=True)
    traces = low_pass(raw, settings.cutoff_frequency, record.sampling_rate)
    traces.setflags(write=False)
    return FilteredHit(
        traces=traces,
        sampling_rate=record.sampling_rate,
        pulse=measure_pulse(traces[0]),
        noise=traces[:, :baseline_stop].std(axis=1),
        raw_noise=np.sqrt(np.square(raw[:, :baseline_stop]).sum(axis=1) / (baseline_stop - 1)),
        resolution=np.array([channel.resolution for channel in channels]),
        baseline_points=baseline_stop,
    )
