"""Counts what a recording has of each record: its blocks, and the points that they lack."""

from collections import deque
from dataclasses import dataclass, field, replace

from impact_rig.core.signals.record import HitLabel

REMEMBERED = 100
"""How many of the last records are known to have ended [-], our choice: the end of an arming is
told less than a second after its last block."""


@dataclass(frozen=True)
class RecordCount:
    """What a recording has of one record.

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
    is_complete : bool
        No more blocks of it follow.
    """

    label: HitLabel
    blocks: int = 0
    gaps: int = 0
    missing_points: int = 0
    stamp: int = 0
    is_complete: bool = False


@dataclass
class _Openness:
    """A record whose last block has not come."""

    count: RecordCount
    expected: int = 0
    is_reported: bool = False


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
    """

    blocks: int = 0
    gaps: int = 0
    missing_points: int = 0
    _open: _Openness | None = None
    _finished: list[RecordCount] = field(default_factory=list)
    _ended: deque[int] = field(default_factory=lambda: deque(maxlen=REMEMBERED))

    @property
    def unfinished(self) -> RecordCount | None:
        """The record whose last block has not come; None: there is none."""
        return self._open.count if self._open else None

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
        if self._open is not None and self._open.count.label != label:
            self._end(self._open.count)
        if self._open is None:
            self._open = _Openness(RecordCount(label))
        record = self._open
        missing = max(first_sample - record.expected, 0)
        gap = int(first_sample != record.expected)
        record.count = replace(
            record.count,
            blocks=record.count.blocks + 1,
            gaps=record.count.gaps + gap,
            missing_points=record.count.missing_points + missing,
            stamp=stamp,
        )
        record.expected = first_sample + points
        record.is_reported = False
        self.blocks += 1
        self.gaps += gap
        self.missing_points += missing
        if last:
            self._end(record.count)

    def end(self, record: int, sample: str) -> None:
        """Note that an arming has ended, though its last block, or any block, never came."""
        if self._open is not None and self._open.count.label.record == record:
            self._end(self._open.count)
        elif not self.has_ended(record):
            self._end(RecordCount(HitLabel(sample, record=record, impact=0, attempt=0)))

    def collect(self, *, with_unfinished: bool = False) -> tuple[RecordCount, ...]:
        """Return the records that ended, and the unfinished one if it has grown, since last time.

        Parameters
        ----------
        with_unfinished : bool
            Whether the unfinished one is wanted.
        """
        counts = tuple(self._finished)
        self._finished.clear()
        if with_unfinished and self._open is not None and not self._open.is_reported:
            self._open.is_reported = True
            counts += (self._open.count,)
        return counts

    def _end(self, count: RecordCount) -> None:
        self._finished.append(replace(count, is_complete=True))
        self.begin(count.label.record)
        self._ended.append(count.label.record)
        # The word that an arming has ended may come when the next record is under way.
        if self._open is not None and self._open.count.label.record == count.label.record:
            self._open = None
