"""One judged hit, and the mean of many."""

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.errors import NotDeterminedError, ParameterError, SignalError
from impact_rig.core.filtering import check_cutoff, interpolate_between, low_pass
from impact_rig.core.pulse_width import PulseWidth, measure_pulse
from impact_rig.core.records import UNSTATED, FloatArray, HitLabel, Origin, Record, make_read_only
from impact_rig.core.setup import AnalysisSettings
from impact_rig.core.tail import ZeroShift, judge_zeros
from impact_rig.core.verdict import (
    BASELINE_POINTS,
    CHANNELS,
    Reason,
    Rejection,
    check_channels,
    check_low_pass,
    check_pulse,
    check_stream,
    check_strength,
    check_tops,
)


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
    zero_uncertainty : tuple of float
        Standard uncertainty of each zero under the pulse, by what was corrected [m/s^2].
    """

    traces: FloatArray
    sampling_rate: float
    pulse: PulseWidth
    noise: FloatArray
    raw_noise: FloatArray
    resolution: FloatArray
    baseline_points: int
    zero_uncertainty: tuple[float, ...] = (0.0, 0.0)

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
        raw, filtered = _filter_record(record, baseline_stop, settings)
        hidden, changed = check_low_pass(
            raw[0], filtered.pulse, float(filtered.raw_noise[0]), record.sampling_rate, settings
        )
        filtered, corrected, unsure, tops = _correct_zero(filtered, settings, low_corners)
    except SignalError as error:
        rejections += (Rejection(Reason.TRUNCATED, str(error)),)
        return JudgedHit(record.label, rejections, record.stamp)
    pulse, peaks = filtered.pulse, np.abs(filtered.traces).max(axis=1).tolist()
    overloaded = any(item.reason is Reason.OVERLOAD for item in rejections)
    if not overloaded:
        rejections += tops
    rejections += check_strength(record, peaks, settings, overloaded=overloaded)
    against, harmless = check_pulse(
        filtered.traces[0], pulse, float(filtered.noise[0]), record.sampling_rate, settings
    )
    seen = {item.reason for item in against}
    rejections += against + tuple(item for item in hidden if item.reason not in seen)
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
        findings=corrected + harmless + changed,
    )


def _correct_zero(
    hit: FilteredHit, settings: AnalysisSettings, low_corners: Sequence[float]
) -> tuple[FilteredHit, tuple[Rejection, ...], tuple[Rejection, ...], tuple[Rejection, ...]]:
    """Take off what the zero is after the impact.

    Returns
    -------
    tuple
        The hit, what was taken off, what was not sure enough, and pulses that are flat at the top.

    Raises
    ------
    SignalError
        If no whole pulse is left.
    """
    shifts = judge_zeros(
        hit.traces, hit.pulse, hit.baseline_points, hit.raw_noise, hit.sampling_rate, settings
    )
    corrected: list[Rejection] = []
    unsure: list[Rejection] = []
    traces = hit.traces.copy()
    peaks = np.abs(traces).max(axis=1)
    left = [0.0] * len(traces)
    for channel, (name, shift) in enumerate(zip(CHANNELS, shifts, strict=False)):
        is_stated = channel < len(low_corners) and low_corners[channel] > 0.0
        if shift is None or (is_stated and shift.reason is Reason.DROOP):
            continue
        # A body that is damped comes back by itself, as a charge does.
        if channel and not (shift.stays or _is_shifted(shifts[0])):
            continue
        text = f"zero of the {name} after the impact: {shift.explanation}"
        if shift.reason is Reason.RINGING:
            corrected.append(Rejection(shift.reason, text))
            continue
        if shift.correction is None:
            # Of the sample it is in the uncertainty of its momentum.
            (corrected if channel else unsure).append(Rejection(shift.reason, text))
            left[channel] = shift.uncertainty
            continue
        corrected.append(Rejection(shift.reason, text))
        traces[channel] -= shift.correction
        left[channel] = shift.uncertainty
        if not channel and len(left) > 1 and shifts[1] is None:
            # What is corrected on one channel may be unseen on the other.
            middle = round(hit.pulse.middle)
            left[1] = float(np.abs(shift.correction[middle:]).max() * peaks[1] / peaks[0])
    # A step within the pulse makes shoulders, and what comes after a flat top may tilt it.
    came_at_once = any(shift is not None and shift.came_at_once for shift in shifts)
    tops = check_tops(traces) or (() if came_at_once else check_tops(hit.traces))
    if not corrected:
        return hit, (), tuple(unsure), tops
    traces.setflags(write=False)
    better = replace(
        hit, traces=traces, pulse=measure_pulse(traces[0]), zero_uncertainty=tuple(left)
    )
    return better, tuple(corrected), tuple(unsure), tops


def _is_shifted(shift: ZeroShift | None) -> bool:
    return shift is not None and shift.reason is not Reason.RINGING


def _filter_record(
    record: Record, baseline_stop: int, settings: AnalysisSettings
) -> tuple[FloatArray, FilteredHit]:
    """Return the traces with baseline zero, before and after the low-pass."""
    channels = [record.hammer]
    if record.specimen is not None:
        channels.append(record.specimen)
    raw = np.stack([channel.acceleration for channel in channels])
    raw -= raw[:, :baseline_stop].mean(axis=1, keepdims=True)
    traces = low_pass(raw, settings.cutoff_frequency, record.sampling_rate)
    traces.setflags(write=False)
    return raw, FilteredHit(
        traces=traces,
        sampling_rate=record.sampling_rate,
        pulse=measure_pulse(traces[0]),
        noise=traces[:, :baseline_stop].std(axis=1),
        raw_noise=np.sqrt(np.square(raw[:, :baseline_stop]).sum(axis=1) / (baseline_stop - 1)),
        resolution=np.array([channel.resolution for channel in channels]),
        baseline_points=baseline_stop,
    )


@dataclass(frozen=True)
class AveragedHit:
    """One hit as it is averaged.

    Attributes
    ----------
    scaled : ndarray of float32, shape (channels, n)
        Hammer, then sample where measured, shifted so that the middle of the hammer pulse falls
        onto a point [`scale`].
    scale : float
        A power of two, so that nothing is rounded by it [m/s^2].
    origin : int
        That point.
    sampling_rate : float
        [Hz]
    pulse : PulseWidth
        Of the hammer.
    noise, raw_noise, resolution : tuple of float
        As in `FilteredHit`, one for each channel [m/s^2].
    baseline_points : int
        Points of the baseline that was removed.
    zero_uncertainty : tuple of float
        As in `FilteredHit` [m/s^2].
    label : HitLabel or None
        Which hit it is.
    """

    scaled: NDArray[np.float32]
    scale: float
    origin: int
    sampling_rate: float
    pulse: PulseWidth
    noise: tuple[float, ...]
    raw_noise: tuple[float, ...]
    resolution: tuple[float, ...]
    baseline_points: int
    zero_uncertainty: tuple[float, ...] = (0.0, 0.0)
    label: HitLabel | None = None

    @property
    def traces(self) -> FloatArray:
        """All of them [m/s^2]."""
        return self.scale * self.scaled.astype(np.float64)


def shift_hit(hit: FilteredHit, label: HitLabel | None = None) -> AveragedHit:
    """Shift a hit by a part of a point, so that its pulse's middle falls onto one."""
    traces, origin = hit.aligned
    scale = 2.0 ** math.frexp(hit.pulse.peak)[1]
    scaled = (traces / scale).astype(np.float32)
    scaled.setflags(write=False)
    return AveragedHit(
        scaled=scaled,
        scale=scale,
        origin=origin,
        sampling_rate=hit.sampling_rate,
        pulse=hit.pulse,
        noise=tuple(hit.noise.tolist()),
        raw_noise=tuple(hit.raw_noise.tolist()),
        resolution=tuple(hit.resolution.tolist()),
        baseline_points=hit.baseline_points,
        zero_uncertainty=hit.zero_uncertainty,
        label=label,
    )


