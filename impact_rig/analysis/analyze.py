"""From anything that yields set-ups and blocks to results, and the traces behind them.

Recordings, the recordings of a run and files of other instruments take this one way, which is that
of the live run from the session on.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

from impact_rig.core.estimates.mean_reading import read_hit
from impact_rig.core.given.errors import FileError, ParameterError
from impact_rig.core.given.filtering import check_cutoff
from impact_rig.core.given.findings import Reason
from impact_rig.core.given.quantity import UNKNOWN, Quantity
from impact_rig.core.given.records import Block, HitLabel, PackedRecord, Truth
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.judging import JudgedHit
from impact_rig.core.hit.overrules import NO_OVERRULES, Overrules, find_label
from impact_rig.core.mean.series import MOST_SHOWN, Evenly
from impact_rig.core.session import Session
from impact_rig.results.campaign import (
    FileResults,
    drop_scale,
    hit_results_from_judged,
    results_from_session,
)
from impact_rig.results.traces import (
    TraceAssembler,
    TracedCampaign,
    TracedHit,
    align_hit,
    sample_traces_from_estimate,
)

Settings = Mapping[str, float]
"""Fields of `AnalysisSettings` to use in place of the recorded ones, by name."""
NO_CHANGES: Settings = {}
Report = Callable[[str, int, int], None]
"""Gets now and then what is done (``reading`` [byte] or ``estimating`` [samples]), how much of it,
and of how much."""


@dataclass(frozen=True)
class ByHand:
    """A person's decisions on hits.

    Hits are named as `find_label` takes them, or by the file that they were imported from.
    """

    accept: Sequence[str] = ()
    reject: Sequence[str] = ()
    reason: str = ""
    who: str = ""
    stamp: int = 0  # when [ns since the epoch]; 0: not given


NOTHING_BY_HAND = ByHand()
MOST_NAMED = 5
"""How many hits a warning names, our choice."""


class Reading(Protocol):
    """One reading of a source."""

    # Of the campaign that was come to, in new mappings for each: simulated hits, and whether a hit
    # was accepted when it came; and verdicts by persons.
    truths: dict[HitLabel, Truth]
    verdicts: dict[HitLabel, bool]
    overrules: Overrules

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings for the user, complete at its end."""

    def __iter__(self) -> Iterator[RigSetup | Block]:
        """Yield set-ups, each of which begins a campaign, and its blocks."""


class HitSource(Protocol):
    """Yields hits, one campaign after another; it can be read more than once."""

    path: Path  # what a person named
    size: int  # of all that is read [byte]

    @property
    def has_scale(self) -> bool:
        """Whether the hammer's numbers make accelerations."""

    @property
    def hammer_unit(self) -> str | None:
        """In plain files; None: of a recording, whose set-up has it."""

    def events(self, report: Callable[[int], None] = ...) -> Reading:
        """Begin a reading."""


@dataclass(frozen=True)
class Analysis:
    """The results of a source."""

    campaigns: tuple[TracedCampaign, ...]  # with hits, in their order; traces if asked for
    warnings: tuple[str, ...]  # what the user should know
    reasons: frozenset[Reason]  # for which hits were rejected


@dataclass(frozen=True)
class _JudgedCampaign:
    """One campaign as it is read: its session, and its hits' traces."""

    session: Session
    truths: Mapping[HitLabel, Truth]
    verdicts: Mapping[HitLabel, bool]  # as recorded
    came: dict[HitLabel, bool] = field(default_factory=dict)  # as judged now, when they come
    # Of each sample, what is wanted of its hits: as recorded, and filtered.
    traces: dict[str, Evenly] = field(default_factory=dict)
    # What the hit of a file says by itself.
    alone: dict[HitLabel, FileResults] = field(default_factory=dict)


def refuse_parts_of_full_scale(settings: Settings) -> None:
    """Refuse settings that would do nothing where no full scale is known."""
    for name in ("detection_level", "minimum_peak", "maximum_peak"):
        if name in settings:
            raise ParameterError(
                f"{name} is a part of full scale, which is not known of these hits: leave it out"
            )


