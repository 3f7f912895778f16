"""The recorder: writes every topic of the rig to MCAP, as received."""

import contextlib
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from impact_rig_msgs.msg import AccelerationBlock, Overrule, RecordStored, StreamBlock
from impact_rig_msgs.srv import JoinCampaign
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.topic_or_service_is_hidden import topic_or_service_is_hidden
from std_msgs.msg import String

from impact_rig.configuration.processes import RECORDING_NAME, choose_run_folder, split_names
from impact_rig.core.given.errors import FileError, ParameterError, RigError
from impact_rig.core.given.setup import RigSetup
from impact_rig.nodes import interfaces
from impact_rig.nodes.executor import accept_message_info
from impact_rig.nodes.identity import Identity
from impact_rig.nodes.interfaces import Topic
from impact_rig.nodes.listener import adapt_qos, import_type
from impact_rig.nodes.messages import stamp_to_msg
from impact_rig.nodes.rig_node import PARAMETERS, RigNode
from impact_rig.recordings.contents import LONGEST_NOTE, MOST_NOTES
from impact_rig.recordings.hits import BlockCount, RecordCount, RecordWatch
from impact_rig.recordings.messages import STREAM_TYPE, count_points
from impact_rig.recordings.new_file import DiskFullError, choose_free
from impact_rig.recordings.provenance import describe_provenance, read_attached_file
from impact_rig.recordings.records import (
    HEALTH_RECORD,
    INFINITE,
    PARAMETERS_RECORD,
    PROVENANCE_RECORD,
    Attachment,
    OfferedQos,
)
from impact_rig.recordings.schemas import find_message_definition
from impact_rig.recordings.source import SUFFIX
from impact_rig.recordings.writer import RecordingWriter
from impact_rig.version import __version__


def describe_qos(profile: QoSProfile) -> OfferedQos:
    """Return a profile as it is kept in a recording."""
    return OfferedQos(
        reliability=profile.reliability.name.lower(),
        durability=profile.durability.name.lower(),
        history=profile.history.name.lower(),
        depth=profile.depth,
        lifespan=profile.lifespan.nanoseconds or INFINITE,
    )


