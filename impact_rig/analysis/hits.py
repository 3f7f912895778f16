"""Hits and mean traces of a recording as arrays, and as channels for other tools, in m/s^2."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from impact_rig.analysis.analyze import Reading, judge
from impact_rig.core.given.records import (
    Block,
    FloatArray,
    HitLabel,
    Origin,
    PackedRecord,
    Record,
    Truth,
    join_origins,
)
from impact_rig.core.given.sensors import CHANNELS
from impact_rig.core.hit.judging import FilteredHit, JudgedHit
from impact_rig.core.session import Session
from impact_rig.files.measurement import MeasuredChannel
from impact_rig.results.traces import AlignedHit, align_hit

UNIT = "m/s^2"


@dataclass(frozen=True, eq=False, repr=False)
class Hit:
    """One hit as arrays.

    `accepted`: it is in the mean of its sample; None: it is not judged. `truth`: a `Truth`, of a
    hit of the virtual rig.

    Examples
    --------
    >>> import impact_rig as ir
    >>> hit = ir.VirtualRig(seed=7).strike("steel small")
    >>> hit
    steel small/1.1: 5000 points of hammer and specimen at 2500 kHz
    >>> hit.hammer.shape, float(hit.time[-1])
    ((5000,), 0.0019996)
    """

    block: Block  # as recorded
    judged: JudgedHit | None = None  # as it came; None: it is not judged
    accepted: bool | None = None  # it is in the mean; None: it is not judged
    title: str = ""  # ``SAMPLE/IMPACT.ATTEMPT``, behind its campaign where there are several
    truth: Truth | None = None  # of the virtual rig; None: not known
    session: Session | None = None  # that judged it, and filters it again

    @property
    def label(self) -> HitLabel:
        """Sample, record, impact and attempt."""
        return self.block.label

    @property
    def sample(self) -> str:
        """Name of what was struck."""
        return self.label.sample

    @property
    def impact(self) -> int:
        """Number in the sample's series, from 1."""
        return self.label.impact

    @property
    def attempt(self) -> int:
        """At this impact, from 1."""
        return self.label.attempt

    @property
    def record(self) -> int:
        """Number of the record, from 1."""
        return self.label.record

    @property
    def name(self) -> str:
        """As `accept` and `reject` take it: "steel small/1.1"."""
        return f"{self.sample}/{self.impact}.{self.attempt}"

    @property
    def rate(self) -> float:
        """Sampling rate [Hz]."""
        return self.block.sampling_rate

    @property
    def time(self) -> FloatArray:
        """From the first point [s], shape (n,)."""
        return np.arange(self.hammer.size) / self.rate

    @property
    def hammer(self) -> FloatArray:
        """As recorded, calibrated [m/s^2], shape (n,); a force without a mass stays in N."""
        return self.block.hammer.acceleration

    @property
    def specimen(self) -> FloatArray | None:
        """The same of the sample; None: not measured."""
        return self.block.specimen.acceleration if self.block.has_specimen else None

    @property
    def reasons(self) -> tuple[str, ...]:
        """Every reason against it."""
        return () if self.judged is None else tuple(map(str, self.judged.rejections))

    @property
    def filtered(self) -> AlignedHit | None:
        """After baseline and low-pass: `time` [s] and `traces` [m/s^2]; None: it has no pulse."""
        filtered = self.filter()
        return None if filtered is None else align_hit(self.block.label, filtered)

    def filter(self) -> FilteredHit | None:
        """Return it filtered, in its own time; None: it has no pulse, or is not judged."""
        if self.session is None or not isinstance(self.block, Record):
            return None
        return self.session.filter(self.block)

    def __repr__(self) -> str:
        """Return its name, and what was recorded."""
        bodies = " and ".join(CHANNELS[: len(self.block.channels)])
        verdict = {None: "", True: ", accepted", False: f", rejected: {'; '.join(self.reasons)}"}
        return (
            f"{self.name}: {self.hammer.size} points of {bodies} at {self.rate / 1e3:g} kHz"
            f"{verdict[self.accepted]}"
        )


def make_channels(hit: Hit, *, is_filtered: bool) -> tuple[MeasuredChannel, ...]:
    """Return the channels of a hit; none where there are no such traces.

    Parameters
    ----------
    is_filtered : bool
        After baseline and low-pass; False: as recorded.
    """
    block = hit.block
    traces: Sequence[FloatArray] = [channel.acceleration for channel in block.channels]
    if is_filtered:
        filtered = hit.filter()
        traces = () if filtered is None else tuple(filtered.traces)
    if not traces or not traces[0].size:
        return ()
    rate, origin = block.sampling_rate, block.origin
    return _make_channels(hit.title, traces, rate, origin, recorded_at=block.stamp)


@dataclass
class ExportedCampaign:
    """One campaign of a recording, judged as the estimator does it live."""

    session: Session
    truths: Mapping[HitLabel, Truth]
    prefix: str = ""  # of the names of its hits, where there are several campaigns
    # In little memory: a hit's traces are made as it is come to.
    records: list[tuple[PackedRecord, JudgedHit]] = field(default_factory=list)

    def list_hits(self) -> Iterator[Hit]:
        """Yield all hits in the order of their arrival."""
        kept = {
            (hit.label, hit.stamp)
            for name in self.session.names
            for hit in self.session.get_selection(name).kept
        }
        seen: Counter[HitLabel] = Counter()
        for packed, judged in self.records:
            label = judged.label
            seen[label] += 1
            name = f"{self.prefix}{label.sample}/{label.impact}.{label.attempt}"
            if seen[label] > 1:
                name += f" ({seen[label]})"
            accepted = (label, judged.stamp) in kept
            truth = self.truths.get(label)
            yield Hit(packed.unpack(), judged, accepted, name, truth, self.session)

    def make_mean_channels(self, name: str) -> tuple[MeasuredChannel, ...]:
        """Return the channels of one sample's mean hit; none where no hit was accepted.

        Time 0 is the middle of the hammer pulse.
        """
        mean = self.session.compute_mean(name)
        if mean is None:
            return ()
        rate = mean.sampling_rate
        origin = join_origins(hit.origin for hit in self.session.get_selection(name).kept)
        start = -mean.origin / rate
        return _make_channels(f"{self.prefix}{name}/mean", mean.traces, rate, origin, start)


def read_campaigns(reading: Reading) -> tuple[ExportedCampaign, ...]:
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
    for session, _, hits in judge(reading):
        if hits and (not found or found[-1].session is not session):
            found.append(ExportedCampaign(session, reading.truths))
        if hits:
            found[-1].records += ((packed, replace(hit, filtered=None)) for packed, hit in hits)
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
        for body, trace in zip(CHANNELS, traces, strict=False)
    )
