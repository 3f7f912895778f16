"""Traces behind results: of hits, of samples with their models and laws; a campaign with them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.estimates.contact_law import ContactLaw
from impact_rig.core.estimates.law_pulses import LossForm, compute_pulses, find_places
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.records import Block, FloatArray, HitLabel
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.judging import FilteredHit
from impact_rig.core.hit.overrules import Overrule
from impact_rig.core.hit.pulse_width import measure_pulse
from impact_rig.core.hit.pulses import compute_pulse
from impact_rig.core.mean.mean_hit import MeanHit
from impact_rig.results.campaign import HitResults, Results

Float32Array = NDArray[np.float32]

LARGEST_RECORD = 1_000_000
"""Most points of a record that are shown [-], our choice: 0.4 s at the paper's rate, two hundred
times its record. What follows is left out of the view only."""


@dataclass(frozen=True)
class ChannelScale:
    """How the output of one channel becomes acceleration: scale times output plus offset."""

    name: str  # "hammer" or "sample"
    sampling_rate: float  # [Hz]
    is_counted: bool  # the output is counts of a digitizer
    scale: float  # per unit of the output [m/s^2]
    offset: float  # at zero output [m/s^2]
    full_scale: float  # largest acceleration that it can show, either sign [m/s^2]; 0: not known


@dataclass(frozen=True)
class HitTraces:
    """Both channels of one record."""

    label: HitLabel
    time: FloatArray  # shape (n,), from the first point that came [s]
    # Shape (n, 2): hammer and sample [m/s^2]. A row of NaN breaks the line at a gap; a sample that
    # was not measured is NaN throughout.
    values: Float32Array
    calibrations: tuple[ChannelScale, ...] = ()  # of the channels that were measured


class TraceAssembler:
    """Joins the blocks of a record and hands them out with its last one.

    A record that is overtaken by the next one before its last block came is dropped.
    """

    def __init__(self) -> None:
        self._blocks: list[Block] = []
        self._length = 0

    def feed(self, block: Block) -> HitTraces | None:
        """Take the next block; return the record's traces if it was the last one."""
        if self._blocks and self._blocks[0].label.record != block.label.record:
            self._blocks, self._length = [], 0
        if self._length < LARGEST_RECORD:
            self._blocks.append(block)
            self._length += block.hammer.output.size
        if not block.last:
            return None
        blocks, self._blocks, self._length = self._blocks, [], 0
        return _join(blocks)


def _join(blocks: list[Block]) -> HitTraces:
    times: list[FloatArray] = []
    rows: list[Float32Array] = []
    origin = blocks[0].first_sample
    expected = None
    filled = [block for block in blocks if block.hammer.output.size]
    for block in filled:
        count = block.hammer.output.size
        first = block.first_sample - origin
        if expected is not None and first != expected:
            times.append(np.array([expected / block.sampling_rate]))
            rows.append(np.full((1, 2), np.nan, dtype=np.float32))
        times.append((first + np.arange(count)) / block.sampling_rate)
        hammer, specimen = block.hammer.acceleration, block.specimen.acceleration
        pair = [hammer, specimen if block.has_specimen else np.full_like(hammer, np.nan)]
        # Calibrated in double, rounded once: a peak is right to six digits.
        rows.append(np.stack(pair, axis=1, dtype=np.float32, casting="same_kind"))
        expected = first + count
    return HitTraces(
        label=blocks[0].label,
        time=np.concatenate(times) if times else np.empty(0),
        values=np.concatenate(rows) if rows else np.empty((0, 2), dtype=np.float32),
        calibrations=next(map(_list_calibrations, filled), ()),
    )


def _list_calibrations(block: Block) -> tuple[ChannelScale, ...]:
    return tuple(
        ChannelScale(
            name,
            block.sampling_rate,
            channel.resolution > 0.0,
            channel.scale,
            channel.offset,
            channel.full_scale,
        )
        for name, channel in (("hammer", block.hammer), ("sample", block.specimen))
        if channel.output.size
    )