@dataclass(frozen=True)
class HitSummary:
    """What hits have in common.

    Attributes
    ----------
    count : int
        Hits.
    least_noise : ndarray, shape (channels,)
        The smallest standard deviation of a raw baseline [m/s^2].
    largest_step : ndarray, shape (channels,)
        The largest acceleration of one count [m/s^2]; 0: not known.
    square_steps : ndarray, shape (channels,)
        Sum of the squares of these accelerations [m^2/s^4].
    baseline_points : float
        Points of the baseline that all hits have, counted from the origin: 0 ends there.
    zero_uncertainty : ndarray, shape (2,)
        Sum of the uncertainties of the zeros under the pulse, alike in all [m/s^2].
    """

    count: int = 0
    least_noise: FloatArray = field(default_factory=lambda: np.array(np.inf))
    largest_step: FloatArray = field(default_factory=lambda: np.array(0.0))
    square_steps: FloatArray = field(default_factory=lambda: np.array(0.0))
    baseline_points: float = math.inf
    zero_uncertainty: FloatArray = field(default_factory=lambda: np.zeros(2))

    def add(self, hit: AveragedHit) -> Self:
        """Return the summary with one more hit."""
        return type(self)(
            count=self.count + 1,
            least_noise=np.minimum(self.least_noise, hit.raw_noise),
            largest_step=np.maximum(self.largest_step, hit.resolution),
            square_steps=self.square_steps + np.square(hit.resolution),
            baseline_points=min(self.baseline_points, hit.baseline_points - hit.origin),
            zero_uncertainty=self.zero_uncertainty + np.abs(hit.zero_uncertainty),
        )


