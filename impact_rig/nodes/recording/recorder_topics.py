"""What a recorder subscribes to: the rig's topics at once, others as they are discovered.

What somebody waits for, the blocks of hits, is written as soon as it comes, after what came before
it. All else is taken out of its queue now and then.
"""

import time
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.qos import QoSProfile
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.topic_or_service_is_hidden import topic_or_service_is_hidden

from impact_rig.core.errors import FileError, RigError
from impact_rig.nodes import interfaces
from impact_rig.nodes.interfaces import Topic
from impact_rig.nodes.rig_node import RigNode
from impact_rig.nodes.topics import adapt_qos, describe_qos, import_type, make_qos, name_type
from impact_rig.nodes.unhurried import TAKING_PERIOD, UnhurriedGroup, take_message
from impact_rig.recording.interfaces.message_definitions import find_message_definition
from impact_rig.recording.interfaces.qos_profiles import OfferedQos
from impact_rig.recording.writing.recording_writer import RecordingWriter

QUEUE_DEPTH = 2000
"""Depth of the queue of a topic [messages], our choice: almost a second of blocks of 1000 points
at 2.5 MS/s, in which the disk may stand still. Only what waits takes memory."""
LARGEST_HELPING = 50
"""How many messages of one topic may be written before it is another one's turn [-], our
choice."""
URGENT = (interfaces.SETUP, interfaces.ACCELERATION, interfaces.ACQUISITION_STATE)
"""Topics that are written as soon as something comes: a verdict waits for it."""
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
        self._writes: dict[str, Callable[[bytes, Mapping[str, Any]], None]] = {}
        self._unhurried = UnhurriedGroup()
        self._leisurely: list[str] = []
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

    def find_unconnected(self, names: list[str]) -> list[str]:
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

    def take_unhurried(self, longest: float) -> None:
        """Write what nobody waits for until its queues are empty, or that long [s].

        What is waited for comes by the executor, behind what led to it.
        """
        stream = [self._stream_name] if self._stream_name in self._subscriptions else []
        self._take_from([*self._leisurely, *stream], longest)

    def take_waiting(self, longest: float) -> None:
        """Write what is in the queues until they are empty, or that long [s]: at the end."""
        self._take_from(self._leisurely, longest)
        self._take_from(list(self._subscriptions), longest)

    def close(self) -> None:
        """Withdraw the subscriptions."""
        for subscription in self._subscriptions.values():
            self._node.destroy_subscription(subscription)
        self._subscriptions.clear()
        self._leisurely.clear()

    def _record_own(self, topic: Topic, depth: int) -> None:
        offer = describe_qos(topic.qos)
        self._record(topic.name, topic.type, make_qos(offer, depth), (offer,))

    def _record(
        self, name: str, kind: Any, qos: QoSProfile, offers: tuple[OfferedQos, ...]
    ) -> None:
        topic = self._node.resolve_topic_name(name)
        writer, read = self._writer, self._readers.get(topic)
        channel = writer.add_channel(topic, find_message_definition(name_type(kind)), offers)
        previous: int | None = None

        def write(data: bytes, info: Mapping[str, Any]) -> None:
            nonlocal previous
            self._node.messages_handled += 1
            if writer.closed:
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

        def write_helping(data: bytes, info: Mapping[str, Any]) -> None:
            # What led to it stands before it in the file, and reaches the disk with it.
            self._take_from(self._leisurely, TAKING_PERIOD)
            write(data, info)
            self._take_helping(topic)

        is_urgent = name in {item.name for item in URGENT}
        if not is_urgent and topic != self._stream_name:
            self._leisurely.append(topic)
        group = None if is_urgent else self._unhurried
        self._writes[topic] = write
        self._subscriptions[topic] = self._node.create_subscription(
            kind, name, write_helping, qos, callback_group=group, raw=True
        )

    def _take_from(self, waiting: list[str], longest: float) -> None:
        deadline = time.monotonic() + longest
        while waiting and time.monotonic() < deadline:
            waiting = [topic for topic in waiting if self._take_helping(topic)]

    def _take_helping(self, topic: str) -> bool:
        """Write some messages of a topic; return whether there may be more."""
        subscription = self._subscriptions.get(topic)
        for _ in range(LARGEST_HELPING):
            if subscription is None or self._writer.closed:
                return False
            taken = take_message(subscription, raw=True)
            if taken is None:
                return False
            self._writes[topic](*taken)
        return True

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
