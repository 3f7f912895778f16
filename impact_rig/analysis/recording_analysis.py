"""Recordings through the core: the numbers of the live run, and the traces behind them."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from impact_rig.core.errors import FileError, ParameterError, RigError
from impact_rig.core.estimation.pulse_shape import NO_SHAPE, estimate_pulse_shape
from impact_rig.core.hits.averaging import average_hits
from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.hits.overrule import (
    NO_OVERRULES,
    Overrules,
    describe_label,
    make_overrules,
)
from impact_rig.core.session import Session, SessionResults
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.detection import ImpactDetector
from impact_rig.core.signals.record import Block, HitLabel
from impact_rig.core.uncertainty.contact import estimate_hit_contact_time
from impact_rig.recordings.reader import Recording, read_recording
from impact_rig.results.campaign import Results, hit_results_from_judged, results_from_session
from impact_rig.results.hit_traces import HitTraces, TraceAssembler
from impact_rig.results.sample_traces import AlignedHit, align_hit, sample_traces_from_estimate
from impact_rig.results.trace_series import FileResults, file_results_from_judged
from impact_rig.results.traced_campaign import TracedCampaign, TracedHit

Settings = Mapping[str, Any]
"""Fields of `AnalysisSettings` to use in place of the recorded ones, by name."""
NO_CHANGES: Settings = {}
Report = Callable[[str, int, int], None]
"""Is told now and then what is done (``reading`` [byte] or ``estimating`` [samples]), how much of
it, and of how much."""


@dataclass(frozen=True)
class AnalyzedRecording:
    """What a recording holds.

    Attributes
    ----------
    path : Path
        Of the file.
    campaigns : tuple of Results
        What was found in those with hits, in their order; at least one.
    warnings : tuple of str
        What the user should know of the file.
    files : tuple of tuple of FileResults
        Of each campaign the hits that were imported, each by itself.
    """

    path: Path
    campaigns: tuple[Results, ...]
    warnings: tuple[str, ...]
    files: tuple[tuple[FileResults, ...], ...] = ()


@dataclass(frozen=True)
class JudgedCampaign:
    """One campaign of a recording, every hit judged.

    Attributes
    ----------
    session : Session
        With all hits.
    traces : tuple of HitTraces
        As recorded, by arrival; empty unless asked for.
    aligned : tuple of AlignedHit
        Filtered, those that have a pulse; empty unless asked for.
    files : tuple of FileResults
        Those that were imported, each by itself.
    """

    session: Session
    traces: tuple[HitTraces, ...]
    aligned: tuple[AlignedHit, ...]
    files: tuple[FileResults, ...]


@dataclass(frozen=True)
class JudgedRecording:
    """All campaigns of a recording with hits, judged.

    Attributes
    ----------
    path : Path
        Of the file.
    campaigns : tuple of JudgedCampaign
        In their order; at least one.
    faults : mapping of int to tuple of str
        Injected by the virtual rig, by record.
    warnings : tuple of str
        What the user should know of the file.
    """

    path: Path
    campaigns: tuple[JudgedCampaign, ...]
    faults: Mapping[int, tuple[str, ...]]
    warnings: tuple[str, ...]


def judge_recording(
    path: Path,
    settings: Settings,
    accept: Sequence[str] = (),
    reject: Sequence[str] = (),
    *,
    keep_traces: bool = False,
    report: Report | None = None,
) -> JudgedRecording:
    """Judge every hit of a recording, as the estimator does live.

    Parameters
    ----------
    path : Path
        Of the `.mcap` file.
    settings : mapping
        Fields of `AnalysisSettings` to use in place of the recorded ones.
    accept, reject : sequence of str
        Hits that a person takes into the mean or leaves out, by name; see `find_label`.
    keep_traces : bool
        Whether the recorded traces are wanted as well.
    report : callable, optional
        Is told how far it is.

    Raises
    ------
    FileError
        If the file is no recording of a rig, or holds no hit.
    ParameterError
        If the settings cannot be used, or a person's word on a hit makes no sense.
    """
    recording = read_recording(path)
    overrules = _find_overrules(recording, settings, accept, reject)
    sessions: list[
        tuple[Session, list[HitTraces], list[AlignedHit], dict[HitLabel, FileResults]]
    ] = []
    assembler = TraceAssembler()
    for event in recording.events(_bind(report, "reading", recording.size)):
        if not isinstance(event, Block):
            # Each campaign begins with its set-up, and its estimates start afresh.
            setup = replace(event, analysis=replace(event.analysis, **settings))
            sessions.append((Session(setup, overrules), [], [], {}))
        elif sessions:
            session, traces, aligned, files = sessions[-1]
            judged = session.feed(event)
            files |= {
                hit.label: describe_hit(hit, session.setup) for hit in judged if hit.origin.file
            }
            if keep_traces:
                aligned.extend(found for hit in judged if (found := align_hit(hit)) is not None)
                if (joined := assembler.feed(event)) is not None:
                    traces.append(joined)
    campaigns = tuple(
        JudgedCampaign(session, tuple(traces), tuple(aligned), _settle(session, files))
        for session, traces, aligned, files in sessions
        if session.names
    )
    if not campaigns:
        raise FileError(f"{path} holds no hit: no block of it completes a record")
    return JudgedRecording(
        path=path,
        campaigns=campaigns,
        faults={label.record: names for label, names in recording.faults.items()},
        warnings=recording.warnings,
    )


def analyze_recording(
    path: Path,
    settings: Settings,
    accept: Sequence[str] = (),
    reject: Sequence[str] = (),
    report: Report | None = None,
) -> AnalyzedRecording:
    """Judge every hit of a recording and estimate; parameters and errors as `judge_recording`."""
    judged = judge_recording(path, settings, accept, reject, report=report)
    campaigns = tuple(
        _finish(campaign.session, judged.faults, report) for campaign in judged.campaigns
    )
    files = tuple(campaign.files for campaign in judged.campaigns)
    return AnalyzedRecording(path, campaigns, judged.warnings, files)


def describe_hit(hit: JudgedHit, setup: RigSetup) -> FileResults:
    """Return what an imported hit says by itself: contact time, shape, verdict."""
    flat = file_results_from_judged(hit)
    if hit.filtered is None:
        return flat
    settings = setup.analysis
    contact_time = estimate_hit_contact_time(hit.filtered, settings, setup.clock_uncertainty)
    try:
        # A series of one: every hit is asked for its shape.
        shape = estimate_pulse_shape(
            average_hits([hit.filtered]), settings.cutoff_frequency, setup.responses[0]
        )
    except RigError:
        shape = NO_SHAPE
    best = shape.best_fit
    factor, unit = setup.hammer_reading
    return replace(
        flat,
        measured_peak=factor * hit.hammer_peak,
        measured_unit=unit,
        contact_time=contact_time,
        best_shape=shape.best_shape,
        shape_residual_percent=best.residual_percent if best else math.nan,
    )


def _settle(session: Session, found: Mapping[HitLabel, FileResults]) -> tuple[FileResults, ...]:
    """Return imported hits with the last word on each: a later one may have made it an outlier."""
    selections = map(session.get_selection, session.names)
    last = {hit.label: hit for item in selections for hit in (*item.kept, *item.left_out)}
    return tuple(
        replace(
            file,
            accepted=last[label].accepted,
            reasons=tuple(map(str, last[label].rejections)),
        )
        for label, file in found.items()
    )


def _bind(report: Report | None, what: str, total: int) -> Callable[[int], None] | None:
    if report is None:
        return None
    return lambda done: report(what, done, total)


def _find_overrules(
    recording: Recording, settings: Settings, accept: Sequence[str], reject: Sequence[str]
) -> Overrules:
    """Return a person's word on the hits of a recording, which is read for their names alone."""
    if not (accept or reject):
        return NO_OVERRULES
    labels: list[set[HitLabel]] = []
    for event in recording.events():
        if not isinstance(event, Block):
            detector = ImpactDetector(replace(event.analysis, **settings))
            labels.append(set())
        elif labels:
            labels[-1].update(record.label for record in detector.feed(event))
    counts = Counter(label for campaign in labels for label in campaign)
    overrules = make_overrules(accept, reject, list(counts))
    for label in overrules.accepted | overrules.rejected:
        if counts[label] > 1:
            raise ParameterError(
                f"hit {describe_label(label)} is in {counts[label]} campaigns of the recording:"
                " it cannot be told which one is meant"
            )
    return overrules


