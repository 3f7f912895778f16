"""Hits and mean traces of a recording as channels for other tools, in m/s^2."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from impact_rig.analysis.analyze import judge
from impact_rig.core.hits import JudgedHit, MeanHit
from impact_rig.core.records import FloatArray, HitLabel, Origin, Record, join_origins
from impact_rig.core.session import Session
from impact_rig.recordings.formats.measurement import MeasuredChannel
from impact_rig.recordings.reader import Recording

UNIT = "m/s^2"
BODIES = ("hammer", "specimen")


@dataclass(frozen=True)
class ExportedHit:
    """One hit with its traces and its final verdict."""

    name: str  # ``SAMPLE/IMPACT.ATTEMPT``, behind its campaign where there are several
    record: Record
    judged: JudgedHit  # among all hits of its sample, with the filtered traces

    @property
    def label(self) -> HitLabel:
        """Which hit it is."""
        return self.record.label

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
        rate, origin, stamp = record.sampling_rate, record.origin, record.stamp
        return _make_channels(self.name, traces, rate, origin, recorded_at=stamp)


@dataclass
class ExportedCampaign:
    """One campaign of a recording, judged as the estimator does it live."""

    session: Session
    prefix: str = ""  # of the names of its hits, where there are several campaigns
    records: list[tuple[Record, JudgedHit]] = field(default_factory=list)

    def list_hits(self) -> tuple[ExportedHit, ...]:
        """Return all hits in the order of their arrival."""
        final = {
            _identify(hit): hit
            for name in self.session.names
            for selection in [self.session.get_selection(name)]
            for hit in (*selection.kept, *selection.left_out)
        }
        seen: Counter[HitLabel] = Counter()
        hits = []
        for record, judged in self.records:
            label = record.label
            seen[label] += 1
            name = f"{self.prefix}{label.sample}/{label.impact}.{label.attempt}"
            if seen[label] > 1:
                name += f" ({seen[label]})"
            # The final verdict comes without traces.
            last = replace(final[_identify(judged)], filtered=judged.filtered)
            hits.append(ExportedHit(name, record, last))
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


def read_campaigns(recording: Recording) -> tuple[ExportedCampaign, ...]:
    """Judge every hit of a recording.

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
    for session, _, hits in judge(recording):
        if hits and (not found or found[-1].session is not session):
            found.append(ExportedCampaign(session))
        if hits:
            found[-1].records += hits
    if len(found) > 1:
        for number, campaign in enumerate(found, start=1):
            campaign.prefix = f"campaign {number}/"
    return tuple(found)


def _identify(hit: JudgedHit) -> tuple[HitLabel, int]:
    return hit.label, hit.stamp


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
