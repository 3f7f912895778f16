"""Recordings through the core: the numbers of the live run, and the traces behind them."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
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
from impact_rig.core.session import Session
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.detection import ImpactDetector
from impact_rig.core.signals.record import Block, HitLabel
from impact_rig.core.uncertainty.contact import estimate_hit_contact_time
from impact_rig.recordings.reader import Recording, read_recording
from impact_rig.results.campaign import hit_results_from_judged, results_from_session
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
    campaigns : tuple of TracedCampaign
        Those with hits, in their order; at least one. Their traces are there if asked for.
    warnings : tuple of str
        What the user should know of the file.
    """

    campaigns: tuple[TracedCampaign, ...]
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class _JudgedCampaign:
    """One campaign of a recording as it is read: its session, and what is kept of its hits."""

    session: Session
    traces: list[HitTraces] = field(default_factory=list)
    aligned: dict[HitLabel, AlignedHit] = field(default_factory=dict)
    files: dict[HitLabel, FileResults] = field(default_factory=dict)


def analyze_recording(
    path: Path,
    settings: Settings = NO_CHANGES,
    accept: Sequence[str] = (),
    reject: Sequence[str] = (),
    *,
    keep_traces: bool = False,
    with_models: bool = True,
    report: Report | None = None,
) -> AnalyzedRecording:
    """Judge every hit of a recording, as the estimator does live, and estimate.

    Parameters
    ----------
    path : Path
        Of the `.mcap` file.
    settings : mapping, optional
        Fields of `AnalysisSettings` to use in place of the recorded ones.
    accept, reject : sequence of str
        Hits that a person takes into the mean or leaves out, by name; see `find_label`.
    keep_traces : bool
        Whether the traces are wanted as well.
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
    recording = read_recording(path)
    overrules = _find_overrules(recording, settings, accept, reject)
    judged: list[_JudgedCampaign] = []
    assembler = TraceAssembler()
    for event in recording.events(_bind(report, "reading", recording.size)):
        if not isinstance(event, Block):
            # Each campaign begins with its set-up, and its estimates start afresh.
            setup = replace(event, analysis=replace(event.analysis, **settings))
            judged.append(_JudgedCampaign(Session(setup, overrules)))
        elif judged:
            campaign = judged[-1]
            for hit in campaign.session.feed(event):
                if hit.origin.file:
                    campaign.files[hit.label] = describe_hit(hit, campaign.session.setup)
                if keep_traces and (aligned := align_hit(hit)) is not None:
                    campaign.aligned[hit.label] = aligned
            if keep_traces and (joined := assembler.feed(event)) is not None:
                campaign.traces.append(joined)
    faults = {label.record: names for label, names in recording.faults.items()}
    campaigns = tuple(
        _finish(campaign, faults, report, with_models=with_models)
        for campaign in judged
        if campaign.session.names
    )
    if not campaigns:
        raise FileError(f"{path} holds no hit: no block of it completes a record")
    return AnalyzedRecording(campaigns, recording.warnings)


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
    campaign: _JudgedCampaign,
    faults: Mapping[int, tuple[str, ...]],
    report: Report | None,
    *,
    with_models: bool,
) -> TracedCampaign:
    session = campaign.session
    tell = _bind(report, "estimating", len(session.names))
    if tell is not None:
        tell(0)
    found = session.estimate_all(tell) if with_models else session.estimate_all_without_models()
    judged = {hit.label: hit for hit in (*found.accepted, *found.rejected)}
    means = [(estimate, session.compute_mean(estimate.name)) for estimate in found.samples]
    samples = [
        sample_traces_from_estimate(estimate, mean)
        for estimate, mean in means
        if campaign.traces and mean is not None
    ]
    return TracedCampaign(
        results=results_from_session(found, faults),
        samples=tuple(item for item in samples if item is not None),
        hits=tuple(
            TracedHit(
                result=hit_results_from_judged(hit, faults.get(hit.label.record, ())),
                stamp=hit.stamp,
                recorded=recorded,
                aligned=campaign.aligned.get(hit.label),
            )
            for recorded in campaign.traces
            if (hit := judged.get(recorded.label)) is not None
        ),
        # With the last word on each: a later hit may have made it an outlier.
        files=tuple(
            replace(
                file,
                accepted=judged[label].accepted,
                reasons=tuple(map(str, judged[label].rejections)),
            )
            for label, file in campaign.files.items()
        ),
    )