def _finish(
    session: Session, faults: Mapping[int, tuple[str, ...]], report: Report | None
) -> Results:
    report_samples = _bind(report, "estimating", len(session.names))
    if report_samples is not None:
        report_samples(0)
    found = session.estimate_all(report_samples)
    return results_from_session(found, faults)


@dataclass(frozen=True)
class TracedRecording:
    """What a recording has to show.

    Attributes
    ----------
    path : Path
        Of the file.
    campaigns : tuple of TracedCampaign
        Those with hits, in their order; at least one.
    warnings : tuple of str
        What the user should know of the file.
    """

    path: Path
    campaigns: tuple[TracedCampaign, ...]
    warnings: tuple[str, ...]


def trace_recording(
    path: Path,
    settings: Settings = NO_CHANGES,
    accept: Sequence[str] = (),
    reject: Sequence[str] = (),
    *,
    with_models: bool,
    report: Report | None = None,
) -> TracedRecording:
    """Judge every hit of a recording, estimate, and keep the traces.

    Parameters
    ----------
    path : Path
        Of the `.mcap` file.
    settings : mapping, optional
        Fields of `AnalysisSettings` to use in place of the recorded ones.
    accept, reject : sequence of str
        Hits that a person takes into the mean or leaves out, by name; see `find_label`.
    with_models : bool
        Fit the model as well, which takes a tenth of a second for each sample.
    report : callable, optional
        Is told how far it is.

    Raises
    ------
    FileError
        If the file is no recording of a rig, or holds no hit.
    ParameterError
        If the settings cannot be used, or a person's word on a hit makes no sense.
    """
    judged = judge_recording(path, settings, accept, reject, keep_traces=True, report=report)
    campaigns = tuple(
        _trace_campaign(campaign, judged.faults, report, with_models=with_models)
        for campaign in judged.campaigns
    )
    return TracedRecording(path, campaigns, judged.warnings)


