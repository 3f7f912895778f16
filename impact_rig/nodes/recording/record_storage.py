"""Follows the blocks on their way into a recording, and says when a record is on the disk."""

import time
from typing import Any, NamedTuple

from impact_rig_msgs.msg import AcquisitionState, RecordStored
from rclpy.serialization import deserialize_message

from impact_rig.core.signals.record import HitLabel
from impact_rig.nodes.messages import stamp_to_msg
from impact_rig.recording.interfaces.block_heads import read_block_head, read_stream_head
from impact_rig.recording.writing.record_watch import RecordWatch
from impact_rig.recording.writing.recording_writer import RecordingWriter
from impact_rig.recording.writing.stream_watch import StreamWatch

SYNC_HIT = "hit"
SYNC_CHUNK = "chunk"
SYNCS = (SYNC_HIT, SYNC_CHUNK)
"""When a record counts as stored: on the disk at its end, or when its chunk has been written."""
SETTLING_TIME = 0.5
"""How long the blocks of an arming that has ended may still be on their way [s], our choice: they
travel by another topic than the word of its end."""


class _Ending(NamedTuple):
    """An arming that has ended: of which sample, with how many blocks, and when they are all."""

    sample: str
    blocks: int
    due: float


class RecordStorage:
    """Counts blocks as they are written, has records put on the disk, and publishes that they are.

    Parameters
    ----------
    writer : RecordingWriter
        What it writes to.
    publisher : Publisher
        Of `RecordStored`.
    sync : str
        One of `SYNCS`.

    Attributes
    ----------
    watch : RecordWatch
        What the recording has of each record.
    stream : StreamWatch
        What it has of the running stream.
    longest_lag : float
        Longest time from the sending of a record's block to its being written [s]; between two
        computers it holds the difference of their clocks.
    longest_stream_lag : float
        The same of the stream's blocks.
    """

    def __init__(
        self,
        writer: RecordingWriter,
        publisher: Any,
        sync: str,
    ) -> None:
        self.watch = RecordWatch()
        self.stream = StreamWatch()
        self.longest_lag = 0.0
        self.longest_stream_lag = 0.0
        self._writer = writer
        self._publisher = publisher
        self._sync = sync
        self._arming: AcquisitionState | None = None
        self._endings: dict[int, _Ending] = {}
        self._unfinished: HitLabel | None = None

    def take_block(self, data: bytes, sent: int) -> None:
        """Count a block that was written; the end of its record puts that on the disk."""
        head = read_block_head(data)
        self.watch.add(head.label, head.first_sample, head.points, head.stamp, last=head.last)
        self._store_finished()
        self.longest_lag = max(self.longest_lag, _measure_lag(sent))

    def take_stream_block(self, data: bytes, sent: int) -> None:
        """Count a block of the running stream that was written."""
        head = read_stream_head(data)
        self.stream.add(head.first_sample, head.points)
        self.longest_stream_lag = max(self.longest_stream_lag, _measure_lag(sent))

    def take_acquisition_state(self, data: bytes, _: int) -> None:
        """Note that an arming begins or ends; an ended one gets no more blocks."""
        previous, self._arming = self._arming, deserialize_message(data, AcquisitionState)
        if self._arming.state == AcquisitionState.ARMED:
            self.watch.begin(self._arming.record)
        elif previous is not None and self._arming.record:
            # The first word is of what was before this recording. Later ones may come so soon
            # after another that only the last is heard.
            is_known = previous.record == self._arming.record
            self._expect_end(self._arming.record, previous.sample if is_known else "")

    def end_quiet_records(self) -> None:
        """End records whose arming has ended and of which nothing comes; call it now and then."""
        now = time.monotonic()
        for record, ending in tuple(self._endings.items()):
            if ending.due > now:
                continue
            del self._endings[record]
            if self._count_unfinished(record) != ending.blocks:
                self._expect_end(record, ending.sample)
            elif not self.watch.has_ended(record):
                self.watch.end(record, ending.sample)
                self._store_finished()

    def flush(self) -> None:
        """Write what waits; call it now and then. A record that goes on is told of in parts."""
        unfinished = self.watch.unfinished
        label = unfinished.label if unfinished else None
        goes_on = label is not None and label == self._unfinished
        self._unfinished = label
        if goes_on and self._sync == SYNC_HIT:
            self._writer.sync()
        else:
            self._writer.flush()
        self.publish_stored(with_unfinished=goes_on)

    def publish_stored(self, *, with_unfinished: bool = False) -> None:
        """Say which records have been stored since the last time."""
        for count in self.watch.collect(with_unfinished=with_unfinished):
            label = count.label
            message = RecordStored(
                record=label.record,
                sample=label.sample,
                impact=label.impact,
                attempt=label.attempt,
                complete=count.is_complete,
                blocks=count.blocks,
                gaps=count.gaps,
                missing_points=count.missing_points,
            )
            message.header.stamp = stamp_to_msg(count.stamp)
            self._publisher.publish(message)

    def _count_unfinished(self, record: int) -> int:
        """Return how many blocks of a record that goes on have come."""
        unfinished = self.watch.unfinished
        return unfinished.blocks if unfinished and unfinished.label.record == record else 0

    def _expect_end(self, record: int, sample: str) -> None:
        if not self.watch.has_ended(record):
            blocks, due = self._count_unfinished(record), time.monotonic() + SETTLING_TIME
            self._endings[record] = _Ending(sample, blocks, due)

    def _store_finished(self) -> None:
        if self._sync == SYNC_HIT and self.watch.has_finished:
            self._writer.sync()
            self.publish_stored()


def _measure_lag(sent: int) -> float:
    return (time.time_ns() - sent) / 1e9