class RecorderNode(RigNode):
    """Records while it is active: one activation, one recording.

    The record of a hit is put on the disk when its last block is written; then `RecordStored` is
    published.
    """

    # Depth of the queue of a topic [messages]: almost a second of blocks of 1000 points at
    # 2.5 MS/s, in which the disk may stand still. Only waiting messages take memory.
    queue_depth = 2000

    def __init__(self, **options: Any) -> None:
        super().__init__("recorder", **options)
        self._writer: RecordingWriter | None = None  # of the newest recording
        self._message = ""
        self._prefix = self.get_namespace().rstrip("/") + "/"
        self._recorded: dict[str, Any] = {}
        self._forget()
        self._publish = self.advertise_state(interfaces.RECORDER_STATE)
        self._stored = self.advertise(interfaces.RECORD_STORED)
        self._newest_stored: RecordStored | None = None
        self._stored_overrule = self.advertise(interfaces.OVERRULE_STORED)
        self._on_written: dict[str, Callable[[RecordingWriter, Any], None]] = {
            self.resolve_topic_name(interfaces.ACCELERATION.name): self._on_block,
            self.resolve_topic_name(interfaces.STREAM.name): self._on_stream_block,
            self.resolve_topic_name(interfaces.OVERRULE.name): self._on_overrule,
            interfaces.DIAGNOSTICS.name: self._on_diagnostics,
        }
        for period, work in ((0.2, self._discover), (1.0, self._check_health)):
            self.create_timer(period / self.pace, partial(self._run_guarded, work))
        self.offer_to_join()

    def configure(self) -> None:
        """Check the name of the recording."""
        output = self.get_value("output")
        if output and Path(output).suffix != SUFFIX:
            raise ParameterError(f"output is {output!r}: the name must end in {SUFFIX}")

    def activate(self) -> None:
        """Begin the recording, and subscribe to the rig's topics."""
        text = self.get_value("attachments")
        # One path may have a comma.
        names = [text] if Path(text).is_file() else split_names(text)
        attachments = [read_attached_file(Path(name).expanduser()) for name in names]
        self._forget()
        writer = self._writer = self._open()
        try:
            self._begin(writer, attachments)
        except FileError:
            with contextlib.suppress(FileError):
                self._close(writer, "error")
            raise
        self.get_logger().info(f"recording to {writer.path}")
        self._discover(writer)
        self._publish_state(f"recording since {datetime.now().astimezone():%Y-%m-%d %H:%M:%S}")

    def _begin(self, writer: RecordingWriter, attachments: Iterable[Attachment]) -> None:
        """Subscribe to the rig's topics; write software, computer, notes and files."""
        included = map(self.resolve_topic_name, split_names(self.get_value("include_topics")))
        computed = (self.resolve_topic_name(topic.name) for topic in interfaces.COMPUTED_TOPICS)
        self._left_out = {*computed} - {*included}
        for topic in interfaces.RECORDED_TOPICS:
            if self.resolve_topic_name(topic.name) in self._left_out:
                continue
            # What the estimator alone finds is recorded as it came.
            is_found = topic.owners == interfaces.ESTIMATE.owners
            self._record_own(writer, topic.unread if is_found else topic)
        if self.get_value("record_stream"):
            self._record_own(writer, interfaces.STREAM)
        middleware = rclpy.get_rmw_implementation_identifier()
        provenance = describe_provenance(middleware, self.get_value("notes"))
        writer.add_metadata(PROVENANCE_RECORD, provenance)
        for file in attachments:
            writer.add_attachment(file.name, file.media_type, file.data)

    def deactivate(self) -> None:
        """Finish the recording."""
        writer = self._writer
        if writer is None or writer.closed:
            return
        try:
            self._close(writer, "closed")
        except FileError as error:
            self.report_fault(str(error))
            return
        self.get_logger().info(
            f"{writer.path} is closed: {writer.messages} messages, {writer.size / 1e6:.3g} MB"
        )
        self._publish_state("closed")

    def join(
        self, setup: RigSetup, request: JoinCampaign.Request, response: JoinCampaign.Response
    ) -> None:
        """Record the messages of one campaign, and of no other."""
        if self._writer is not None and not self._writer.closed:
            response.recording = str(self._writer.path)
            newest = self._newest_stored
            if newest is not None and not self.membership.is_foreign(newest):
                self._stored.publish(newest)  # an estimator that missed it waits for it
        else:
            response.message = f"nothing is being recorded: {self._message}"

    def autostart(self) -> None:
        """Start, or publish that nothing is recorded yet."""
        if not self.get_value("autostart"):
            self._publish_state("the recorder is not active")
        super().autostart()

    def report_fault(self, text: str) -> None:
        """Publish an error in the state, too."""
        super().report_fault(text)
        self._publish_state(text)

    def describe_warning(self) -> str | None:
        """Return which points and messages the recording lacks."""
        parts = [
            f"the {name} {count.gaps} gap{'s' * (count.gaps > 1)}, {count.missing_points} points"
            " are missing"
            for name, count in (("blocks have", self._records.total), ("stream has", self._stream))
            if count.gaps
        ]
        parts += [
            f"{lost} message{'s' * (lost > 1)} on {topic} did not get through"
            for topic, lost in self._messages_lost.items()
        ]
        return "; ".join(parts) or None

    def diagnose(self) -> dict[str, Any]:
        """Return the counts of messages that were written, and that were lost."""
        writer = self._writer
        if writer is None:
            return {"recording": False}
        return {
            "recording": not writer.closed,
            "file": writer.path,
            "messages": writer.messages,
            "size": writer.size,
            "topics": len(self._recorded),
            **{name.replace("_", " "): value for name, value in self._describe_health().items()},
        }

    def _describe_health(self) -> dict[str, Any]:
        """Return the counts by their names in the recording and the diagnostics."""
        total, stream = self._records.total, self._stream
        return {
            "blocks": total.blocks,
            "gaps": total.gaps,
            "missing_points": total.missing_points,
            "stream_blocks": stream.blocks,
            "stream_gaps": stream.gaps,
            "stream_missing_points": stream.missing_points,
            "messages_lost": self._messages_lost.total(),
            "topics_not_recorded": ", ".join(self._skipped),
        }

    # The file.

    def _forget(self) -> None:
        """Count from zero, for a new recording."""
        self._records, self._stream = RecordWatch(), BlockCount()
        # Dropped by the middleware, by topic, as far as it numbers them.
        self._messages_lost = Counter[str]()
        self._skipped: dict[str, str] = {}  # topics that are not recorded, and why
        self._left_out = set[str]()  # topics that a replay computes
        self._texts: dict[str, str] = {}  # nodes' parameters in YAML, by full node name
        self._warning: str | None = None
        self._notes = 0  # that were recorded

    def _open(self) -> RecordingWriter:
        output = self.get_value("output")
        path = Path(output or choose_run_folder() / RECORDING_NAME)
        return RecordingWriter(
            # An earlier one is there if the node is activated or started again.
            choose_free(path.expanduser().absolute()),
            compression=self.get_value("compression"),
            library=f"impact_rig {__version__}",
        )

    def _run_guarded(self, work: Callable[[RecordingWriter], None]) -> None:
        """Do some of the work of an open recording; it ends with an error of the file."""
        if self._writer is not None and not self._writer.closed:
            try:
                work(self._writer)
            except FileError as error:
                self._on_failed(error)

    def _check_health(self, writer: RecordingWriter) -> None:
        """Write waiting messages to the disk, and publish new losses."""
        writer.flush()
        warning = self.describe_warning()
        if warning is not None and warning != self._warning:
            self._warning = warning
            self.get_logger().warning(warning)
            self._publish_state(f"warning: {warning}")

    def _on_failed(self, error: FileError) -> None:
        """Close the file after an error, and publish that recording has stopped."""
        # The first error names the cause; the finished chunks are on disk.
        if self._writer is not None and not self._writer.closed:
            with contextlib.suppress(FileError):
                reason = "disk full" if isinstance(error, DiskFullError) else "error"
                self._close(self._writer, reason)
        # What has ended, as where the disk was full, no command starts again.
        self.report_fault(
            f"{error}: end the rig, see to it, and go on by `impact-rig up --resume`"
        )

    def _close(self, writer: RecordingWriter, reason: str) -> None:
        """Write how it ended, finish the recording, and withdraw the subscriptions.

        Those of a process that ends go with it: withdrawing them may wait for the middleware.

        Raises
        ------
        FileError
            If its end could not be written; what was written before stays.
        """
        health = {name: str(value) for name, value in self._describe_health().items()}
        # An error here must not keep the file from being finished.
        with contextlib.suppress(FileError):
            writer.add_metadata(HEALTH_RECORD, {"reason": reason, **health})
        try:
            writer.close()
        finally:
            if not self.stop_requested.done():
                for subscription in self._recorded.values():
                    self.destroy_subscription(subscription)
                self._recorded.clear()

    def _publish_state(self, message: str) -> None:
        self._message = message
        writer, fields = self._writer, dict[str, Any]()
        if writer is not None:
            fields = {"uri": str(writer.path), "messages_lost": self._messages_lost.total()}
        if self.context.ok():
            is_recording = writer is not None and not writer.closed
            self._publish(recording=is_recording, message=message, **fields)

    # The topics.

    def _discover(self, writer: RecordingWriter) -> None:
        """Record further topics below the namespace, and global ones."""
        excluded = self._left_out | {*split_names(self.get_value("exclude_topics"))}
        for topic, types in self.get_topic_names_and_types():
            if topic in (*self._recorded, *self._skipped, *excluded):
                continue
            is_below = topic.startswith(self._prefix) and not topic_or_service_is_hidden(topic)
            is_global = topic in (interfaces.DIAGNOSTICS.name, "/rosout", "/parameter_events")
            is_left_out = STREAM_TYPE in types and not self.get_value("record_stream")
            if (is_below or is_global) and not is_left_out:
                publishers = self.get_publishers_info_by_topic(topic)
                if any(is_global or self._is_ours(item) for item in publishers):
                    self._record_discovered(writer, topic, types, publishers)

    def _is_ours(self, publisher: TopicEndpointInfo) -> bool:
        """Return whether a publisher's node is known, and in no namespace below the rig's own.

        Another rig may be there.
        """
        space = publisher.node_namespace
        is_known = space.startswith("/")
        return is_known and (space == self.get_namespace() or not space.startswith(self._prefix))

    def _record_own(self, writer: RecordingWriter, topic: Topic) -> None:
        # All of several states in quick succession are wanted, not only the last.
        deep = topic.deepen(self.queue_depth)
        self._record(writer, deep, (describe_qos(topic.qos),), is_own=True)

    def _record_discovered(
        self,
        writer: RecordingWriter,
        topic: str,
        types: list[str],
        publishers: list[TopicEndpointInfo],
    ) -> None:
        try:
            if len(types) > 1:
                raise FileError(f"it has several types: {', '.join(types)}")
            offers = tuple(describe_qos(item.qos_profile) for item in publishers)
            qos = adapt_qos(publishers, self.queue_depth)
            self._record(writer, Topic(topic, import_type(types[0]), qos), offers)
        except RigError as error:
            self._skipped[topic] = str(error)
            self.get_logger().warning(f"{topic} is not recorded: {error}")

    def _record(
        self,
        writer: RecordingWriter,
        topic: Topic,
        offers: tuple[OfferedQos, ...],
        *,
        is_own: bool = False,
    ) -> None:
        full_name = self.resolve_topic_name(topic.name)
        on_written = self._on_written.get(full_name)
        definition = find_message_definition(topic.type_name)
        channel = writer.add_channel(full_name, definition, offers)
        previous = 0

        def on_message(data: bytes, info: Mapping[str, Any]) -> None:
            nonlocal previous
            message, number = None, info.get("publication_sequence_number") or 0
            if writer.closed:
                return
            if is_own:
                message = deserialize_message(data, topic.type)
                if self.intake.take(topic, message) is None:
                    # What is left out on purpose is no gap; another publisher has other numbers.
                    previous += number == previous + 1
                    return
                if topic.name == interfaces.NOTE.name and not self._takes_note(message):
                    return
            else:
                self.intake.handled += 1
            received = info["received_timestamp"] or time.time_ns()
            sent = info["source_timestamp"] or received
            if previous and number > previous + 1:
                self._count_lost(full_name, number - previous - 1)
            previous = number
            try:
                writer.add_message(channel, data, received, sent)
                if on_written is not None:
                    on_written(writer, message or deserialize_message(data, topic.type))
            except FileError as error:
                self._on_failed(error)

        self._recorded[full_name] = self.create_subscription(
            topic.type,
            topic.name,
            accept_message_info(on_message),
            topic.qos,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            raw=True,
        )

    def _takes_note(self, note: String) -> bool:
        """Whether a note, of whomever, is one of those that a reader of the recording shows."""
        if self._notes < MOST_NOTES and len(note.data) <= LONGEST_NOTE:
            self._notes += 1
            return True
        senders = self.get_publishers_info_by_topic(interfaces.NOTE.name)
        names = {f"{item.node_namespace.rstrip('/')}/{item.node_name}" for item in senders}
        self.get_logger().warning(
            f"a note of {' or '.join(sorted(names))} is left out: {MOST_NOTES} are recorded, of"
            f" {LONGEST_NOTE} letters at most",
            once=True,
        )
        return False

    def _count_lost(self, topic: str, count: int) -> None:
        # The middleware reports no loss where a queue overflows, but it numbers the messages of
        # each publisher.
        if self._recorded[topic].get_publisher_count() == 1:
            self._messages_lost[topic] += count

    def _on_block(self, writer: RecordingWriter, message: AccelerationBlock) -> None:
        """Count a block that was written; the end of its record puts that on the disk."""
        if ended := self._records.add(message):
            writer.sync()
            for count in ended:
                self._publish_stored(count)

    def _on_stream_block(self, _: RecordingWriter, message: StreamBlock) -> None:
        self._stream.add(message.first_sample, count_points(message))

    def _publish_stored(self, count: RecordCount) -> None:
        message = RecordStored(
            **asdict(count.label),
            blocks=count.blocks,
            gaps=count.gaps,
            missing_points=count.missing_points,
        )
        identity = Identity(self.membership.identity.campaign_id, count.stream_id)
        self._newest_stored = identity.fill(message, stamp_to_msg(count.stamp))
        self._stored.publish(self._newest_stored)

    def _on_overrule(self, writer: RecordingWriter, message: Overrule) -> None:
        """Put a person's verdict on the disk before it is answered."""
        writer.sync()
        self._stored_overrule.publish(message.header)

    def _on_diagnostics(self, writer: RecordingWriter, message: DiagnosticArray) -> None:
        """Write the parameters of a node of the rig that have not been written yet."""
        membership = self.membership
        for status in message.status:
            node, _, what = status.name.rpartition("/")
            campaign = membership.identity.campaign_id.hex()
            is_foreign = membership.is_joined and status.message != campaign
            is_ours = node.startswith(self._prefix) and "/" not in node[len(self._prefix) :]
            if what != PARAMETERS or is_foreign or not is_ours:
                continue
            text = "".join(f"{item.key}: {item.value}\n" for item in status.values)
            if self._texts.get(node) != text:
                self._texts[node] = text
                writer.add_metadata(PARAMETERS_RECORD, self._texts)
