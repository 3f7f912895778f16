"""What a recording has of each hit and of a running stream: blocks, gaps, points, verdicts."""

from collections import deque
from dataclasses import dataclass, field
from enum import Enum
from itertools import islice, pairwise
from typing import Any

from impact_rig.core.records import UNSTATED, HitLabel, Origin
from impact_rig.recordings.messages import (
    BLOCK_TYPE,
    SETUP_TYPE,
    VIRTUAL_IMPACT_TYPE,
    label_from_msg,
    origin_from_msg,
)

REMEMBERED = 100
"""How many of the last records are known to have ended [-], our choice: the end of an arming is
told less than a second after its last block."""


@dataclass
class RecordCount:
    """What a recording has of one record, so far.

    Attributes
    ----------
    label : HitLabel
        The hit that the record is of.
    blocks : int
        In the recording [-].
    gaps : int
        Jumps of `first_sample` in them [-].
    missing_points : int
        That they lack, per channel [-].
    stamp : int
        Time of the first point of the last block, nanoseconds since the epoch; 0: no block.
    expected : int
        `first_sample` of a next block without a gap.
    is_complete : bool
        No more blocks of it follow.
    """

    label: HitLabel
    blocks: int = 0
    gaps: int = 0
    missing_points: int = 0
    stamp: int = 0
    expected: int = 0
    is_complete: bool = False


@dataclass
class RecordWatch:
    """Follows the blocks of one accelerometer pair.

    Attributes
    ----------
    blocks : int
        In all records so far [-].
    gaps : int
        Jumps of `first_sample` in them [-].
    missing_points : int
        That they lack, per channel [-].
    unfinished : RecordCount or None
        The record whose last block has not come; None: there is none.
    """

    blocks: int = 0
    gaps: int = 0
    missing_points: int = 0
    unfinished: RecordCount | None = None
    _finished: list[RecordCount] = field(default_factory=list)
    _ended: deque[int] = field(default_factory=lambda: deque(maxlen=REMEMBERED))

    def has_ended(self, record: int) -> bool:
        """Whether a record is known to have ended, of late."""
        return record in self._ended

    @property
    def has_finished(self) -> bool:
        """Whether a record has ended that `collect` has not returned yet."""
        return bool(self._finished)

    def begin(self, record: int) -> None:
        """Note a new arming; its number may have been used before its source was restarted."""
        if record in self._ended:
            self._ended.remove(record)

    def add(
        self, label: HitLabel, first_sample: int, points: int, stamp: int, *, last: bool
    ) -> None:
        """Count a block in.

        Parameters
        ----------
        label : HitLabel
            The hit it is of; another one than before ends the record before.
        first_sample : int
            Index of its first point, counted since arming; one that is not the next is a gap.
        points : int
            Per channel.
        stamp : int
            Time of its first point, nanoseconds since the epoch.
        last : bool
            Whether it ends the record.
        """
        if self.unfinished is not None and self.unfinished.label != label:
            self._end(self.unfinished)
        count = self.unfinished = self.unfinished or RecordCount(label)
        missing = max(first_sample - count.expected, 0)
        gap = int(first_sample != count.expected)
        for counted in (self, count):
            counted.blocks += 1
            counted.gaps += gap
            counted.missing_points += missing
        count.stamp, count.expected = stamp, first_sample + points
        if last:
            self._end(count)

    def end(self, record: int, sample: str) -> None:
        """Note that an arming has ended, though its last block, or any block, never came."""
        if self.unfinished is not None and self.unfinished.label.record == record:
            self._end(self.unfinished)
        elif not self.has_ended(record):
            self._end(RecordCount(HitLabel(sample, record=record, impact=0, attempt=0)))

    def collect(self) -> tuple[RecordCount, ...]:
        """Return the records that ended since the last time."""
        counts = tuple(self._finished)
        self._finished.clear()
        return counts

    def _end(self, count: RecordCount) -> None:
        count.is_complete = True
        self._finished.append(count)
        self.begin(count.label.record)
        self._ended.append(count.label.record)
        # The word that an arming has ended may come when the next record is under way.
        if self.unfinished is not None and self.unfinished.label.record == count.label.record:
            self.unfinished = None