@dataclass(frozen=True)
class MeanHit:
    """The mean of aligned hits.

    Attributes
    ----------
    traces : ndarray, shape (channels, n)
        Hammer, then sample where measured [m/s^2]; read-only.
    sampling_rate : float
        [Hz]
    origin : int
        Point at which the hammer pulses' middles were laid.
    noise : ndarray, shape (channels,)
        Standard deviation of the mean's noise, from the baselines of the hits [m/s^2].
    raw_noise : ndarray, shape (channels,)
        The same before the low-pass: white noise of this size would do the same below the
        cutoff [m/s^2].
    hits : tuple of AveragedHit
        Hits in the mean that show the scatter, in the order of arrival: all of them, or some that
        lie evenly over a long series.
    summary : HitSummary
        What all hits in the mean have in common.
    """

    traces: FloatArray
    sampling_rate: float
    origin: int
    noise: FloatArray
    raw_noise: FloatArray
    hits: tuple[AveragedHit, ...]
    summary: HitSummary = field(default_factory=HitSummary)

    @property
    def count(self) -> int:
        """Hits in the mean."""
        return self.summary.count

    @property
    def baseline_points(self) -> int:
        """Points of the mean's baseline, 1 or more."""
        return max(int(self.summary.baseline_points) + self.origin, 1)

    @property
    def zero_uncertainty(self) -> FloatArray:
        """Standard uncertainty of the hammer's zero under the pulse by corrections [m/s^2]."""
        return self.summary.zero_uncertainty / self.count

    def cut_hits(self) -> Iterator[FloatArray]:
        """Yield each of `hits` over the mean's window, of shape (channels, n)."""
        for hit in self.hits:
            first = hit.origin - self.origin
            yield hit.traces[:, first : first + self.traces.shape[1]]


