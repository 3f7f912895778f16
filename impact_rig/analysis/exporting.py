"""Hits and mean traces of a recording as channels for other tools, in m/s^2."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from impact_rig.analysis.analyze import HitSource, judge
from impact_rig.core.hits import JudgedHit, MeanHit
from impact_rig.core.records import FloatArray, HitLabel, Origin, Record, join_origins
from impact_rig.core.session import Session
from impact_rig.files.measurement import MeasuredChannel

UNIT = "m/s^2"
BODIES = ("hammer", "specimen")


@dataclass(frozen=True)
class ExportedHit:
    """One hit with its traces and its final verdict."""

    name: str  # ``SAMPLE/IMPACT.ATTEMPT``, behind its campaign where there are several
    record: Record
    judged: JudgedHit  # as it came, with the filtered traces
    accepted: bool  # it is in the mean of its sample

    def make_channels(self, *, is_filtered: bool) -> tuple[MeasuredChannel, ...]:
        """Return its channels; none where there are no such traces.

        Parameters
        ----------
        is_filtered : bool
            After baseline and low-pass; False: as recorded.
        """
        record, filtered = self.record, self.judged.filtered
        traces: Sequence[FloatArray] = [channel.acceleration for channel in record.channels]
        if is_filtered:
            traces = tuple(filtered.traces) if filtered is not None else ()
        if not traces or not traces[0].size:
            return ()
        return _make_channels(
            self.name, traces, record.sampling_rate, record.origin, recorded_at=record.stamp
        )


@dataclass
class ExportedCampaign:
    """One campaign of a recording, judged as the estimator does it live."""

    session: Session
    prefix: str = ""  # of the names of its hits, where there are several campaigns
    records: list[tuple[Record, JudgedHit]] = field(default_factory=list)

    def list_hits(self) -> tuple[ExportedHit, ...]:
        """Return all hits in the order of their arrival."""
        kept = {
            (hit.label, hit.stamp)
            for name in self.session.names
            for hit in self.session.get_selection(name).kept
        }
        seen: Counter[HitLabel] = Counter()
        hits = []
        for record, judged in self.records:
            label = record.label
            seen[label] += 1
            name = f"{self.prefix}{label.sample}/{label.impact}.{label.attempt}"
            if seen[label] > 1:
                name += f" ({seen[label]})"
            accepted = (label, judged.stamp) in kept
            hits.append(ExportedHit(name, record, judged, accepted))
        return tuple(hits)

    def make_mean_channels(self, name: str) -> tuple[MeasuredChannel, ...]:
        """Return the channels of one sample's mean hit; none where no hit was accepted.

        Time 0 is the middle of the hammer pulse.
        """
        mean: MeanHit | None = self.session.compute_mean(name)
        if mean is None:
            return ()
        rate = mean.sampling_rate
        origin = join_origins(hit.origin for hit in self.session.get_selection(name).kept)
        start = -mean.origin / rate
        return _make_channels(f"{self.prefix}{name}/mean", mean.traces, rate, origin, start)


def read_campaigns(source: HitSource) -> tuple[ExportedCampaign, ...]:
    """Judge every hit of a run, or of whatever else has hits.

    Returns
    -------
    tuple of ExportedCampaign
        Those with hits.

    Raises
    ------
    FileError
        If the recording is damaged.
    ParameterError
        If its settings cannot be used.
    """
    found: list[ExportedCampaign] = []
    for session, _, hits in judge(source):
        if hits and (not found or found[-1].session is not session):
            found.append(ExportedCampaign(session))
        if hits:
            found[-1].records += hits
    if len(found) > 1:
        for number, campaign in enumerate(found, start=1):
            campaign.prefix = f"campaign {number}/"
    return tuple(found)


def _make_channels(
    name: str,
    traces: Sequence[FloatArray] | FloatArray,
    rate: float,
    origin: Origin,
    start: float = 0.0,
    recorded_at: int = 0,
) -> tuple[MeasuredChannel, ...]:
    return tuple(
        MeasuredChannel(
            f"{name} {body}", trace, rate, UNIT, start, recorded_at, origin=str(origin)
        )
        for body, trace in zip(BODIES, traces, strict=False)
    )