DRIVEN = "driven"
"""Equation (4) on the hammer, the sample driven by F(t) alone, k and c by the paper's method."""
PRINTED = "printed"
"""Equations (1) and (2) as printed, k and c by the paper's method."""


@dataclass(frozen=True)
class AlignedHit:
    """One hit, filtered, in its sample's time."""

    label: HitLabel
    sampling_rate: float  # [Hz]
    start_time: float  # of the first point from the middle of the hammer pulse [s]
    traces: FloatArray  # shape (channels, n): hammer, then sample where measured [m/s^2]

    @property
    def time(self) -> FloatArray:
        """From the middle of the hammer pulse [s], shape (n,)."""
        return make_time(self.start_time, self.sampling_rate, self.traces.shape[1])


@dataclass(frozen=True)
class JudgedTraces:
    """A hit's traces as they were judged when it came."""

    aligned: AlignedHit
    accepted: bool
    contact_time: float  # of this hit alone [s]; NaN: not determined
    full_scale: tuple[float, ...]  # of the channels [m/s^2]; 0: not known


@dataclass(frozen=True)
class ModelTraces:
    """One model beside a sample's mean hit."""

    model: str  # `DRIVEN` or `PRINTED`
    # Shape (2, n): hammer and sample [m/s^2] on the points of the mean. `DRIVEN` and `PRINTED` are
    # scaled to the peaks of the mean and shifted onto it, each channel by itself.
    traces: FloatArray
    mse_percent: tuple[float, float]  # over the record, as in Fig. 6, by channel


@dataclass(frozen=True)
class SampleTraces:
    """The mean hit of one sample, what was read from it, and the models."""

    name: str  # of the sample
    sampling_rate: float  # [Hz]
    start_time: float  # of the first point from the middle of the hammer pulse [s]
    mean: FloatArray  # shape (channels, n): hammer, then sample where measured [m/s^2]
    contact_time: float  # tau_p [s]; the contact lasts from -tau_p / 2 to tau_p / 2
    half_amplitude_width: float  # w50 [s]; the hammer has half its peak at -w50 / 2 and w50 / 2
    first_peak_time: float  # of the sample's U1 [s]; NaN: not determined
    second_peak_time: float  # of the sample's U2 [s]; NaN: not determined
    models: tuple[ModelTraces, ...]

    @property
    def time(self) -> FloatArray:
        """From the middle of the hammer pulse [s], shape (n,)."""
        return make_time(self.start_time, self.sampling_rate, self.mean.shape[1])

    @property
    def half_amplitude_points(self) -> tuple[tuple[float, float], ...]:
        """Times [s] and accelerations [m/s^2] between which w50 lies; none: not determined."""
        half, level = 0.5 * self.half_amplitude_width, 0.5 * find_peak(self.mean[0])
        return ((-half, level), (half, level)) if math.isfinite(half) else ()

    @property
    def peak_points(self) -> tuple[tuple[str, float, float], ...]:
        """U1 and U2 on the sample's mean, as far as they are determined: name, time, height."""
        return tuple(
            (name, time, float(np.interp(time, self.time, self.mean[1])))
            for name, time in (("U1", self.first_peak_time), ("U2", self.second_peak_time))
            if math.isfinite(time) and len(self.mean) > 1
        )

    def normalise(self, channel: int) -> tuple[FloatArray, FloatArray | None]:
        """Return mean and driven model over the peak of the mean, as Fig. 5 shows them [-].

        The model has the peak of the mean and is shifted onto it; None: there is none.
        """
        peak = find_peak(self.mean[channel]) or 1.0
        model = self.find_model(DRIVEN)
        modelled = None if model is None else model.traces[channel] / peak
        return self.mean[channel] / peak, modelled

    def find_model(self, model: str) -> ModelTraces | None:
        """Return what one model says, if it was drawn."""
        return next((item for item in self.models if item.model == model), None)

    def compute_residual(self, model: ModelTraces) -> FloatArray:
        """Return measured minus model [m/s^2], shape (2, n)."""
        return self.mean - model.traces


