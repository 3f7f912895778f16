"""One recording in the making: what it subscribes to, what is on the disk, and its end."""

import contextlib
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from typing import Any, NamedTuple

import rclpy
from impact_rig_msgs.msg import AcquisitionState, RecordStored
from rcl_interfaces.msg import ParameterEvent
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.topic_or_service_is_hidden import topic_or_service_is_hidden

from impact_rig.core.errors import FileError, RigError
from impact_rig.core.records import Origin
from impact_rig.nodes import interfaces
from impact_rig.nodes.executor import accept_message_info
from impact_rig.nodes.identity import Identity, Membership, read_campaign_id
from impact_rig.nodes.interfaces import Topic
from impact_rig.nodes.messages import stamp_to_msg
from impact_rig.nodes.recorder_node_parameters import NodeParameters
from impact_rig.nodes.rig_node import RateMeter, RigNode
from impact_rig.nodes.topics import adapt_qos, describe_qos, import_type, make_qos, name_type
from impact_rig.recordings.hits import BlockCount, RecordWatch
from impact_rig.recordings.messages import (
    NO_ID,
    STREAM_TYPE,
    prepare_heads,
    read_block_head,
)
from impact_rig.recordings.provenance import (
    ORIGIN_RECORD,
    PARAMETERS_RECORD,
    PROVENANCE_RECORD,
    describe_origins,
    describe_provenance,
)
from impact_rig.recordings.qos import OfferedQos
from impact_rig.recordings.records import Attachment
from impact_rig.recordings.schemas import find_message_definition
from impact_rig.recordings.writer import HEALTH_RECORD, RecordingWriter

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
    membership : Membership
        Whose records they are.

    Attributes
    ----------
    watch : RecordWatch
        What the recording has of each record.
    stream : BlockCount
        What it has of the running stream.
    origins : dict of Origin to None
        Where the blocks so far come from.
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
        membership: Membership,
    ) -> None:
        prepare_heads()
        self.watch = RecordWatch()
        self.stream = BlockCount()
        self.origins: dict[Origin, None] = {}
        self.longest_lag = 0.0
        self.longest_stream_lag = 0.0
        self._writer = writer
        self._publisher = publisher
        self._membership = membership
        self._streams: dict[int, bytes] = {}
        self._arming: AcquisitionState | None = None
        self._endings: dict[int, _Ending] = {}

    def take_block(self, data: bytes, sent: int) -> None:
        """Count a block that was written; the end of its record puts that on the disk."""
        head = read_block_head(data)
        self._streams[head.label.record] = head.stream_id
        self.watch.add(head.label, head.first_sample, head.points, head.stamp, last=head.last)
        self._note_origin(head.origin)
        self._store_finished()
        self.longest_lag = max(self.longest_lag, _measure_lag(sent))

    def take_stream_block(self, data: bytes, sent: int) -> None:
        """Count a block of the running stream that was written."""
        head = read_block_head(data, STREAM_TYPE)
        self.stream.add(head.first_sample, head.points)
        self._note_origin(head.origin)
        self.longest_stream_lag = max(self.longest_stream_lag, _measure_lag(sent))

    def _note_origin(self, origin: Origin) -> None:
        """Say in the recording where its blocks come from, once another source is met."""
        source = Origin(origin.kind, origin.source)
        if source not in self.origins:
            self.origins[source] = None
            self._writer.add_metadata(ORIGIN_RECORD, describe_origins(self.origins))

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

    def publish_stored(self) -> None:
        """Say which records have been stored since the last time."""
        for count in self.watch.collect():
            message = RecordStored(
                **asdict(count.label),
                blocks=count.blocks,
                gaps=count.gaps,
                missing_points=count.missing_points,
            )
            stream_id = self._streams.pop(count.label.record, NO_ID)
            Identity(self._membership.identity.campaign_id, stream_id).fill(message)
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
        if self.watch.has_finished:
            self._writer.sync()
            self.publish_stored()


