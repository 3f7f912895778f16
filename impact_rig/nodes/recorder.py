"""The recorder: writes every topic of the rig to MCAP, as received."""

import contextlib
import time
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from impact_rig_msgs.msg import RecorderState
from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.topic_or_service_is_hidden import topic_or_service_is_hidden

from impact_rig import __version__
from impact_rig.configuration.processes import RECORDING_NAME, make_run_folder_name
from impact_rig.core.errors import FileError, ParameterError, RigError
from impact_rig.nodes import interfaces
from impact_rig.nodes.process import run_node
from impact_rig.nodes.rig_node import RigNode, split_names
from impact_rig.nodes.topics import adapt_qos, describe_qos, import_type, name_type
from impact_rig.recording.mcap_writer import COMPRESSIONS, DEFAULT_CHUNK_SIZE, McapWriter
from impact_rig.recording.message_definitions import find_message_definition
from impact_rig.recording.qos_profiles import OfferedQos

DISCOVERY_PERIOD = 0.2
"""How often further topics are looked for [s], our choice: the ROS graph sends no event here."""
DISCOVERED_DEPTH = 200
"""Queue of topics that are not the rig's own [messages], our choice: as deep as the blocks'."""
CONNECTION_PERIOD = 0.05
"""How often it is looked whether the required topics are connected [s], our choice."""
GLOBAL_TOPICS = ("/diagnostics", "/rosout")
"""Topics outside the rig's namespace that tell of its health."""
FAREWELL_TIMEOUT = 0.2
"""How long the last state may take to reach its subscribers [s], our choice."""


