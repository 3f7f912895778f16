"""Plain traces through the core: one file, one hit, all of one sample."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from impact_rig.core.errors import ParameterError, RigError, SignalError
from impact_rig.core.estimation.paper_method import BodyEstimate, estimate_hammer
from impact_rig.core.estimation.pulse_shape import estimate_pulse_shape
from impact_rig.core.estimation.sample import add_models, estimate_contact_alone, estimate_sample
from impact_rig.core.hits.averaging import MeanHit, average_hits
from impact_rig.core.hits.hit import JudgedHit, judge_hit
from impact_rig.core.hits.overrule import Overrules, describe_overruled, overrule_hit
from impact_rig.core.hits.selection import select_hits
from impact_rig.core.hits.verdict import Reason
from impact_rig.core.setup.samples import DEFAULT_CLOCK_UNCERTAINTY, RigSetup
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.detection import find_pulse_start
from impact_rig.core.signals.filtering import check_cutoff
from impact_rig.core.signals.record import HitLabel
from impact_rig.core.uncertainty.contact import estimate_hit_uncertainty
from impact_rig.recording.traces import TraceFormat, read_trace
from impact_rig.reporting.flat_estimates import (
    hammer_results_from_body,
    sample_results_from_estimate,
)
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
    overruled = tuple(
        describe_overruled(hit, paths[hit.label.record - 1].name)
        for hit in selection.kept
        if hit.overruled
    )
    hammer = HammerResults()
    samples: tuple[SampleResults, ...] = ()
    if selection.kept:
        try:
            hammer, samples = _evaluate(selection.kept, len(selection.left_out), overruled, task)
        except RigError as error:
            errors.append(f"mean of {len(selection.kept)} hits: {error}")
    elif hits:
        errors.append("no hit was accepted: the contact time is not determined")
    return AnalyzedTraces(TraceResults(hammer, samples, tuple(hits)), tuple(errors))


def _flatten(path: Path, hit: JudgedHit, task: TraceTask) -> HitResults:
    flat = hit_results_from_judged(str(path), hit)
    if not task.has_scale:
        flat = replace(flat, hammer_peak_m_per_s2=NAN)
    if hit.filtered is None:
        return flat
    clock = task.setup.clock_uncertainty if task.setup else DEFAULT_CLOCK_UNCERTAINTY
    uncertainty = estimate_hit_uncertainty(hit.filtered, task.settings, clock)
    try:
        # A series of one: every hit is asked for its shape.
        shape = estimate_pulse_shape(average_hits([hit.filtered]), task.settings.cutoff_frequency)
    except RigError:
        best_shape, residual = "", NAN
    else:
        best_shape, residual = shape.best_shape, shape.best_fit.residual_percent
    return replace(
        flat,
        contact_time_u_s=uncertainty.standard,
        contact_time_expanded_s=uncertainty.expanded,
        best_shape=best_shape,
        shape_residual_percent=residual,
    )


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
    accepted: Sequence[JudgedHit], rejected: int, overruled: tuple[str, ...], task: TraceTask
) -> tuple[HammerResults, tuple[SampleResults, ...]]:
    mean = average_hits([hit.filtered for hit in accepted if hit.filtered])
    contact_times = tuple(hit.contact_time for hit in accepted)
    if task.setup is None:
        estimate = estimate_contact_alone(
            task.sample, mean, contact_times, rejected, task.settings
        )
        estimate = replace(estimate, notes=(*estimate.notes, NO_MASS))
        hammer, control = BodyEstimate(task.hammer_stiffness), ""
        if not task.has_scale:
            estimate = replace(estimate, hammer_peak=NAN)
    else:
        hammer, control = _find_hammer(mean, task, task.setup)
        estimate = estimate_sample(task.sample, mean, contact_times, rejected, hammer, task.setup)
        estimate = add_models(estimate, mean, hammer, task.setup)
    estimate = replace(estimate, warnings=estimate.warnings + overruled)
    return hammer_results_from_body(hammer, control), (sample_results_from_estimate(estimate),)


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