@dataclass(frozen=True)
class HitSum:
    """The sum of aligned hits.

    That hits do not belong together is said when their mean is asked for.

    Attributes
    ----------
    summary : HitSummary
        What all hits in the sum have in common.
    total : ndarray, shape (channels, n)
        Sum of their traces, as long as what all have in common [m/s^2].
    origin : int
        Point at which the middles of the pulses were laid.
    variance, raw_variance : ndarray, shape (channels,)
        Sums of the squares of `noise` and `raw_noise` [m^2/s^4].
    rates, channels : frozenset
        Sampling rates [Hz] and numbers of channels that hits have: one of each, or they do not
        belong together.
    """

    summary: HitSummary = field(default_factory=HitSummary)
    total: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    origin: int = 0
    variance: FloatArray = field(default_factory=lambda: np.zeros(1))
    raw_variance: FloatArray = field(default_factory=lambda: np.zeros(1))
    rates: frozenset[float] = frozenset()
    channels: frozenset[int] = frozenset()

    def add(self, hit: AveragedHit) -> Self:
        """Return the sum with one more hit."""
        if not self.summary.count:
            total, origin = hit.traces, hit.origin
        elif hit.scaled.shape[0] != self.total.shape[0]:
            total, origin = self.total, self.origin
        else:
            origin = min(self.origin, hit.origin)
            after = min(self.total.shape[1] - self.origin, hit.scaled.shape[1] - hit.origin)
            total = (
                self.total[:, self.origin - origin : self.origin + after]
                + hit.traces[:, hit.origin - origin : hit.origin + after]
            )
        return replace(
            self,
            summary=self.summary.add(hit),
            total=total,
            origin=origin,
            variance=self.variance + np.square(hit.noise),
            raw_variance=self.raw_variance + np.square(hit.raw_noise),
            rates=self.rates | {hit.sampling_rate},
            channels=self.channels | {hit.scaled.shape[0]},
        )

    def make_mean(self, hits: Sequence[AveragedHit], alone: FilteredHit | None = None) -> MeanHit:
        """Return the mean, its scatter shown by `hits`, in the order of arrival.

        Parameters
        ----------
        alone : FilteredHit, optional
            The hit in the mean where there is one: it is not shifted, which would cost some of a
            coarse pulse's peak.

        Raises
        ------
        NotDeterminedError
            If there is no hit.
        SignalError
            If the hits do not belong together.
        """
        count = self.summary.count
        if not count:
            raise NotDeterminedError("mean trace: no hit was accepted")
        if len(self.rates) > 1 or len(self.channels) > 1:
            raise SignalError(
                f"hits sampled at {sorted(self.rates)} Hz with {sorted(self.channels)} channels"
                " cannot be averaged: all hits of a sample need the same"
            )
        traces = self.total / count
        if alone is not None:
            traces = alone.traces
            scaled = (traces / hits[0].scale).astype(np.float32)
            scaled.setflags(write=False)
            hits = [replace(hits[0], scaled=scaled)]
        return MeanHit(
            traces=make_read_only(traces),
            sampling_rate=next(iter(self.rates)),
            origin=self.origin,
            noise=make_read_only(np.sqrt(self.variance) / count),
            raw_noise=make_read_only(np.sqrt(self.raw_variance) / count),
            hits=tuple(hits),
            summary=self.summary,
        )


def average_hits(hits: Sequence[FilteredHit]) -> MeanHit:
    """Align hits on the midpoints of their half-amplitude crossings and average them.

    Parameters
    ----------
    hits : sequence of FilteredHit
        All at one sampling rate and with the same channels.

    Returns
    -------
    MeanHit
        As long as what all hits have in common.

    Raises
    ------
    NotDeterminedError
        If there is no hit.
    SignalError
        If the hits do not belong together.
    """
    total = HitSum()
    shifted = [shift_hit(hit) for hit in hits]
    for hit in shifted:
        total = total.add(hit)
    return total.make_mean(shifted)