class RecorderNode(RigNode):
    """Records while it is active: one activation, one file."""

    def __init__(self, **options: Any) -> None:
        super().__init__("recorder", **options)
        self.declare(
            "output", "",
            f"path of the new .mcap file; empty: runs/<time>/{RECORDING_NAME} under the working"
            " directory",
        )  # fmt: skip
        self.declare("compression", "zstd", f"of chunks: {', '.join(COMPRESSIONS)}")
        self.declare(
            "chunk_size", DEFAULT_CHUNK_SIZE, "size at which a chunk is finished [byte]",
            low=1000, high=2**28,
        )  # fmt: skip
        self.declare(
            "flush_period", 1.0,
            "how long a message may wait to be written to disk [s]; 0: until its chunk is full",
            low=0.0, high=3600.0,
        )  # fmt: skip
        self.declare(
            "required_topics", "acceleration, release, impact",
            "topics, by commas, that must be connected before the recorder calls itself"
            " recording, and a release is possible",
        )  # fmt: skip
        self._is_connected = False
        self._state_publisher = self.advertise(interfaces.RECORDER_STATE)
        self._writer: McapWriter | None = None
        self._inputs: dict[str, Any] = {}
        self._skipped: dict[str, str] = {}
        self._watches: list[Any] = []

    def configure(self) -> None:
        """Check the parameters before anything is opened."""
        compression = self.get_value("compression")
        if compression not in COMPRESSIONS:
            raise ParameterError(
                f"compression is {compression!r}: it must be one of {', '.join(COMPRESSIONS)}"
            )
        output = self.get_value("output")
        if output and not output.endswith(".mcap"):
            raise ParameterError(f"output is {output!r}: it must be the path of an .mcap file")

    def activate(self) -> None:
        """Open the file, subscribe to the rig's topics and look for others from now on."""
        writer = self._writer = self._open()
        try:
            for topic in interfaces.RECORDED_TOPICS:
                self._record(writer, topic.name, topic.type, topic.qos, (describe_qos(topic.qos),))
        except FileError:
            self._stop(writer)
            writer.path.unlink(missing_ok=True)
            raise
        self._discover(writer)
        self._watches.append(self.create_timer(DISCOVERY_PERIOD, lambda: self._discover(writer)))
        if period := self.get_value("flush_period"):
            self._watches.append(self.create_timer(period, lambda: self._flush(writer)))
        self.get_logger().info(f"recording to {writer.path}")
        self._is_connected = False
        self._watches.append(self.create_timer(CONNECTION_PERIOD, self._look_for_publishers))
        self._look_for_publishers()
        if not self._is_connected:
            self._publish_state(f"waiting for topics: {', '.join(self._find_missing_topics())}")

    def deactivate(self) -> None:
        """Write what is still in the queues, finish the file and say so."""
        writer = self._writer
        if writer is None or writer.closed:
            return
        for subscription in tuple(self._inputs.values()):
            self._empty_queue(writer, subscription)
        try:
            self._stop(writer)
        except FileError as error:
            self.report_fault(str(error))
            return
        self.get_logger().info(
            f"{writer.path} is closed: {writer.messages} messages, {writer.size / 1e6:.3g} MB"
        )
        self._publish_state("closed")

    def report_fault(self, text: str) -> None:
        """Tell everybody who relies on the recorder, beside the log and the diagnostics."""
        super().report_fault(text)
        self._publish_state(text)

    def diagnose(self) -> dict[str, Any]:
        """Return what was written so far."""
        writer = self._writer
        return {
            "recording": self._is_recording and self._is_connected,
            "waiting for": ", ".join(self._find_missing_topics()),
            "file": writer.path if writer else "",
            "messages": writer.messages if writer else 0,
            "size": writer.size if writer else 0,
            "topics": len(self._inputs),
            "topics not recorded": ", ".join(self._skipped),
        }

    def count_messages(self, topic: str) -> int:
        """Return how many messages of a topic, by its full name, are in the file."""
        return self._writer.count_messages(topic) if self._writer else 0

    @property
    def _is_recording(self) -> bool:
        return self._writer is not None and not self._writer.closed

    def _find_missing_topics(self) -> list[str]:
        """Return the required topics that nobody publishes to this node yet."""
        if not self._is_recording:
            return []
        inputs = {
            name: self._inputs.get(self.resolve_topic_name(name))
            for name in split_names(self.get_value("required_topics"))
        }
        return [
            name for name, item in inputs.items() if not item or not item.get_publisher_count()
        ]

    def _look_for_publishers(self) -> None:
        """Say that everything is being recorded, once it is; a lost publisher is no loss here."""
        if self._is_connected or self._find_missing_topics():
            return
        self._is_connected = True
        self._publish_state(f"recording since {datetime.now().astimezone():%Y-%m-%d %H:%M:%S}")

    def _open(self) -> McapWriter:
        output = self.get_value("output")
        folder = make_run_folder_name(datetime.now().astimezone())
        path = Path(output or Path(folder, RECORDING_NAME)).expanduser().absolute()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(f"folder {path.parent} cannot be made: {error.strerror}") from None
        return McapWriter(
            path,
            compression=self.get_value("compression"),
            chunk_size=self.get_value("chunk_size"),
            library=f"impact_rig {__version__}",
        )

    def _record(
        self,
        writer: McapWriter,
        name: str,
        kind: Any,
        qos: QoSProfile,
        offers: tuple[OfferedQos, ...],
    ) -> None:
        topic = self.resolve_topic_name(name)
        channel = writer.add_channel(topic, find_message_definition(name_type(kind)), offers)

        def write(data: bytes, info: Mapping[str, Any]) -> None:
            self.messages_handled += 1
            if writer.closed:
                return
            received = info["received_timestamp"] or time.time_ns()
            try:
                writer.add_message(channel, data, received, info["source_timestamp"] or received)
            except FileError as error:
                self._fail(writer, error)

        self._inputs[topic] = self.create_subscription(kind, name, write, qos, raw=True)

    def _discover(self, writer: McapWriter) -> None:
        """Subscribe to what else is published below the namespace, and to the global topics."""
        prefix = self.get_namespace().rstrip("/") + "/"
        for topic, types in self.get_topic_names_and_types():
            if topic in self._inputs or topic in self._skipped:
                continue
            if topic_or_service_is_hidden(topic):
                continue
            if topic.startswith(prefix) or topic in GLOBAL_TOPICS:
                publishers = self.get_publishers_info_by_topic(topic)
                if publishers:
                    self._record_discovered(writer, topic, types, publishers)

    def _record_discovered(
        self,
        writer: McapWriter,
        topic: str,
        types: list[str],
        publishers: list[TopicEndpointInfo],
    ) -> None:
        try:
            if len(types) > 1:
                raise FileError(f"it has several types: {', '.join(types)}")
            kind = import_type(types[0])
            offers = tuple(describe_qos(item.qos_profile) for item in publishers)
            self._record(writer, topic, kind, adapt_qos(publishers, DISCOVERED_DEPTH), offers)
        except RigError as error:
            self._skipped[topic] = str(error)
            self.get_logger().warning(f"{topic} is not recorded: {error}")

    def _flush(self, writer: McapWriter) -> None:
        try:
            writer.flush()
        except FileError as error:
            self._fail(writer, error)

    def _fail(self, writer: McapWriter, error: FileError) -> None:
        """Keep what was written, and tell everybody that nothing is recorded any more."""
        # The first error names the cause; the finished chunks are on disk.
        with contextlib.suppress(FileError):
            self._stop(writer)
        self.report_fault(str(error))

    def _stop(self, writer: McapWriter) -> None:
        for timer in self._watches:
            self.destroy_timer(timer)
        self._watches.clear()
        for subscription in self._inputs.values():
            self.destroy_subscription(subscription)
        self._inputs.clear()
        self._skipped.clear()
        writer.close()

    def _empty_queue(self, writer: McapWriter, subscription: Any) -> None:
        for _ in range(DISCOVERED_DEPTH):
            if writer.closed:
                return
            with subscription.handle:
                taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is None:
                return
            subscription.callback(*taken)

    def _publish_state(self, message: str) -> None:
        if not self.context.ok():
            return
        writer = self._writer
        state = RecorderState(
            recording=self._is_recording and self._is_connected,
            waiting=self._is_recording and not self._is_connected,
            uri=str(writer.path) if writer else "",
            messages=writer.messages if writer else 0,
            size=writer.size if writer else 0,
            message=message,
        )
        state.header.stamp = self.get_clock().now().to_msg()
        self._state_publisher.publish(state)
        if not self._is_recording:
            self._state_publisher.wait_for_all_acked(Duration(seconds=FAREWELL_TIMEOUT))


def main() -> int:
    """Run the node."""
    return run_node(RecorderNode)


if __name__ == "__main__":
    raise SystemExit(main())
