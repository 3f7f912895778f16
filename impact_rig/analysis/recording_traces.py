"""Recordings as there is to see of them: results, and the traces behind them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from impact_rig.analysis.recording_analysis import JudgedCampaign, Report, judge_recording
from impact_rig.analysis.settings_changes import SettingsChanges
from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.session import SessionResults
from impact_rig.core.signals.record import HitLabel
from impact_rig.results.flat_estimates import hit_results_from_judged, results_from_session
from impact_rig.results.sample_traces import sample_traces_from_estimate
from impact_rig.results.traced_campaign import TracedCampaign, TracedHit


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
    changes: SettingsChanges | None = None,
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
    changes : SettingsChanges, optional
        Settings to use in place of the recorded ones.
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
    changes = changes or SettingsChanges()
    judged = judge_recording(path, changes, accept, reject, keep_traces=True, report=report)
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
    means = [(estimate, session.find_mean(estimate.name)) for estimate in found.samples]
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
