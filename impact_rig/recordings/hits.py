"""The hits and the running stream of a recording: blocks, gaps, points, verdicts."""

from dataclasses import dataclass, field
from enum import Enum
from itertools import islice, pairwise
from typing import Any

from impact_rig.core.given.records import UNSTATED, HitLabel, Origin
from impact_rig.recordings.campaigns import CampaignWatch
from impact_rig.recordings.fields import stamp_from_msg
from impact_rig.recordings.messages import (
    BLOCK_TYPE,
    SETUP_TYPE,
    VIRTUAL_IMPACT_TYPE,
    count_points,
    label_from_msg,
    origin_from_msg,
)


@dataclass
class BlockCount:
    """Blocks of one record or of a running stream, and what is missing between them."""

    blocks: int = 0
    points: int = 0  # per channel
    gaps: int = 0  # jumps of `first_sample`
    missing_points: int = 0  # per channel
    expected: int | None = None  # `first_sample` of a next block without a gap; None: any

    def add(self, first_sample: int, points: int) -> int:
        """Count a block, and return how many points are missing before it.

        A stream that goes back was started again: that is no gap.
        """
        missing = 0 if self.expected is None else max(first_sample - self.expected, 0)
        self.count(points, missing)
        self.expected = first_sample + points
        return missing

    def count(self, points: int, missing: int) -> None:
        """Count a block before which so many points are missing."""
        self.blocks += 1
        self.points += points
        self.gaps += missing > 0
        self.missing_points += missing


@dataclass(kw_only=True)
class RecordCount(BlockCount):
    """Count of one record's blocks in a recording, so far."""

    label: HitLabel
    stream_id: bytes
    stamp: int = 0  # of the first point of the last block [ns since the epoch]
    expected: int | None = 0


@dataclass
class RecordWatch:
    """Follows the records of one accelerometer pair, one after the other."""

    total: BlockCount = field(default_factory=BlockCount)
    unfinished: RecordCount | None = None  # the record whose last block has not come

    def add(self, message: Any) -> tuple[RecordCount, ...]:
        """Count a block's message; return the records that have ended.

        A record ends with its last block, or when a block of another one comes.
        """
        ended = []
        label, points = label_from_msg(message), count_points(message)
        count, key = self.unfinished, (label, bytes(message.stream_id.uuid))
        if count is None or (count.label, count.stream_id) != key:
            if count is not None:
                ended.append(count)
            count = RecordCount(label=label, stream_id=key[1])
        self.total.count(points, count.add(message.first_sample, points))
        count.stamp = stamp_from_msg(message.header.stamp)
        if message.last:
            ended.append(count)
        self.unfinished = None if message.last else count
        return tuple(ended)


RELEASE_TYPE = "impact_rig_msgs/msg/HammerRelease"
VERDICT_TYPE = "impact_rig_msgs/msg/Impact"
STORED_TYPE = "impact_rig_msgs/msg/RecordStored"
HIT_TYPES = frozenset(
    {BLOCK_TYPE, RELEASE_TYPE, VERDICT_TYPE, STORED_TYPE, SETUP_TYPE, VIRTUAL_IMPACT_TYPE}
)
"""Messages about hits; a set-up begins a campaign."""
MOST_VANISHED = 1000
"""How many hits of which nothing is left are listed, our choice: a damaged number must not make
millions of them."""


LONGEST_TEXT, MOST_TEXTS = 1000, 20
"""How many characters of a reason, and how many reasons, of a verdict are kept, our choice: ten
times ours."""


@dataclass(frozen=True)
class RecordedReason:
    """A reason for a rejection, of any version."""

    reason: str  # its code; empty: a recording of before results had version 12 has none
    explanation: str


class HitState(Enum):
    """Completeness of a hit."""

    SAVED = "saved"
    DAMAGED = "damaged"
    LOST = "lost"


