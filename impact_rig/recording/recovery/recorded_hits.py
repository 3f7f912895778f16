"""What a recording has of each hit: all of it, a part, or only that it happened."""

from dataclasses import dataclass, field
from enum import Enum
from itertools import islice, pairwise
from typing import Any

from impact_rig.core.signals.record import HitLabel
from impact_rig.recording.interfaces.messages import label_from_msg
from impact_rig.recording.reading.mcap_reader import BLOCK_TYPE, SETUP_TYPE, VIRTUAL_IMPACT_TYPE

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


@dataclass
class _Rig:
    """What was found of one rig so far."""

    setup: bytes = b""
    campaign: int = 1
    hits: dict[tuple[int, HitLabel], _Evidence] = field(default_factory=dict)


class HitWatch:
    """Takes the messages that tell of hits, in file order.

    A message that is there but not kept tells that its hit happened, and no more.
    """

    def __init__(self) -> None:
        self._rigs: dict[str, _Rig] = {}

    def add(self, topic: str, type_name: str, message: Any, data: bytes, *, is_kept: bool) -> None:
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
            if is_kept and data != rig.setup:
                rig.campaign += bool(rig.setup)
                rig.setup = data
            return
        if type_name == STORED_TYPE and not message.blocks:
            return  # an arming that ended without a hit
        label = label_from_msg(message)
        evidence = rig.hits.setdefault((rig.campaign, label), _Evidence(label))
        if not is_kept:
            return
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