def find_peak(trace: FloatArray) -> float:
    """Return the value of largest magnitude of a trace, shape (n,), its sign included.

    Points that are not finite count as nothing; 0 if there are no others.
    """
    finite = np.nan_to_num(trace, nan=0.0, posinf=0.0, neginf=0.0)
    return float(finite[np.argmax(np.abs(finite))])


def make_time(start_time: float, sampling_rate: float, count: int) -> FloatArray:
    """Return the times of equally spaced points [s], shape (count,)."""
    return start_time + np.arange(count) / sampling_rate


def align_hit(label: HitLabel, hit: FilteredHit) -> AlignedHit:
    """Return the traces of a hit in its sample's time."""
    traces, origin = hit.align()
    return AlignedHit(label, hit.sampling_rate, -origin / hit.sampling_rate, traces)


def sample_traces_from_estimate(estimate: SampleEstimate, mean: MeanHit) -> SampleTraces | None:
    """Return the traces behind the estimate of a sample; None: it has no contact time."""
    if not estimate.paper.contact_time.is_known:
        return None
    models = [
        ModelTraces(
            found.variant.value,
            np.stack([body.model * body.peak for body in (found.hammer, found.specimen)]),
            (found.hammer.mse_percent, found.specimen.mse_percent),
        )
        for found in estimate.comparisons
    ]
    return SampleTraces(
        name=estimate.name,
        sampling_rate=mean.sampling_rate,
        start_time=-mean.origin / mean.sampling_rate,
        mean=mean.traces,
        contact_time=estimate.paper.contact_time.value,
        half_amplitude_width=estimate.paper.half_amplitude_width.value,
        first_peak_time=estimate.paper.first_peak_time,
        second_peak_time=estimate.paper.second_peak_time,
        models=tuple(models),
    )


MARGIN = 0.5
"""What is shown before and after the contact [contact durations], our choice."""


@dataclass(frozen=True)
class LawCurves:
    """Pulse and loop of one contact."""

    time: FloatArray  # shape (n,), from the middle of the pulse [s]
    # Shape (n,): force on the hammer, both models behind sensor and low-pass of the trace [N]. The
    # versed-sine lasts tau_p and is as high as the pulse.
    measured: FloatArray
    law: FloatArray
    versed_sine: FloatArray
    acceleration: FloatArray  # shape (n,): the law, as the hammer's trace has it [m/s^2]
    # Shape (k,): measured over the contact, from both traces and the law's impact speed [m, N];
    # empty: there is one trace only.
    indentation: FloatArray
    loop_force: FloatArray
    # Shape (m,): the law's loop [m, N].
    law_indentation: FloatArray
    law_force: FloatArray


def compute_law_curves(law: ContactLaw, traces: SampleTraces, setup: RigSetup) -> LawCurves | None:
    """Return the curves of a law with masses; None: there is no such law.

    Parameters
    ----------
    setup : RigSetup
        With the hammer's mass and sensor, and the low-pass that the traces went through.
    """
    if not law.impact_speed.is_known:
        return None
    speed, exponent = law.impact_speed.value, law.exponent.value
    form = find_places([LossForm(law.form.rpartition(" + ")[2])])
    numbers = np.array([[exponent], [law.loss], [law.pull]])
    pulse = compute_pulses(numbers[0], numbers[1], numbers[2], form)
    highest = float(pulse.compute_peak_force()[0])
    height = law.peak_force.value / highest
    unit = law.impulse.value / height / (1.0 + float(pulse.restitution[0]))
    rate, time, hammer_mass = traces.sampling_rate, traces.time, setup.hammer_mass
    chain = setup.find_chains(rate)[0]
    signs = np.sign(traces.mean.sum(axis=1, keepdims=True))
    upright = traces.mean * signs

    def compute_force(begin: float) -> FloatArray:
        return chain.show(height * pulse.compute_force((time - begin) / unit)[0])

    # The middle of the width at half amplitude is where the trace's is.
    begin = -law.duration.value / 2.0
    middle = measure_pulse(compute_force(begin)).middle
    begin -= middle / rate + float(time[0])
    contact_time = traces.contact_time
    versed = compute_pulse(time + contact_time / 2.0, contact_time)
    peak = float(upright[0].max())
    shown = np.abs(time) < (0.5 + MARGIN) * law.duration.value
    touching = (time >= begin) & (time <= begin + law.duration.value)
    force = compute_force(begin)[shown]
    loop = _integrate_loop(upright[:, touching], speed, rate, hammer_mass)
    return LawCurves(
        time=time[shown],
        measured=hammer_mass * upright[0, shown],
        law=force,
        acceleration=signs[0] * force / hammer_mass,
        versed_sine=hammer_mass * chain.show(peak * versed)[shown],
        indentation=loop[0],
        loop_force=loop[1],
        law_indentation=speed * unit * pulse.compression[0],
        law_force=height * pulse.compute_force(pulse.time)[0],
    )


