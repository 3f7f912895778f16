"""Which blocks the estimator evaluates, and when: no verdict outlives its hit."""

from collections import deque
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from impact_rig_msgs.msg import AccelerationBlock, RecordStored, RigSetup

from impact_rig.core.signals.record import HitLabel
from impact_rig.nodes.interfaces import RESULT_DEPTH
from impact_rig.recordings.messages import label_from_msg, stamp_from_msg


class _Block(NamedTuple):
    """A block, counted from 1 within its record."""

    message: AccelerationBlock
    number: int


class StorageGate:
    """Lets set-ups and blocks pass in their order, each block when the recorder has stored it.

    Attributes
    ----------
    is_open : bool
        Whether everything passes, because nobody records.
    """

    def __init__(self) -> None:
        self.is_open = True
        self._waiting: deque[_Block | RigSetup] = deque()
        self._stored: dict[int, RecordStored] = {}
        self._totals: dict[int, int] = {}
        self._last: _Block | None = None

    def add_setup(self, message: RigSetup) -> None:
        """Take a set-up, which holds for the blocks after it."""
        self._waiting.append(message)

    def add_block(self, message: AccelerationBlock) -> None:
        """Take a block."""
        last = self._last
        goes_on = (
            last is not None
            and not last.message.last
            and label_from_msg(last.message) == label_from_msg(message)
        )
        self._last = _Block(message, last.number + 1 if last and goes_on else 1)
        self._waiting.append(self._last)
        if message.last:
            self._totals[message.record] = self._last.number

    def add_stored(self, message: RecordStored) -> str:
        """Take the recorder's word; return what it means for a record that waits, if it is bad.

        Records are stored in their order: what still waits when a later one is stored never
        will be.
        """
        known = self._stored.pop(message.record, message)
        self._stored[message.record] = max(known, message, key=_rank)
        while len(self._stored) > RESULT_DEPTH:
            del self._stored[next(iter(self._stored))]
        first = self._find_first_block()
        if first is None or first.record == message.record:
            return ""
        if self.is_open or _read_time(message) <= _read_time(first):
            return ""
        return self.drop(first.record)

    def drop(self, record: int | None = None) -> str:
        """Forget the waiting blocks of one record; or of all, and all that was stored.

        Returns
        -------
        str
            A sentence about it; empty: none waited.
        """
        kept: deque[_Block | RigSetup] = deque()
        lost: dict[int, int] = {}
        for item in self._waiting:
            if isinstance(item, _Block) and record in (None, item.message.record):
                lost[item.message.record] = item.number
            else:
                kept.append(item)
        self._waiting = kept
        for number in lost:
            self._totals.pop(number, None)
        told = "; ".join(
            f"record {number} is not evaluated: the recorder has {self._count_stored(number)} of"
            f" its {count} blocks"
            for number, count in lost.items()
        )
        if record is None:
            self._stored.clear()
        return told

    def pass_on(self) -> Iterator[AccelerationBlock | RigSetup]:
        """Yield what may pass now."""
        while self._waiting and self._may_pass(self._waiting[0]):
            item = self._waiting.popleft()
            if isinstance(item, _Block):
                if item.message.last:
                    self._totals.pop(item.message.record, None)
                yield item.message
            else:
                yield item

    def describe_obstacle(self) -> str:
        """Return what is waited for; empty: nothing."""
        first = self._find_first_block()
        if first is None:
            return ""
        return f"the recorder has not said that record {first.record} is stored"

    def _may_pass(self, item: _Block | RigSetup) -> bool:
        if self.is_open or not isinstance(item, _Block):
            return True
        record = item.message.record
        stored = self._stored.get(record)
        return (
            stored is not None
            # Of a whole record all must be stored: the one that is not may be any of them.
            and stored.blocks >= self._totals.get(record, item.number)
            # The same number may have been used before the accelerometers were restarted.
            and _read_time(stored) >= _read_time(item.message)
        )

    def _count_stored(self, record: int) -> int:
        stored = self._stored.get(record)
        return stored.blocks if stored else 0

    def _find_first_block(self) -> AccelerationBlock | None:
        blocks = (item.message for item in self._waiting if isinstance(item, _Block))
        return next(blocks, None)


def _read_time(message: AccelerationBlock | RecordStored) -> int:
    return stamp_from_msg(message.header.stamp)


def _rank(message: RecordStored) -> tuple[int, int]:
    """Return what grows from one word on a record to the next."""
    return _read_time(message), message.blocks


class MissedStart:
    """Tells which blocks belong to a record whose start was sent before this node listened.

    A player does not wait until it has been found. Whoever publishes numbers its messages: if the
    first that comes from a publisher is neither its first nor the start of a record, the record is
    no hit. What is missing later, or from a publisher's first message, was lost.
    """

    def __init__(self) -> None:
        self._newest = 0
        self._label: HitLabel | None = None
        self._missed: HitLabel | None = None

    def is_missed(self, message: AccelerationBlock, info: Mapping[str, Any]) -> bool:
        """Return whether the next block that has come belongs to such a record."""
        number, label = int(info["publication_sequence_number"] or 0), label_from_msg(message)
        is_new_publisher = not self._newest or number <= self._newest
        if is_new_publisher and number > 1 and message.first_sample > 0:
            self._missed = label
        elif label != self._label:
            self._missed = None
        self._newest, self._label = number, None if message.last else label
        return label == self._missed