def judge(
    reading: Reading,
    settings: Settings = NO_CHANGES,
    overrules: Overrules = NO_OVERRULES,
) -> Iterator[tuple[Session, Block, tuple[tuple[PackedRecord, JudgedHit], ...]]]:
    """Yield each block with the session of its campaign, and the hits that it completes.

    Parameters and errors as of `analyze`.
    """
    session = None
    for event in reading:
        if not isinstance(event, Block):
            # Each campaign begins with its set-up, and its estimates start afresh.
            setup = replace(event, analysis=replace(event.analysis, **settings))
            recorded = reading.overrules.recorded
            session = Session(setup, replace(overrules, recorded=recorded))
        elif session is not None:
            if "cutoff_frequency" in settings:
                check_cutoff(settings["cutoff_frequency"], event.sampling_rate)
            if not event.hammer.full_scale > 0.0:
                refuse_parts_of_full_scale(settings)
            yield session, event, session.feed_records(event)


def analyze(
    source: HitSource,
    settings: Settings = NO_CHANGES,
    by_hand: ByHand = NOTHING_BY_HAND,
    *,
    keep_traces: bool = False,
    most_traces: int = MOST_SHOWN,
    report: Report = lambda *_: None,
) -> Analysis:
    """Judge every hit, as the estimator does live, and estimate.

    Parameters
    ----------
    settings : mapping, optional
        Fields of `AnalysisSettings` to use in place of the source's.
    keep_traces : bool
        Whether the traces are wanted as well.
    most_traces : int
        Of the hits of each sample; of more they are those that lie evenly over the series.

    Raises
    ------
    FileError
        If the source cannot be read, or holds no hit.
    ParameterError
        If the settings cannot be used, or a person names no hit.
    """
    overrules = _find_overrules(source, settings, by_hand)
    judged: list[_JudgedCampaign] = []
    assembler = TraceAssembler()
    reading = source.events(lambda done: report("reading", done, source.size))
    for session, block, found in judge(reading, settings, overrules):
        if not judged or judged[-1].session is not session:
            judged.append(_JudgedCampaign(session, reading.truths, reading.verdicts))
        campaign = judged[-1]
        campaign.came.update((hit.label, hit.accepted) for _, hit in found)
        if source.hammer_unit is not None:
            for _, hit in found:
                campaign.alone[hit.label] = _describe_file(hit, source, session.setup)
        if keep_traces and (joined := assembler.feed(block)) is not None:
            filtered = next((hit.filtered for _, hit in found if hit.label == joined.label), None)
            kept = campaign.traces.setdefault(joined.label.sample, Evenly(most_traces))
            kept.take((joined, filtered))
    campaigns = tuple(
        _finish(campaign, source, report) for campaign in judged if campaign.session.names
    )
    if not campaigns:
        raise FileError(f"{source.path} holds no complete hit")
    sessions = [campaign.session for campaign in judged]
    selections = [session.get_selection(name) for session in sessions for name in session.names]
    rejected = (hit for selection in selections for hit in selection.left_out)
    reasons = frozenset(finding.reason for hit in rejected for finding in hit.rejections)
    return Analysis(campaigns, (*reading.warnings, *_tell_other_verdicts(judged)), reasons)


def _tell_other_verdicts(judged: Sequence[_JudgedCampaign]) -> Iterator[str]:
    """Yield that hits are judged otherwise than when they came; persons' verdicts aside."""
    others = [
        f"{label} was {'rejected' if accepted else 'accepted'}"
        for campaign in judged
        for label, accepted in campaign.came.items()
        if campaign.verdicts.get(label, accepted) != accepted
        and not campaign.session.overrules.list_verdicts(label)
    ]
    if others:
        rest = f" and {len(others) - MOST_NAMED} more" if len(others) > MOST_NAMED else ""
        yield f"judged otherwise than when recorded: {', '.join(others[:MOST_NAMED])}{rest}"