def _integrate_loop(
    upright: FloatArray, speed: float, rate: float, hammer_mass: float
) -> tuple[FloatArray, FloatArray]:
    """Return indentation [m] and force [N] of the points in contact."""
    if len(upright) == 1:
        return np.zeros(0), np.zeros(0)
    changes = upright.sum(axis=0) / rate
    approach = speed - np.cumsum(changes) + changes / 2.0
    return np.asarray(np.cumsum(approach) / rate), hammer_mass * upright[0]


@dataclass(frozen=True)
class TracedHit:
    """One hit with its traces."""

    result: HitResults
    stamp: int  # of the record's first point [ns since the epoch]
    recorded: HitTraces
    aligned: AlignedHit | None  # filtered, in its sample's time; None: it has no whole pulse


@dataclass(frozen=True)
class TracedCampaign:
    """One campaign with its traces."""

    results: Results
    samples: tuple[SampleTraces, ...] = ()  # those with a mean hit; empty without traces
    hits: tuple[TracedHit, ...] = ()  # all, in the order of arrival; empty without traces
    began: int = 0  # time of the first hit's first point [ns since the epoch]; 0: not known
    overrules: tuple[tuple[HitLabel, Overrule], ...] = ()  # by persons, as far as they are known

    def find_traces(self, sample: str) -> SampleTraces | None:
        """Return the mean hit and the models of a sample; None: there are none."""
        return next((item for item in self.samples if item.name == sample), None)

    def list_aligned(self, sample: str) -> list[AlignedHit]:
        """Return the hits of a sample's mean."""
        hits = (hit for hit in self.hits if hit.result.accepted and hit.result.sample == sample)
        return [hit.aligned for hit in hits if hit.aligned is not None]


@dataclass(frozen=True)
class RecordedFile:
    """A file of a run."""

    name: str
    size: int  # [byte]
    sha256: str  # of its content


@dataclass(frozen=True)
class Provenance:
    """When, by what and how a run was recorded."""

    start_time: int  # of the first message [ns since the epoch]; 0: there is none
    end_time: int  # of the last message [ns since the epoch]; 0: there is none
    files: tuple[RecordedFile, ...]  # one, or all of a run that was resumed
    problems: tuple[str, ...] = ()  # what is damaged or missing; empty: every checksum is right
    losses: str | None = None  # what was lost while it was recorded; None: nothing
    ended: str | None = None  # why the recording ended, by the recorder
    versions: tuple[tuple[str, str], ...] = ()  # of software and libraries
    # What an operator said, and when [ns since the epoch]; 0: before the recording.
    notes: tuple[tuple[int, str], ...] = ()
    import_remarks: tuple[str, ...] = ()  # what was assumed of the files that it was made of


@dataclass(frozen=True)
class ReportedCampaign:
    """One campaign of a report."""

    name: str  # unique in the report
    campaign: TracedCampaign
    provenance: Provenance | None = None  # None: results alone
    warnings: tuple[str, ...] = ()  # about the file
