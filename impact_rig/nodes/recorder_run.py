"""One recording in the making: what it subscribes to, what is on the disk, and its end."""

import contextlib
import importlib
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from impact_rig_msgs.msg import AccelerationBlock, RecordStored, StreamBlock
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.topic_or_service_is_hidden import topic_or_service_is_hidden

from impact_rig.core.errors import FileError, RigError
from impact_rig.nodes import interfaces
from impact_rig.nodes.executor import accept_message_info
from impact_rig.nodes.identity import Identity
from impact_rig.nodes.interfaces import Topic
from impact_rig.nodes.messages import stamp_to_msg
from impact_rig.nodes.rig_node import PARAMETERS, RigNode
from impact_rig.recordings.hits import BlockCount, RecordCount, RecordWatch
from impact_rig.recordings.messages import STREAM_TYPE, count_points
from impact_rig.recordings.provenance import (
    PARAMETERS_RECORD,
    PROVENANCE_RECORD,
    describe_provenance,
)
from impact_rig.recordings.records import INFINITE, OfferedQos
from impact_rig.recordings.schemas import find_message_definition
from impact_rig.recordings.writer import HEALTH_RECORD, RecordingWriter

QUEUE_DEPTH = 2000
"""Depth of the queue of a topic [messages]: almost a second of blocks of 1000 points
at 2.5 MS/s, in which the disk may stand still. Only waiting messages take memory."""


def import_type(type_name: str) -> Any:
    """Return the class of a message type, for example `std_msgs/msg/Header`.

    Raises
    ------
    FileError
        If it is not installed.
    """
    package, _, name = type_name.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, ValueError):
        raise FileError(f"message type {type_name} is not installed") from None


def describe_qos(profile: QoSProfile) -> OfferedQos:
    """Return a profile as it is kept in a recording."""
    return OfferedQos(
        reliability=profile.reliability.name.lower(),
        durability=profile.durability.name.lower(),
        history=profile.history.name.lower(),
        depth=profile.depth,
        lifespan=profile.lifespan.nanoseconds or INFINITE,
    )


def adapt_qos(publishers: Iterable[TopicEndpointInfo], depth: int) -> QoSProfile:
    """Return the strictest profile that receives from all publishers, as rosbag2 does."""
    offers = [item.qos_profile for item in publishers]
    is_reliable = all(item.reliability == ReliabilityPolicy.RELIABLE for item in offers)
    is_latched = all(item.durability == DurabilityPolicy.TRANSIENT_LOCAL for item in offers)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if is_reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if is_latched else DurabilityPolicy.VOLATILE,
    )