def _measure_lag(sent: int) -> float:
    return (time.time_ns() - sent) / 1e9


QUEUE_DEPTH = 2000
"""Depth of the queue of a topic [messages], our choice: almost a second of blocks of 1000 points
at 2.5 MS/s, in which the disk may stand still. Only what waits takes memory."""
PARAMETER_EVENTS = "/parameter_events"
"""Tells of every parameter that is set on any node."""
_STREAM_TYPE = name_type(interfaces.STREAM.type)
GLOBAL_TOPICS = ("/diagnostics", "/rosout", PARAMETER_EVENTS)
"""Topics outside the rig's namespace that tell of its health and of what it was told to do."""


class RecordedTopics:
    """Raw subscriptions that write what they get to a recording, as received.

    Parameters
    ----------
    node : RigNode
        Whose namespace is recorded.
    writer : RecordingWriter
        Where everything goes.
    readers : mapping
        Function by full topic name, called with each message of the topic, serialised, and the
        time when it was sent [ns], once it is written.
    fail : callable
        Called with the error if something cannot be written.
    stream_depth : int
        How many blocks of the running stream may wait to be written; 0: it is not recorded.

    Attributes
    ----------
    skipped : dict
        Why a topic is not recorded, by its full name.
    messages_lost : int
        Messages that the middleware dropped on their way here, as far as it numbers them.
    """

    def __init__(
        self,
        node: RigNode,
        writer: RecordingWriter,
        readers: Mapping[str, Callable[[bytes, int], None]],
        fail: Callable[[FileError], None],
        *,
        stream_depth: int,
    ) -> None:
        self._node = node
        self._writer = writer
        self._readers = readers
        self._fail = fail
        self._subscriptions: dict[str, Any] = {}
        self._stream_name = node.resolve_topic_name(interfaces.STREAM.name)
        self.skipped: dict[str, str] = {}
        self.messages_lost = 0
        # Of states that follow each other closely, all are wanted, not the last alone.
        for topic in interfaces.RECORDED_TOPICS:
            self._record_own(topic, QUEUE_DEPTH)
        if stream_depth:
            self._record_own(interfaces.STREAM, stream_depth)

    def __len__(self) -> int:
        """Return how many topics are recorded."""
        return len(self._subscriptions)

    def list_unconnected(self, names: list[str]) -> list[str]:
        """Return those of some topics, by their relative names, that nobody publishes yet."""
        inputs = {
            name: self._subscriptions.get(self._node.resolve_topic_name(name)) for name in names
        }
        return [
            name for name, item in inputs.items() if not item or not item.get_publisher_count()
        ]

    def discover(self) -> None:
        """Subscribe to what else is published below the namespace, and to the global topics."""
        prefix = self._node.get_namespace().rstrip("/") + "/"
        for topic, types in self._node.get_topic_names_and_types():
            if topic in self._subscriptions or topic in self.skipped:
                continue
            if topic_or_service_is_hidden(topic):
                continue
            if _STREAM_TYPE in types and self._stream_name not in self._subscriptions:
                continue
            if topic.startswith(prefix) or topic in GLOBAL_TOPICS:
                publishers = self._node.get_publishers_info_by_topic(topic)
                if publishers:
                    self._record_discovered(topic, types, publishers)

    def close(self) -> None:
        """Withdraw the subscriptions."""
        for subscription in self._subscriptions.values():
            self._node.destroy_subscription(subscription)
        self._subscriptions.clear()

    def _record_own(self, topic: Topic, depth: int) -> None:
        offer = describe_qos(topic.qos)
        self._record(topic.name, topic.type, make_qos(offer, depth), (offer,), own=topic)

    def _record(
        self,
        name: str,
        kind: Any,
        qos: QoSProfile,
        offers: tuple[OfferedQos, ...],
        *,
        own: Topic | None = None,
    ) -> None:
        topic = self._node.resolve_topic_name(name)
        writer, read = self._writer, self._readers.get(topic)
        channel = writer.add_channel(topic, find_message_definition(name_type(kind)), offers)
        carries_id = "campaign_id" in kind.get_fields_and_field_types()
        membership = self._node.membership
        previous: int | None = None

        def write(data: bytes, info: Mapping[str, Any]) -> None:
            nonlocal previous
            self._node.messages_handled += 1
            if writer.closed:
                return
            if carries_id and membership.is_foreign_id(read_campaign_id(data), name):
                return
            if own and not self._node.message_check.accepts_bytes(own, data):
                return
            received = info["received_timestamp"] or time.time_ns()
            sent = info["source_timestamp"] or received
            number = info.get("publication_sequence_number")
            if number and previous and number > previous + 1:
                self._count_lost(topic, number - previous - 1)
            previous = number
            try:
                writer.add_message(channel, data, received, sent)
                if read is not None:
                    read(data, sent)
            except FileError as error:
                self._fail(error)

        self._subscriptions[topic] = self._node.create_subscription(
            kind,
            name,
            accept_message_info(write),
            qos,
            event_callbacks=SubscriptionEventCallbacks(
                use_default_callbacks=False,
            ),
            raw=True,
        )

    def _count_lost(self, topic: str, count: int) -> None:
        # The middleware reports no loss where a queue runs over, but it numbers what one
        # publisher sends; the numbers of several go on independently.
        if self._subscriptions[topic].get_publisher_count() == 1:
            self.messages_lost += count

    def _record_discovered(
        self, topic: str, types: list[str], publishers: list[TopicEndpointInfo]
    ) -> None:
        try:
            if len(types) > 1:
                raise FileError(f"it has several types: {', '.join(types)}")
            kind = import_type(types[0])
            offers = tuple(describe_qos(item.qos_profile) for item in publishers)
            self._record(topic, kind, adapt_qos(publishers, QUEUE_DEPTH), offers)
        except RigError as error:
            self.skipped[topic] = str(error)
            self._node.get_logger().warning(f"{topic} is not recorded: {error}")


