"""One hit as it was recorded, filtered and judged."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from impact_rig.core.given.errors import ParameterError, SignalError
from impact_rig.core.given.filtering import check_cutoff, interpolate_between, low_pass
from impact_rig.core.given.findings import Finding, Reason
from impact_rig.core.given.records import (
    NO_SPEED,
    UNSTATED,
    FloatArray,
    HitLabel,
    MeasuredSpeed,
    Origin,
    Record,
)
from impact_rig.core.given.sensors import SensorResponse
from impact_rig.core.given.setup import AnalysisSettings
from impact_rig.core.hit.detection import LOUD_BEGINNING
from impact_rig.core.hit.pulse_width import BASELINE_POINTS, PulseWidth, measure_pulse
from impact_rig.core.hit.tail import judge_zeros
from impact_rig.core.hit.verdict import (
    CHANNELS,
    check_channels,
    check_low_pass,
    check_pulse,
    check_stream,
    check_strength,
    check_tops,
    shows_plateau,
)


@dataclass(frozen=True)
class FilteredHit:
    """Traces of one hit, filtered, its baseline zero; accelerations are in m/s^2."""

    traces: FloatArray  # (channels, n): hammer, then sample where measured; float32 once shifted
    sampling_rate: float  # [Hz]
    pulse: PulseWidth  # of the hammer
    noise: FloatArray  # (channels,), standard deviation of the filtered baseline
    raw_noise: FloatArray  # the same before the low-pass
    resolution: FloatArray  # (channels,), acceleration of one count; 0: not known
    baseline_points: int  # of the baseline that was removed
    zero_uncertainty: tuple[float, float] = (0.0, 0.0)  # of each zero under the pulse, standard
    label: HitLabel | None = None
    impact_speed: MeasuredSpeed = NO_SPEED  # of the hammer
    origin: int = 0  # point of the pulse's middle, once the hit is shifted

    def align(self) -> tuple[FloatArray, int]:
        """Return the traces shifted so that the pulse's middle falls onto a point, and that point.

        By cubic splines, which follow filtered traces.
        """
        origin = math.floor(self.pulse.middle)
        fraction = self.pulse.middle - origin
        return (interpolate_between(self.traces, fraction) if fraction else self.traces), origin


@dataclass(frozen=True, slots=True)
class JudgedHit:
    """One hit with its verdict; NaN: not determined."""

    label: HitLabel
    rejections: tuple[Finding, ...]  # every reason against it; empty: accepted
    stamp: int = 0  # of the record's first point [ns since the epoch]
    impact_time: float = math.nan  # middle of the hammer's pulse, from the first point [s]
    contact_time: float = math.nan  # tau_p of this hit alone [s]
    half_amplitude_width: float = math.nan  # w50 of this hit alone [s]
    width_ratio: float = math.nan  # w10 / w50 [-]
    hammer_peak: float = math.nan  # largest |acceleration| after the low-pass [m/s^2]
    specimen_peak: float = math.nan
    impact_speed: MeasuredSpeed = NO_SPEED  # of the hammer, at this hit
    sample_mass: float = math.nan  # m2 by the traces of this hit, accelerometer included [kg]
    filtered: FilteredHit | None = None  # of a hit with a pulse, rejected or not
    overruled: tuple[Finding, ...] = ()  # reasons that were set aside by hand
    findings: tuple[Finding, ...] = ()  # what was corrected, or may be harmless
    origin: Origin = UNSTATED

    @property
    def accepted(self) -> bool:
        """Whether the hit goes into the mean."""
        return not self.rejections


def judge_hit(
    record: Record, settings: AnalysisSettings, responses: Sequence[SensorResponse] = ()
) -> JudgedHit:
    """Remove the baseline, filter, measure the pulse and name every reason against the hit.

    Parameters
    ----------
    record : Record
        As cut out of the stream.
    responses : sequence of SensorResponse
        Of the channels, as far as they are stated. The droop of a lower corner that is stated
        stays: models are sent through it.

    Returns
    -------
    JudgedHit

    """
    found = check_stream(record)
    if any(item.reason is not Reason.GAP for item in found):
        return JudgedHit(record.label, tuple(found), record.stamp)
    try:
        check_cutoff(settings.cutoff_frequency, record.sampling_rate)
    except ParameterError as error:
        found.append(Finding(Reason.FEW_POINTS, str(error)))
        return JudgedHit(record.label, tuple(found), record.stamp)
    found += check_channels(record)
    overloaded = any(item.reason is Reason.OVERLOAD for item in found)
    if record.pulse_index is None:
        return JudgedHit(record.label, tuple(found), record.stamp)
    try:
        raw, filtered, doubtful = _filter_raw(record, settings)
        hidden = check_low_pass(
            raw[0], filtered.pulse, float(filtered.raw_noise[0]), record.sampling_rate, settings
        )
        hit, zeros = _correct_zero(filtered, settings, responses)
    except SignalError as error:
        found.append(Finding(Reason.TRUNCATED, str(error)))
        return JudgedHit(record.label, tuple(found), record.stamp)
    pulse, peaks = hit.pulse, np.abs(hit.traces).max(axis=1).tolist()
    noise = float(hit.noise[0])
    # What comes after a flat top may tilt it.
    flat = check_tops(hit.traces) or (check_tops(filtered.traces) if zeros else [])
    if flat and not overloaded and not shows_plateau(record):
        found += flat
    found += check_strength(record, peaks, noise, settings, overloaded=overloaded)
    course = check_pulse(hit.traces[0], pulse, noise, record.sampling_rate, settings)
    seen = {item.reason for item in course if not item.is_harmless}
    found += doubtful + [item for item in zeros if item.is_harmless] + course
    found += [item for item in hidden if item.reason not in seen]
    rejections = [item for item in found if not item.is_harmless]
    width = pulse.half_amplitude_width / record.sampling_rate
    return JudgedHit(
        label=record.label,
        # Whatever else is wrong may show in the tail.
        rejections=tuple(rejections or [item for item in zeros if not item.is_harmless]),
        stamp=record.stamp,
        impact_time=pulse.middle / record.sampling_rate,
        contact_time=settings.pulse_factor * width,
        half_amplitude_width=width,
        width_ratio=pulse.width_ratio,
        hammer_peak=peaks[0],
        specimen_peak=peaks[1] if len(peaks) > 1 else math.nan,
        filtered=hit,
        findings=tuple(item for item in found if item.is_harmless),
    )


def _correct_zero(
    hit: FilteredHit, settings: AnalysisSettings, responses: Sequence[SensorResponse]
) -> tuple[FilteredHit, list[Finding]]:
    """Subtract each sensor's level after the impact.

    Returns
    -------
    tuple
        The hit, what was taken off, and, against the hit, what was not sure enough.

    Raises
    ------
    SignalError
        If no whole pulse is left.
    """
    shifts = judge_zeros(
        hit.traces, hit.pulse, hit.baseline_points, hit.raw_noise, hit.sampling_rate, settings
    )
    found: list[Finding] = []
    traces = hit.traces.copy()
    peaks = np.abs(traces).max(axis=1)
    left = list(hit.zero_uncertainty)
    for channel, (name, shift) in enumerate(zip(CHANNELS, shifts, strict=False)):
        is_stated = channel < len(responses) and responses[channel].low_corner > 0.0
        if shift is None or (is_stated and shift.reason is Reason.DROOP):
            continue
        # A body that is damped comes back by itself, as a charge does.
        if channel and not shift.stays and not shifts[0]:
            continue
        # What is not sure of the sample is in the uncertainty of its momentum.
        is_harmless = bool(channel or shift.correction is not None)
        text = f"zero of the {name} after the impact: {shift.explanation}"
        found.append(Finding(shift.reason, text, is_harmless))
        left[channel] = math.hypot(left[channel], shift.uncertainty)
        if shift.correction is None:
            continue
        traces[channel] -= shift.correction
        if not channel and len(traces) > 1 and shifts[1] is None:
            # What is corrected on one channel may be unseen on the other.
            middle = round(hit.pulse.middle)
            left[1] = float(np.abs(shift.correction[middle:]).max() * peaks[1] / peaks[0])
    if not any(item.is_harmless for item in found):
        return hit, found
    traces.setflags(write=False)
    pulse = measure_pulse(traces[0])
    return replace(hit, traces=traces, pulse=pulse, zero_uncertainty=(left[0], left[1])), found


def _filter_raw(
    record: Record, settings: AnalysisSettings
) -> tuple[FloatArray, FilteredHit, list[Finding]]:
    """Return the traces with baseline zero before and after the low-pass, and what is doubtful.

    Raises
    ------
    SignalError
        If the record has no baseline, or no whole pulse.
    """
    # The pulse starts before it reaches the detection level.
    baseline_stop = int(0.7 * (record.pulse_index or 0))
    if baseline_stop < BASELINE_POINTS:
        raise SignalError("the record starts too late for a baseline")
    raw = np.stack([channel.acceleration for channel in record.channels])
    quiet, findings = slice(0, baseline_stop), []
    zero_uncertainty = (0.0, 0.0)
    if _begins_within_pulse(raw[0], baseline_stop):
        quiet = slice(-baseline_stop, None)
        text = "the record begins within the pulse: its zero is that of the record's end"
        findings.append(Finding(Reason.TRUNCATED, text, is_harmless=True))
        # The zero before the impact lies anywhere between that and the beginning's.
        apart = raw[:, :baseline_stop].mean(axis=1) - raw[:, quiet].mean(axis=1)
        hammer, *others = (np.abs(apart) / math.sqrt(12.0)).tolist()
        zero_uncertainty = (hammer, others[0] if others else 0.0)
    raw -= raw[:, quiet].mean(axis=1, keepdims=True)
    traces = low_pass(raw, settings.cutoff_frequency, record.sampling_rate)
    traces.setflags(write=False)
    hit = FilteredHit(
        traces=traces,
        sampling_rate=record.sampling_rate,
        pulse=measure_pulse(traces[0]),
        noise=traces[:, quiet].std(axis=1),
        raw_noise=np.sqrt(np.square(raw[:, quiet]).sum(axis=1) / (baseline_stop - 1)),
        resolution=np.array([channel.resolution for channel in record.channels]),
        baseline_points=baseline_stop,
        zero_uncertainty=zero_uncertainty,
        label=record.label,
        impact_speed=record.impact_speed,
    )
    return raw, hit, findings


def _begins_within_pulse(hammer: FloatArray, baseline_stop: int) -> bool:
    """Return whether what precedes the pulse is no baseline, but its slow foot."""
    first, last = (float(part.std()) for part in (hammer[:baseline_stop], hammer[-baseline_stop:]))
    height = float(hammer.max() - hammer.min())
    # A zero that is off by 2e-3 of the height changes tau_p by 0.15 %.
    return first > max(LOUD_BEGINNING * last, 2e-3 * height)