@dataclass(frozen=True)
class Overrules:
    """Hits accepted or rejected by hand.

    Attributes
    ----------
    accepted, rejected : frozenset of HitLabel
        In the mean whatever the analysis says, and not in it.
    """

    accepted: frozenset[HitLabel] = frozenset()
    rejected: frozenset[HitLabel] = frozenset()

    def __post_init__(self) -> None:
        """Refuse a hit that is named in both."""
        for label in self.accepted & self.rejected:
            raise ParameterError(
                f"hit {describe_label(label)} is both accepted and rejected by hand: choose one"
            )


NO_OVERRULES = Overrules()
"""No hit is accepted or rejected by hand."""


def describe_label(label: HitLabel) -> str:
    """Return ``17 (steel small/3.1)``: record, sample, impact and attempt."""
    return f"{label.record} ({label.sample}/{label.impact}.{label.attempt})"


def find_label(name: str, labels: Collection[HitLabel]) -> HitLabel:
    """Find a hit by name.

    Parameters
    ----------
    name : str
        The number of its record, or ``SAMPLE/IMPACT`` where there was one attempt, or
        ``SAMPLE/IMPACT.ATTEMPT``.
    labels : collection of HitLabel
        Of all hits.

    Raises
    ------
    ParameterError
        If no hit is called so, or several are.
    """
    found = [label for label in dict.fromkeys(labels) if _is_called(label, name)]
    if len(found) == 1:
        return found[0]
    if found:
        raise ParameterError(
            f"hit {name!r} may be any of {', '.join(map(describe_label, found))}: name one of"
            " them, by its record or as SAMPLE/IMPACT.ATTEMPT"
        )
    records = sorted({label.record for label in labels})
    known = f"records {records[0]} to {records[-1]}" if records else "none"
    raise ParameterError(
        f"there is no hit {name!r}: name one by the number of its record or as SAMPLE/IMPACT or"
        f" SAMPLE/IMPACT.ATTEMPT, for example 17 or 'steel small/3.1'; there are {known}"
    )


def make_overrules(
    accept: Sequence[str], reject: Sequence[str], labels: Collection[HitLabel]
) -> Overrules:
    """Return overrules of hits by name; see `find_label` and `Overrules` for errors."""
    return Overrules(
        frozenset(find_label(name, labels) for name in accept),
        frozenset(find_label(name, labels) for name in reject),
    )


def overrule_hit(hit: JudgedHit, overrules: Overrules) -> JudgedHit:
    """Return a hit as it is accepted or rejected by hand.

    Raises
    ------
    ParameterError
        If a hit is to be accepted that has no pulse that could be measured, or the other sign.
    """
    if hit.label in overrules.rejected:
        return replace(
            hit, rejections=(*hit.rejections, Rejection(Reason.OPERATOR, "left out by hand"))
        )
    if hit.label not in overrules.accepted:
        return hit
    if hit.filtered is None:
        why = "; ".join(map(str, hit.rejections))
        raise ParameterError(
            f"hit {describe_label(hit.label)} cannot be accepted by hand: it has no pulse that"
            f" could be measured ({why})"
        )
    if any(item.reason is Reason.POLARITY for item in hit.rejections):
        raise ParameterError(
            f"hit {describe_label(hit.label)} cannot be accepted by hand: a mean of both signs is"
            " of neither; turns_polarity = true under [analysis] turns it"
        )
    confirmed = Rejection(Reason.OPERATOR, "accepted by hand")
    return replace(hit, rejections=(), overruled=(*hit.rejections, confirmed))


def describe_overruled(hit: JudgedHit, name: str) -> str:
    """Say that the hit called `name` is in the mean by hand, and what was against it."""
    against = "; ".join(
        str(rejection) for rejection in hit.overruled if rejection.reason is not Reason.OPERATOR
    )
    what = f"although {against}" if against else "with nothing against it"
    return f"{name} accepted by hand, {what}"


def _is_called(label: HitLabel, name: str) -> bool:
    place = f"{label.sample}/{label.impact}"
    return name in (str(label.record), place, f"{place}.{label.attempt}")