DISCOVERY_PERIOD = 0.2
"""How often further topics and nodes are looked for [s], our choice: the ROS graph sends no event
here."""
QUIET_PERIOD = 0.05
"""How often it is looked whether a record has come to its end without a last block [s], our
choice."""


class RecordingRun:
    """Subscribes, writes and counts, until it is closed.

    Parameters
    ----------
    node : RigNode
        The recorder.
    writer : RecordingWriter
        Of the new recording.
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
        writer: RecordingWriter,
        publisher: Any,
        fail: Callable[[FileError], None],
        *,
        stream_depth: int,
    ) -> None:
        self._node = node
        self._fail = fail
        self._timers: list[Any] = []
        self._is_stream_recorded = stream_depth > 0
        self._stream_rate = RateMeter()
        self.writer = writer
        self.storage = RecordStorage(self.writer, publisher, node.membership)
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

    def attach(self, files: Iterable[Attachment]) -> None:
        """Put files into the recording."""
        for file in files:
            self.writer.add_attachment(file.name, file.media_type, file.data)

    def write_provenance(self, notes: str) -> None:
        """Write software, computer and notes into the recording; may be said anew."""
        middleware = rclpy.get_rmw_implementation_identifier()
        self.writer.add_metadata(PROVENANCE_RECORD, describe_provenance(middleware, notes))

    def start(self, flush_period: float) -> None:
        """Begin to look for further topics and nodes, and to flush."""
        self.call_every(QUIET_PERIOD, self.storage.end_quiet_records)
        self.call_every(DISCOVERY_PERIOD, self._discover)
        if flush_period:
            self.call_every(flush_period, self.writer.flush)
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
            # A timer that was due when it was destroyed is still called.
            if timer not in self._timers:
                return
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
        return {
            "stream blocks": stream.blocks,
            "stream rate [Hz]": f"{self._stream_rate.measure(stream.points):.4g}",
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