@dataclass
class StreamWatch:
    """Follows the blocks of the running stream of one accelerometer pair.

    Attributes
    ----------
    blocks : int
        In the recording [-].
    points : int
        In them, per channel [-].
    gaps : int
        Jumps of `first_sample` in them [-].
    missing_points : int
        That they lack, per channel [-].
    """

    blocks: int = 0
    points: int = 0
    gaps: int = 0
    missing_points: int = 0
    _expected: int | None = None

    def add(self, first_sample: int, points: int) -> None:
        """Count a block in.

        Parameters
        ----------
        first_sample : int
            Index of its first point, counted since the stream began. A recording may begin in
            the middle of a stream, and one that goes back is another one: neither is a gap.
        points : int
            Per channel.
        """
        if self._expected is not None and first_sample > self._expected:
            self.gaps += 1
            self.missing_points += first_sample - self._expected
        self._expected = first_sample + points
        self.blocks += 1
        self.points += points


RELEASE_TYPE = "impact_rig_msgs/msg/HammerRelease"
VERDICT_TYPE = "impact_rig_msgs/msg/Impact"
STORED_TYPE = "impact_rig_msgs/msg/RecordStored"
HIT_TYPES = frozenset(
    {BLOCK_TYPE, RELEASE_TYPE, VERDICT_TYPE, STORED_TYPE, SETUP_TYPE, VIRTUAL_IMPACT_TYPE}
)
"""Messages that tell of hits; a set-up begins a campaign."""


MOST_VANISHED = 1000
"""How many hits of which nothing is left are told one by one, our choice: a damaged number must
not make millions of them."""


class HitState(Enum):
    """How much of a hit is there."""

    SAVED = "saved"
    DAMAGED = "damaged"
    LOST = "lost"


@dataclass(frozen=True)
class RecordedHit:
    """One hit as far as a recording has it.

    Attributes
    ----------
    rig : str
        Namespace.
    campaign : int
        Counted from 1; each set-up begins one, the first with what came before it.
    record : int
        Number of its arming [-].
    label : HitLabel, optional
        Sample, impact and attempt; None: nothing tells them.
    state : HitState
        How much of it is there.
    reason : str
        What is missing, in words; empty: nothing.
    gaps, missing_points : int
        Jumps between its blocks, and the points they leave out [-].
    is_accepted : bool, optional
        The verdict, where there is one.
    rejections : tuple of str
        Every reason for rejection, "code: explanation".
    origin : Origin
        Where its points come from.
    """

    rig: str
    campaign: int
    record: int
    label: HitLabel | None
    state: HitState
    reason: str = ""
    gaps: int = 0
    missing_points: int = 0
    is_accepted: bool | None = None
    rejections: tuple[str, ...] = ()
    origin: Origin = UNSTATED


@dataclass
class _Evidence:
    """What was found of one hit so far."""

    label: HitLabel
    blocks: int = 0
    next_sample: int = 0
    gaps: int = 0
    missing_points: int = 0
    is_finished: bool = False
    stored_blocks: int | None = None
    is_accepted: bool | None = None
    rejections: tuple[str, ...] = ()
    origin: Origin = UNSTATED

    @property
    def is_release_alone(self) -> bool:
        """Whether nothing came after the release: no block, and no verdict that nothing came."""
        return not self.blocks and self.stored_blocks is None and self.is_accepted is None


@dataclass
class _Rig:
    """What was found of one rig so far."""

    setup: bytes = b""
    campaign: int = 1
    hits: dict[tuple[int, HitLabel], _Evidence] = field(default_factory=dict)