@dataclass(kw_only=True)
class RecordedHit(BlockCount):
    """One hit as far as a recording has it."""

    rig: str  # its namespace
    campaign: int  # from 1, of those that have hits
    record: int  # number of its arming
    label: HitLabel | None  # None: nothing of it is left
    state: HitState = HitState.LOST
    reason: str | None = "nothing of it is left"  # what is missing; None: nothing
    is_accepted: bool | None = None  # None: there is no verdict
    rejections: tuple[RecordedReason, ...] = ()
    origin: Origin = UNSTATED
    expected: int | None = 0
    stored_blocks: int | None = None  # that the recorder has stored; None: it does not say
    is_finished: bool = False  # its last block is there

    def judge(self, *, is_whole: bool) -> None:
        """Set how much of the hit is there; `is_whole`: the recording lacks no message."""
        stored, left = self.stored_blocks, self.blocks
        self.state, self.reason = HitState.DAMAGED, None
        if not left:
            self.state, self.reason = HitState.LOST, "no block of it is left"
        elif is_whole:
            self.state = HitState.SAVED
        elif stored is not None and left < stored:
            self.reason = f"{left} of {stored} blocks are left"
        elif not self.is_finished:
            self.reason = "its last block is missing"
        elif stored is None and self.missing_points:
            self.reason = f"{self.missing_points} points are missing"
        else:
            self.state = HitState.SAVED


@dataclass
class _Rig:
    """Hits of one rig so far."""

    watch: CampaignWatch = field(default_factory=CampaignWatch)
    campaign: int = 1
    is_struck: bool = False  # the campaign has hits
    hits: dict[tuple[int, HitLabel], RecordedHit] = field(default_factory=dict)


class HitWatch:
    """Collects the hits of all rigs from their messages, in file order."""

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
        name = place.rpartition("/")[0] or "/"
        rig = self._rigs.setdefault(name, _Rig())
        if type_name == SETUP_TYPE:
            is_first = rig.watch.campaign is None
            # As for the analysis, a campaign without hits is none.
            if rig.watch.add_setup(message) and rig.is_struck and not is_first:
                rig.campaign, rig.is_struck = rig.campaign + 1, False
            return
        if rig.watch.is_trial:
            return
        if type_name == BLOCK_TYPE and not rig.watch.add_block(data):
            return
        rig.is_struck = True
        label = label_from_msg(message)
        key = rig.campaign, label
        if key not in rig.hits:
            rig.hits[key] = RecordedHit(
                rig=name, campaign=rig.campaign, record=label.record, label=label
            )
        hit = rig.hits[key]
        if type_name == BLOCK_TYPE:
            hit.add(int(message.first_sample), count_points(message))
            hit.origin = origin_from_msg(message)
            hit.is_finished |= bool(message.last)
        elif type_name == STORED_TYPE:
            hit.stored_blocks = int(message.blocks)
        elif type_name == VERDICT_TYPE:
            hit.rejections = tuple(map(_read_reason, message.reasons[:MOST_TEXTS]))
            hit.is_accepted = bool(message.accepted)

    @property
    def repeated(self) -> int:
        """Number of blocks that have come a second time."""
        return sum(rig.watch.repeated for rig in self._rigs.values())

    def list_hits(self, *, is_whole: bool, is_live: bool = False) -> tuple[RecordedHit, ...]:
        """Return the hits in the order in which they happened.

        Parameters
        ----------
        is_whole : bool
            Whether the recording is known to hold all that was written.
        is_live : bool
            Whether it is being recorded: the newest hit may be under way.
        """
        found: list[RecordedHit] = []
        for name, rig in self._rigs.items():
            hits = list(rig.hits.values())
            for hit in hits:
                hit.judge(is_whole=is_whole)
            if is_live and hits and hits[-1].state is not HitState.SAVED:
                hits.pop()
            if is_whole:
                # Without anything to record it was called off, or is a stranger's.
                found += [hit for hit in hits if hit.blocks or hit.stored_blocks is not None]
            else:
                hits += _find_vanished(name, hits)
                found += sorted(hits, key=lambda hit: (hit.campaign, hit.record))
        return tuple(found)


def _read_reason(found: Any) -> RecordedReason:
    code, text = ("", found) if isinstance(found, str) else (found.reason, found.explanation)
    return RecordedReason(str(code)[:LONGEST_TEXT], str(text)[:LONGEST_TEXT])


def _find_vanished(name: str, hits: list[RecordedHit]) -> list[RecordedHit]:
    """Return the records that are left out in the numbers: armings are counted."""
    campaigns = {hit.record: hit.campaign for hit in hits}
    missing = (
        RecordedHit(rig=name, campaign=campaigns[before], record=record, label=None)
        for before, after in pairwise(sorted(campaigns))
        for record in range(before + 1, after)
    )
    return list(islice(missing, MOST_VANISHED))