def _trace_campaign(
    campaign: JudgedCampaign,
    faults: Mapping[int, tuple[str, ...]],
    report: Report | None,
    *,
    with_models: bool,
) -> TracedCampaign:
    session = campaign.session

    def tell(done: int) -> None:
        if report is not None:
            report("estimating", done, len(session.names))

    found = session.estimate_all(tell) if with_models else session.estimate_all_without_models()
    means = [(estimate, session.compute_mean(estimate.name)) for estimate in found.samples]
    traces = [
        sample_traces_from_estimate(estimate, mean) for estimate, mean in means if mean is not None
    ]
    return TracedCampaign(
        results=results_from_session(found, faults),
        samples=tuple(item for item in traces if item is not None),
        hits=_gather_hits(campaign, found, faults),
    )


def _gather_hits(
    campaign: JudgedCampaign, found: SessionResults, faults: Mapping[int, tuple[str, ...]]
) -> tuple[TracedHit, ...]:
    judged: dict[HitLabel, JudgedHit] = {
        hit.label: hit for hit in (*found.accepted, *found.rejected)
    }
    aligned = {hit.label: hit for hit in campaign.aligned}
    return tuple(
        TracedHit(
            result=hit_results_from_judged(hit, faults.get(hit.label.record, ())),
            stamp=hit.stamp,
            recorded=recorded,
            aligned=aligned.get(hit.label),
        )
        for recorded in campaign.traces
        if (hit := judged.get(recorded.label)) is not None
    )
