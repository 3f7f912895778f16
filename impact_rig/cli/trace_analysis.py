"""Plain traces through the core: one file, one hit, all of one sample."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from impact_rig.core.errors import ParameterError, RigError, SignalError
from impact_rig.core.estimation.paper_method import BodyEstimate, ContactEstimate, estimate_hammer
from impact_rig.core.estimation.sample import SampleEstimate, estimate_sample
from impact_rig.core.hits.averaging import MeanHit, average_hits
from impact_rig.core.hits.hit import JudgedHit, judge_hit
from impact_rig.core.hits.overrule import Overrules, describe_overruled, overrule_hit
from impact_rig.core.hits.pulse_width import measure_pulse
from impact_rig.core.hits.selection import select_hits
from impact_rig.core.hits.verdict import Reason
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.detection import find_pulse_start
from impact_rig.core.signals.filtering import check_cutoff
from impact_rig.core.signals.record import HitLabel
from impact_rig.recording.traces import TraceFormat, read_trace
from impact_rig.reporting.flat_estimates import sample_results_from_estimate
from impact_rig.reporting.results import HammerResults, SampleResults
from impact_rig.reporting.trace_results import HitResults, TraceResults, hit_results_from_judged

USELESS = {Reason.NO_PULSE, Reason.NON_FINITE}
"""Reasons that a file is not a bad hit but no hit at all."""
NO_MASS = "k and c: no mass given; they need --hammer-mass and --sample-mass, or --rig-file"
NAN = math.nan


@dataclass(frozen=True)
class TraceTask:
    """How to evaluate traces.

    Attributes
    ----------
    sample : str
        Name of the struck sample.
    layout : TraceFormat
        What the columns mean.
    settings : AnalysisSettings
        How to judge.
    setup : RigSetup or None
        Masses; None: not known, and then only contact times are determined.
    hammer_stiffness : float
        k1 [N/m]; NaN: from the control sample, if `sample` is it.
    has_scale : bool
        The peaks are accelerations; False: a force without a mass.
    accept, reject : tuple of str
        Files that a person takes into the mean or leaves out, as given or without their folder.
    """

    sample: str
    layout: TraceFormat
    settings: AnalysisSettings = field(default_factory=AnalysisSettings)
    setup: RigSetup | None = None
    hammer_stiffness: float = NAN
    has_scale: bool = True
    accept: tuple[str, ...] = ()
    reject: tuple[str, ...] = ()


@dataclass(frozen=True)
class AnalyzedTraces:
    """What the traces say.

    Attributes
    ----------
    results : TraceResults
        Of the files that could be used.
    errors : tuple of str
        One sentence for each file that could not, and for what else went wrong.
    """

    results: TraceResults
    errors: tuple[str, ...]


def analyze_traces(paths: Sequence[Path], task: TraceTask) -> AnalyzedTraces:
    """Judge every file, select, and estimate from the mean of what is left.

    Raises
    ------
    ParameterError
        If a person's word on a file makes no sense.
    """
    overrules = _find_overrules(paths, task)
    judged: list[JudgedHit] = []
    errors: list[str] = []
    for number, path in enumerate(paths, start=1):
        try:
            hit = _judge_file(path, number, task)
        except RigError as error:
            if _make_label(number, task) in overrules.accepted:
                raise ParameterError(f"{path} cannot be accepted by hand: {error}") from None
            errors.append(str(error))
        else:
            judged.append(_overrule(path, hit, overrules))
    selection = select_hits(judged, task.settings.keep_hits)
    # A file's number is the record of its hit.
    final = sorted(selection.kept + selection.left_out, key=lambda hit: hit.label.record)
    hits = [_flatten(paths[hit.label.record - 1], hit, task) for hit in final]
    notes = tuple(
        describe_overruled(hit, paths[hit.label.record - 1].name)
        for hit in selection.kept
        if hit.overruled
    )
    hammer = HammerResults()
    samples: tuple[SampleResults, ...] = ()
    if selection.kept:
        try:
            hammer, samples = _evaluate(selection.kept, len(selection.left_out), notes, task)
        except RigError as error:
            errors.append(f"mean of {len(selection.kept)} hits: {error}")
    elif hits:
        errors.append("no hit was accepted: the contact time is not determined")
    return AnalyzedTraces(TraceResults(hammer, samples, tuple(hits)), tuple(errors))


def _flatten(path: Path, hit: JudgedHit, task: TraceTask) -> HitResults:
    flat = hit_results_from_judged(str(path), hit)
    return flat if task.has_scale else replace(flat, hammer_peak_m_per_s2=NAN)


def _make_label(number: int, task: TraceTask) -> HitLabel:
    return HitLabel(task.sample, record=number, impact=number)


def _find_overrules(paths: Sequence[Path], task: TraceTask) -> Overrules:
    """Return the files that a person named as the hits that they hold."""

    def find(option: str, name: str) -> HitLabel:
        found = [
            number for number, path in enumerate(paths, start=1) if name in (str(path), path.name)
        ]
        if len(found) != 1:
            what = "is none of the files" if not found else "may be any of several files"
            raise ParameterError(f"{option} {name!r} {what}: name one as it was given")
        return _make_label(found[0], task)

    accepted = frozenset(find("--accept", name) for name in task.accept)
    rejected = frozenset(find("--reject", name) for name in task.reject)
    for label in accepted & rejected:
        raise ParameterError(
            f"{paths[label.record - 1]} is both accepted and rejected by hand: choose one"
        )
    return Overrules(accepted, rejected)


def _overrule(path: Path, hit: JudgedHit, overrules: Overrules) -> JudgedHit:
    if hit.label in overrules.accepted and hit.filtered is None:
        why = "; ".join(map(str, hit.rejections))
        raise ParameterError(
            f"{path} cannot be accepted by hand: it has no pulse that could be measured ({why})"
        )
    return overrule_hit(hit, overrules)


def _judge_file(path: Path, number: int, task: TraceTask) -> JudgedHit:
    record = read_trace(path, _make_label(number, task), task.layout)
    try:
        check_cutoff(task.settings.cutoff_frequency, record.sampling_rate)
    except ParameterError as error:
        raise ParameterError(f"{path}: {error} (--cutoff off)") from None
    record = replace(record, pulse_index=find_pulse_start(record.hammer, task.settings))
    hit = judge_hit(record, task.settings)
    for rejection in hit.rejections:
        if rejection.reason in USELESS:
            raise SignalError(
                f"{path} has no pulse that could be measured: {rejection.explanation}; it must"
                " leave its baseline and come back"
            )
    return hit


def _evaluate(
    accepted: Sequence[JudgedHit], rejected: int, notes: tuple[str, ...], task: TraceTask
) -> tuple[HammerResults, tuple[SampleResults, ...]]:
    mean = average_hits([hit.filtered for hit in accepted if hit.filtered])
    contact_times = tuple(hit.contact_time for hit in accepted)
    if task.setup is None:
        estimate = _estimate_contact_only(mean, contact_times, rejected, task)
        hammer, control = BodyEstimate(task.hammer_stiffness), ""
    else:
        hammer, control = _find_hammer(mean, task, task.setup)
        estimate = estimate_sample(task.sample, mean, contact_times, rejected, hammer, task.setup)
    body = replace(estimate.body, notes=estimate.body.notes + notes)
    flat = HammerResults(
        control_sample=control,
        stiffness_n_per_m=hammer.stiffness,
        damping_coefficient_n_s_per_m=hammer.damping_coefficient,
        damping_ratio=hammer.damping_ratio,
        log_decrement=hammer.log_decrement,
    )
    return flat, (sample_results_from_estimate(replace(estimate, body=body)),)


def _find_hammer(mean: MeanHit, task: TraceTask, setup: RigSetup) -> tuple[BodyEstimate, str]:
    """Return what is known of the hammer, and the control sample that says so."""
    if math.isfinite(task.hammer_stiffness):
        return BodyEstimate(task.hammer_stiffness), ""
    if setup.samples.control_sample == task.sample:
        return estimate_hammer(mean, setup), task.sample
    note = (
        f"k1: {task.sample!r} is not the control sample; give --hammer-stiffness, or --control if"
        " hammer and sample are alike"
    )
    return BodyEstimate(notes=(note,)), ""


def _estimate_contact_only(
    mean: MeanHit, contact_times: Sequence[float], rejected: int, task: TraceTask
) -> SampleEstimate:
    pulse = measure_pulse(mean.traces[0])
    width = pulse.half_amplitude_width / mean.sampling_rate
    peaks = np.abs(mean.traces).max(axis=1)
    return SampleEstimate(
        name=task.sample,
        impacts_accepted=mean.count,
        impacts_rejected=rejected,
        contact=ContactEstimate(
            half_amplitude_width=width,
            width_ratio=pulse.width_ratio,
            contact_time=task.settings.pulse_factor * width,
            equivalent_stiffness=NAN,
        ),
        contact_time_spread=float(np.std(contact_times, ddof=1)) if mean.count > 1 else NAN,
        body=BodyEstimate(notes=(NO_MASS,)),
        hammer_peak=float(peaks[0]) if task.has_scale else NAN,
        specimen_peak=float(peaks[1]) if peaks.size > 1 else NAN,
    )