def _describe_file(hit: JudgedHit, source: HitSource, setup: RigSetup) -> FileResults:
    """Return the hit of a file by itself."""
    found = FileResults(
        origin=hit.origin,
        accepted=hit.accepted,
        reasons=hit.rejections,
        half_amplitude_width=Quantity(hit.half_amplitude_width),
        contact_time=Quantity(hit.contact_time),
        width_ratio=hit.width_ratio,
        hammer_peak=hit.hammer_peak,
        specimen_peak=hit.specimen_peak,
        measured_peak=setup.hammer_reading[0] * hit.hammer_peak,
        measured_unit=source.hammer_unit or "",
    )
    if hit.filtered is None:
        return found
    reading = read_hit(hit.filtered, setup, hit.label.sample)
    shape, base = reading.pulse.shape, reading.base_width
    best = shape.best_fit
    return replace(
        found,
        half_amplitude_width=reading.width.state(),
        base_width=base.state() if base is not None else UNKNOWN,
        contact_time=reading.contact_time.state(),
        best_shape=shape.best_shape,
        shape_residual_percent=best.residual_percent if best else math.nan,
    )


def _find_overrules(source: HitSource, settings: Settings, by_hand: ByHand) -> Overrules:
    """Return a person's overrules; the source is judged once before, for the names."""
    if not (by_hand.accept or by_hand.reject):
        return NO_OVERRULES
    hits = [hit for _, _, found in judge(source.events(), settings) for _, hit in found]
    files = {hit.label: hit.origin.file for hit in hits}
    counts = Counter(hit.label for hit in hits)
    accepted, rejected = (
        frozenset(label for name in names for label in _find_labels(name, files))
        for names in (by_hand.accept, by_hand.reject)
    )
    for label in accepted | rejected:
        if counts[label] > 1:
            raise ParameterError(
                f"hit {label} is in {counts[label]} campaigns of the recording:"
                " it cannot be told which one is meant"
            )
    return Overrules(accepted, rejected, by_hand.reason, by_hand.who, by_hand.stamp)


def _find_labels(name: str, files: Mapping[HitLabel, str]) -> list[HitLabel]:
    """Return the hits that a person names: those of a file, or one."""
    found = [label for label, file in files.items() if file and name in (file, Path(file).name)]
    if len({files[label] for label in found}) > 1:
        raise ParameterError(f"{name!r} may be any of several files: name one as it was given")
    return found or [find_label(name, files)]


def _finish(
    campaign: _JudgedCampaign,
    source: HitSource,
    report: Report,
) -> TracedCampaign:
    session = campaign.session
    faults = {label.record: truth.faults for label, truth in campaign.truths.items()}
    count = len(session.names)
    report("estimating", 0, count)
    found = session.estimate_all(lambda done: report("estimating", done, count))
    judged = {hit.label: hit for hit in (*found.accepted, *found.rejected)}
    samples = [
        sample_traces_from_estimate(estimate, mean)
        for estimate in (found.samples if campaign.traces else ())
        if (mean := session.compute_mean(estimate.name)) is not None
    ]
    traces = [pair for kept in campaign.traces.values() for pair in kept.values()]
    files = tuple(
        replace(alone, accepted=judged[label].accepted, reasons=judged[label].rejections)
        for label, alone in campaign.alone.items()
    )
    results = replace(results_from_session(found, faults), files=files)
    return TracedCampaign(
        results=results if source.has_scale else drop_scale(results),
        samples=tuple(item for item in samples if item is not None),
        began=min((hit.stamp for hit in judged.values() if hit.stamp), default=0),
        hits=tuple(
            TracedHit(
                result=hit_results_from_judged(hit, faults.get(hit.label.record, ())),
                stamp=hit.stamp,
                recorded=recorded,
                aligned=None if filtered is None else align_hit(hit.label, filtered),
            )
            for recorded, filtered in sorted(traces, key=lambda pair: pair[0].label.record)
            if (hit := judged.get(recorded.label)) is not None
        ),
        overrules=tuple(
            (hit.label, verdict)
            for hit in results.hits
            for verdict in session.overrules.list_verdicts(hit.label)
        ),
    )