class RecordingRun:
    """Subscribes to the topics of a rig, writes what comes as received, and counts it.

    The record of a hit is put on the disk when its last block is written; then `RecordStored` is
    published.

    Parameters
    ----------
    node : RigNode
        The recorder.
    writer : RecordingWriter
        Of the new recording.
    publisher : Publisher
        Of `RecordStored`.
    on_failed : callable
        Called with the error if something cannot be written.
    record_stream : bool
        Whether the running stream is recorded.

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
        on_failed: Callable[[FileError], None],
        *,
        record_stream: bool,
    ) -> None:
        self.writer = writer
        self.records = RecordWatch()
        self.stream = BlockCount()
        self.messages_lost = 0  # dropped by the middleware, as far as it numbers them
        self._node = node
        self._prefix = node.get_namespace().rstrip("/") + "/"
        self._publisher = publisher
        self._on_failed = on_failed
        self._subscriptions: dict[str, Any] = {}
        self._skipped: dict[str, str] = {}  # topics that are not recorded, and why
        self._record_stream = record_stream
        self._parameters: dict[str, str] = {}  # in YAML, by full node name
        self._on_written: dict[str, Callable[[Any], None]] = {
            node.resolve_topic_name(interfaces.ACCELERATION.name): self._on_block,
            node.resolve_topic_name(interfaces.STREAM.name): self._on_stream_block,
            interfaces.DIAGNOSTICS.name: self._on_diagnostics,
        }
        try:
            for topic in interfaces.RECORDED_TOPICS:
                self._record_own(topic)
            if record_stream:
                self._record_own(interfaces.STREAM)
        except FileError:
            with contextlib.suppress(FileError):
                self.writer.close()
            raise

    def write_provenance(self, notes: str) -> None:
        """Write software, computer and notes into the recording."""
        middleware = rclpy.get_rmw_implementation_identifier()
        self.writer.add_metadata(PROVENANCE_RECORD, describe_provenance(middleware, notes))

    def discover(self) -> None:
        """Record further topics below the namespace, and global ones."""
        for topic, types in self._node.get_topic_names_and_types():
            if topic in self._subscriptions or topic in self._skipped:
                continue
            is_ours = topic.startswith(self._prefix) and not topic_or_service_is_hidden(topic)
            is_global = topic in (interfaces.DIAGNOSTICS.name, "/rosout", "/parameter_events")
            is_left_out = STREAM_TYPE in types and not self._record_stream
            if (is_ours or is_global) and not is_left_out:
                publishers = self._node.get_publishers_info_by_topic(topic)
                if publishers:
                    self._record_discovered(topic, types, publishers)

    def describe_losses(self) -> str | None:
        """Return what the recording lacks."""
        parts = [
            f"the {name} {count.gaps} gap{'s' * (count.gaps > 1)}, {count.missing_points} points"
            " are missing"
            for name, count in (("blocks have", self.records.total), ("stream has", self.stream))
            if count.gaps
        ]
        if lost := self.messages_lost:
            parts.append(f"{lost} message{'s' * (lost > 1)} did not get through")
        return "; ".join(parts) or None

    def describe_health(self) -> dict[str, Any]:
        """Return what was counted, by names for the recording and the diagnostics."""
        total, stream = self.records.total, self.stream
        return {
            "blocks": total.blocks,
            "gaps": total.gaps,
            "missing_points": total.missing_points,
            "stream_blocks": stream.blocks,
            "stream_gaps": stream.gaps,
            "stream_missing_points": stream.missing_points,
            "messages_lost": self.messages_lost,
            "topics_not_recorded": ", ".join(self._skipped),
        }

    def diagnose(self) -> dict[str, Any]:
        """Return figures for the diagnostics."""
        return {
            "file": self.writer.path,
            "messages": self.writer.messages,
            "size": self.writer.size,
            "topics": len(self._subscriptions),
            **{name.replace("_", " "): value for name, value in self.describe_health().items()},
        }

    def close(self, reason: str) -> None:
        """Withdraw the subscriptions, write how it ended, and finish the recording.

        Raises
        ------
        FileError
            If its end could not be written; what was written before stays.
        """
        health = {name: str(value) for name, value in self.describe_health().items()}
        # An error here must not keep the file from being finished.
        with contextlib.suppress(FileError):
            self.writer.add_metadata(HEALTH_RECORD, {"reason": reason, **health})
        for subscription in self._subscriptions.values():
            self._node.destroy_subscription(subscription)
        self._subscriptions.clear()
        self.writer.close()

    def _record_own(self, topic: Topic) -> None:
        # All of several states in quick succession are wanted, not only the last.
        qos = topic.deepen(QUEUE_DEPTH).qos
        self._record(topic, qos, (describe_qos(topic.qos),), is_own=True)

    def _record_discovered(
        self, topic: str, types: list[str], publishers: list[TopicEndpointInfo]
    ) -> None:
        try:
            if len(types) > 1:
                raise FileError(f"it has several types: {', '.join(types)}")
            offers = tuple(describe_qos(item.qos_profile) for item in publishers)
            qos = adapt_qos(publishers, QUEUE_DEPTH)
            self._record(Topic(topic, import_type(types[0]), qos), qos, offers)
        except RigError as error:
            self._skipped[topic] = str(error)
            self._node.get_logger().warning(f"{topic} is not recorded: {error}")

    def _record(
        self,
        topic: Topic,
        qos: QoSProfile,
        offers: tuple[OfferedQos, ...],
        *,
        is_own: bool = False,
    ) -> None:
        node, full_name = self._node, self._node.resolve_topic_name(topic.name)
        on_written = self._on_written.get(full_name)
        definition = find_message_definition(topic.type_name)
        channel = self.writer.add_channel(full_name, definition, offers)
        previous: int | None = None

        def on_message(data: bytes, info: Mapping[str, Any]) -> None:
            nonlocal previous
            node.messages_handled += 1
            if self.writer.closed:
                return
            message = None
            if is_own:
                message = deserialize_message(data, topic.type)
                if not node.takes(topic, message):
                    return
            received = info["received_timestamp"] or time.time_ns()
            sent = info["source_timestamp"] or received
            number = info.get("publication_sequence_number")
            if number and previous and number > previous + 1:
                self._count_lost(full_name, number - previous - 1)
            previous = number
            try:
                self.writer.add_message(channel, data, received, sent)
                if on_written is not None:
                    on_written(message or deserialize_message(data, topic.type))
            except FileError as error:
                self._on_failed(error)

        self._subscriptions[full_name] = node.create_subscription(
            topic.type,
            topic.name,
            accept_message_info(on_message),
            qos,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            raw=True,
        )

    def _count_lost(self, topic: str, count: int) -> None:
        # The middleware reports no loss where a queue overflows, but it numbers the messages of
        # each publisher.
        if self._subscriptions[topic].get_publisher_count() == 1:
            self.messages_lost += count

    def _on_block(self, message: AccelerationBlock) -> None:
        """Count a block that was written; the end of its record puts that on the disk."""
        if ended := self.records.add(message):
            self.writer.sync()
            for count in ended:
                self._publish_stored(count)

    def _on_stream_block(self, message: StreamBlock) -> None:
        self.stream.add(message.first_sample, count_points(message))

    def _publish_stored(self, count: RecordCount) -> None:
        message = RecordStored(
            **asdict(count.label),
            blocks=count.blocks,
            gaps=count.gaps,
            missing_points=count.missing_points,
        )
        Identity(self._node.membership.identity.campaign_id, count.stream_id).fill(message)
        message.header.stamp = stamp_to_msg(count.stamp)
        self._publisher.publish(message)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """Write the parameters of a node of the rig that have not been written yet."""
        membership = self._node.membership
        for status in message.status:
            node, _, what = status.name.rpartition("/")
            campaign = membership.identity.campaign_id.hex()
            is_foreign = membership.is_joined and status.message != campaign
            if what != PARAMETERS or is_foreign or not node.startswith(self._prefix):
                continue
            text = "".join(f"{item.key}: {item.value}\n" for item in status.values)
            if self._parameters.get(node) != text:
                self._parameters[node] = text
                self.writer.add_metadata(PARAMETERS_RECORD, self._parameters)