class HitWatch:
    """Takes the messages that tell of hits, in file order."""

    def __init__(self) -> None:
        self._rigs: dict[str, _Rig] = {}

    def add(self, topic: str, type_name: str, message: Any, data: bytes) -> None:
        """Take one message of `HIT_TYPES`, decoded and as it is in the file.

        Raises
        ------
        AttributeError
            If the message does not have the fields of this version.
        """
        place = topic.removesuffix("recorder/stored") if type_name == STORED_TYPE else topic
        rig = self._rigs.setdefault(place.rpartition("/")[0] or "/", _Rig())
        if type_name == SETUP_TYPE:
            # Each file of a split recording repeats it. The first one holds for what came before
            # it, too: a recorder may have heard of it late.
            if data != rig.setup:
                rig.campaign += bool(rig.setup)
                rig.setup = data
            return
        if type_name == STORED_TYPE and not message.blocks:
            return  # an arming that ended without a hit
        label = label_from_msg(message)
        evidence = rig.hits.setdefault((rig.campaign, label), _Evidence(label))
        if type_name == BLOCK_TYPE:
            _add_block(evidence, message)
        elif type_name == STORED_TYPE:
            evidence.stored_blocks = int(message.blocks)
        elif type_name == VERDICT_TYPE:
            evidence.rejections = tuple(str(text) for text in message.reasons)
            evidence.is_accepted = bool(message.accepted)

    def list_hits(self, *, is_whole: bool) -> tuple[RecordedHit, ...]:
        """Return the hits in the order in which they happened.

        Parameters
        ----------
        is_whole : bool
            Whether the recording is known to hold all that was written.
        """
        return tuple(
            hit
            for name, rig in self._rigs.items()
            for hit in _list_rig_hits(name, rig, is_whole=is_whole)
        )


def count_points(channel: Any) -> int:
    """Return how many points a decoded `Channel` has, of whatever version."""
    return max(len(channel.counts), len(getattr(channel, "values", ())))


def _add_block(evidence: _Evidence, message: Any) -> None:
    evidence.origin = origin_from_msg(message)
    start = int(message.first_sample)
    points = count_points(message.hammer)
    if start > evidence.next_sample:
        evidence.gaps += 1
        evidence.missing_points += start - evidence.next_sample
    evidence.next_sample = max(start + points, evidence.next_sample)
    evidence.blocks += 1
    evidence.is_finished |= bool(message.last)


def _list_rig_hits(name: str, rig: _Rig, *, is_whole: bool) -> list[RecordedHit]:
    hits = [
        _describe(name, campaign, evidence, is_whole=is_whole)
        for (campaign, _), evidence in rig.hits.items()
        # Released and called off, as by a campaign that was cancelled meanwhile.
        if not (is_whole and evidence.is_release_alone)
    ]
    if not is_whole:
        hits += _find_vanished(name, hits)
        hits.sort(key=lambda hit: (hit.campaign, hit.record))
    return hits


def _find_vanished(name: str, hits: list[RecordedHit]) -> list[RecordedHit]:
    """Return the records that are left out in the numbers: armings are counted."""
    campaigns = {hit.record: hit.campaign for hit in hits}
    missing = (
        RecordedHit(name, campaigns[before], record, None, HitState.LOST, "nothing of it is left")
        for before, after in pairwise(sorted(campaigns))
        for record in range(before + 1, after)
    )
    return list(islice(missing, MOST_VANISHED))


def _describe(name: str, campaign: int, evidence: _Evidence, *, is_whole: bool) -> RecordedHit:
    state, reason = _judge(evidence, is_whole=is_whole)
    return RecordedHit(
        name,
        campaign,
        evidence.label.record,
        evidence.label,
        state,
        reason,
        evidence.gaps,
        evidence.missing_points,
        evidence.is_accepted,
        evidence.rejections,
        evidence.origin,
    )


def _judge(evidence: _Evidence, *, is_whole: bool) -> tuple[HitState, str]:
    """Return how much of a hit is there, and what is missing."""
    if not evidence.blocks:
        return HitState.LOST, "no block of it is left"
    if is_whole:
        return HitState.SAVED, ""
    stored = evidence.stored_blocks
    if stored is not None and evidence.blocks < stored:
        return HitState.DAMAGED, f"{evidence.blocks} of {stored} blocks are left"
    if not evidence.is_finished:
        return HitState.DAMAGED, "its last block is missing"
    if stored is None and evidence.missing_points:
        return HitState.DAMAGED, f"{evidence.missing_points} points are missing"
    return HitState.SAVED, ""
