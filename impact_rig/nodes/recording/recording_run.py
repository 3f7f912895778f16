"""One recording in the making: everything that lasts from a recorder's activation to its end."""

import contextlib
import time
from collections.abc import Callable, Iterable
from typing import Any

import rclpy
from rcl_interfaces.msg import ParameterEvent
from rclpy.serialization import deserialize_message

from impact_rig.core.errors import FileError
from impact_rig.nodes import interfaces
from impact_rig.nodes.recording.node_parameters import NodeParameters
from impact_rig.nodes.recording.record_storage import RecordStorage
from impact_rig.nodes.recording.recorder_topics import PARAMETER_EVENTS, RecordedTopics
from impact_rig.nodes.rig_node import RigNode
from impact_rig.nodes.unhurried import TAKING_PERIOD
from impact_rig.recording.writing.origin import (
    ORIGIN_RECORD,
    PARAMETERS_RECORD,
    AttachedFile,
    describe_origin,
)
from impact_rig.recording.writing.recording_writer import RecordingWriter
from impact_rig.recording.writing.split_contents import HEALTH_RECORD

DISCOVERY_PERIOD = 0.2
"""How often further topics and nodes are looked for [s], our choice: the ROS graph sends no event
here."""
SPLIT = "split"
"""How a file ended that another one follows."""


class RecordingRun:
    """Subscribes, writes and counts, until it is closed.

    Parameters
    ----------
    node : RigNode
        The recorder.
    open_writer : callable
        Returns the writer; called with what the writer is to call before it begins another file.
    sync : str
        When a record counts as stored, one of `record_storage.SYNCS`.
    publisher : Publisher
        Of `RecordStored`.
    fail : callable
        Called with the error if something cannot be written.
    stream_depth : int
        How many blocks of the running stream may wait to be written; 0: it is not recorded.

    Raises
    ------
    FileError
        If the recording cannot be begun.
    """

    def __init__(
        self,
        node: RigNode,
        open_writer: Callable[[Callable[[], None]], RecordingWriter],
        sync: str,
        publisher: Any,
        fail: Callable[[FileError], None],
        *,
        stream_depth: int,
    ) -> None:
        self._node = node
        self._fail = fail
        self._timers: list[Any] = []
        self._is_stream_recorded = stream_depth > 0
        self._stream_seen = (time.monotonic(), 0)
        self.writer = open_writer(lambda: self._write_health(SPLIT))
        self.storage = RecordStorage(self.writer, publisher, sync)
        readers = {
            interfaces.ACCELERATION.name: self.storage.take_block,
            interfaces.STREAM.name: self.storage.take_stream_block,
            interfaces.ACQUISITION_STATE.name: self.storage.take_acquisition_state,
            PARAMETER_EVENTS: self._note_parameter_event,
        }
        self._parameters = NodeParameters(node, self._write_parameters)
        try:
            self.topics = RecordedTopics(
                node,
                self.writer,
                {node.resolve_topic_name(name): read for name, read in readers.items()},
                fail,
                stream_depth=stream_depth,
            )
        except FileError:
            with contextlib.suppress(FileError):
                self.writer.close()
            raise

    @property
    def is_open(self) -> bool:
        """Whether it is being written to."""
        return not self.writer.closed

    def attach(self, files: Iterable[AttachedFile]) -> None:
        """Put files into the recording."""
        for file in files:
            self.writer.add_attachment(file.name, file.media_type, file.data)

    def write_origin(self, notes: str) -> None:
        """Write software, computer and notes into the recording; may be said anew."""
        middleware = rclpy.get_rmw_implementation_identifier()
        self.writer.add_metadata(ORIGIN_RECORD, describe_origin(middleware, notes))

    def start(self, flush_period: float) -> None:
        """Begin to look for further topics and nodes, and to flush."""
        self.call_every(TAKING_PERIOD, self._take_some)
        self.call_every(DISCOVERY_PERIOD, self._discover)
        if flush_period:
            self.call_every(flush_period, self.storage.flush)
        self._discover()

    def call_every(
        self,
        period: float,
        work: Callable[[], None],
        *,
        until: Callable[[], bool] = lambda: False,
    ) -> None:
        """Call `work` every `period` seconds until the end; a `FileError` in it is a failure.

        Or until something has come true, if that is earlier.
        """

        def guarded() -> None:
            if until():
                timer.cancel()
                return
            try:
                work()
            except FileError as error:
                self._fail(error)

        timer = self._node.create_timer(period, guarded)
        self._timers.append(timer)

    def describe_losses(self) -> str:
        """Return what the recording lacks, in words; empty: nothing."""
        lost = self.topics.messages_lost
        watch, stream = self.storage.watch, self.storage.stream
        counts = (
            ("blocks have", watch.gaps, watch.missing_points),
            ("stream has", stream.gaps, stream.missing_points),
        )
        parts = [
            f"the {what} {gaps} gap{'s' * (gaps > 1)}, {missing} points are missing"
            for what, gaps, missing in counts
            if gaps
        ]
        if lost:
            parts.append(f"{lost} message{'s' * (lost > 1)} did not get through")
        return "; ".join(parts)

    def diagnose_stream(self) -> dict[str, Any]:
        """Return figures on the running stream, its rate since the last time; none: no stream."""
        stream = self.storage.stream
        if not self._is_stream_recorded:
            return {}
        now = time.monotonic()
        (before, points_before), self._stream_seen = self._stream_seen, (now, stream.points)
        return {
            "stream blocks": stream.blocks,
            "stream rate [Hz]": f"{(stream.points - points_before) / (now - before):.4g}",
            "stream gaps": stream.gaps,
            "stream missing points": stream.missing_points,
            "longest stream lag [s]": f"{self.storage.longest_stream_lag:.3g}",
        }

    def close(self, reason: str) -> None:
        """Withdraw everything, say how it ended, and finish the recording.

        Raises
        ------
        FileError
            If its end could not be written; what was written before stays.
        """
        for timer in self._timers:
            self._node.destroy_timer(timer)
        self._timers.clear()
        # What cannot be said any more must not keep the file from being finished.
        with contextlib.suppress(FileError):
            self._parameters.close()
            self._write_health(reason)
        self.topics.close()
        self.writer.close()
        self.storage.publish_stored()

    def _take_some(self) -> None:
        self.topics.take_unhurried(TAKING_PERIOD)
        self.storage.end_quiet_records()

    def _discover(self) -> None:
        self.topics.discover()
        self._parameters.look()

    def _note_parameter_event(self, data: bytes, _: int) -> None:
        self._parameters.note_change(deserialize_message(data, ParameterEvent).node)

    def _write_parameters(self, texts: dict[str, str]) -> None:
        self.writer.add_metadata(PARAMETERS_RECORD, texts)

    def _write_health(self, reason: str) -> None:
        watch, stream = self.storage.watch, self.storage.stream
        self.writer.add_metadata(
            HEALTH_RECORD,
            {
                "reason": reason,
                "gaps": str(watch.gaps),
                "missing_points": str(watch.missing_points),
                "stream_blocks": str(stream.blocks),
                "stream_gaps": str(stream.gaps),
                "stream_missing_points": str(stream.missing_points),
                "stream_longest_lag": f"{self.storage.longest_stream_lag:.6f}",
                "messages_lost": str(self.topics.messages_lost),
                "longest_lag": f"{self.storage.longest_lag:.6f}",
                "topics_not_recorded": ", ".join(self.topics.skipped),
            },
        )
