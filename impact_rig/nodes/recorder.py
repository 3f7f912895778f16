"""The recorder: writes every topic of the rig to MCAP, as received."""

import time
from collections.abc import Callable, Mapping
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
from impact_rig.nodes.rig_node import RigNode
from impact_rig.nodes.topics import adapt_qos, describe_qos, import_type, name_type
from impact_rig.recording.mcap_writer import COMPRESSIONS, DEFAULT_CHUNK_SIZE, McapWriter
from impact_rig.recording.message_definitions import find_message_definition
from impact_rig.recording.qos_profiles import OfferedQos

DISCOVERY_PERIOD = 0.2
"""How often further topics are looked for [s], our choice: the ROS graph sends no event here."""
DISCOVERED_DEPTH = 200
"""Queue of topics that are not the rig's own [messages], our choice: as deep as the blocks'."""
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
        self._writer = self._open()
        try:
            for topic in interfaces.RECORDED_TOPICS:
                self._record(topic.name, topic.type, topic.qos, (describe_qos(topic.qos),))
        except FileError:
            self._stop()
            self._writer.path.unlink(missing_ok=True)
            raise
        self._discover()
        self._watches.append(self.create_timer(DISCOVERY_PERIOD, self._discover))
        if period := self.get_value("flush_period"):
            self._watches.append(self.create_timer(period, self._flush))
        self._publish_state(f"recording since {datetime.now():%Y-%m-%d %H:%M:%S}")
        self.get_logger().info(f"recording to {self._writer.path}")

    def deactivate(self) -> None:
        """Write what is still in the queues, finish the file and say so."""
        for subscription in self._inputs.values():
            self._empty_queue(subscription)
        was_recording = self._is_recording
        try:
            self._stop()
        except FileError as error:
            self.report_fault(str(error))
            self._publish_state(str(error))
            return
        if self._writer is not None and was_recording:
            self.get_logger().info(
                f"{self._writer.path} is closed: {self._writer.messages} messages,"
                f" {self._writer.size / 1e6:.3g} MB"
            )
            self._publish_state("closed")

    def diagnose(self) -> dict[str, Any]:
        """Return what was written so far."""
        writer = self._writer
        return {
            "recording": self._is_recording,
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

    def _open(self) -> McapWriter:
        output = self.get_value("output")
        name = output or str(Path(make_run_folder_name(datetime.now()), RECORDING_NAME))
        path = Path(name).expanduser().absolute()
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
        self, name: str, kind: Any, qos: QoSProfile, offers: tuple[OfferedQos, ...]
    ) -> None:
        definition = find_message_definition(name_type(kind))
        topic = self.resolve_topic_name(name)
        channel = self._writer.add_channel(topic, definition, offers)
        self._inputs[topic] = self.create_subscription(
            kind, name, self._make_callback(channel), qos, raw=True
        )

    def _make_callback(self, channel: int) -> Callable[[bytes, Mapping[str, Any]], None]:
        writer = self._writer

        def write(data: bytes, info: Mapping[str, Any]) -> None:
            self.messages_handled += 1
            received = info["received_timestamp"] or time.time_ns()
            try:
                writer.add_message(channel, data, received, info["source_timestamp"] or received)
            except FileError as error:
                self._fail(error)

        return write

    def _discover(self) -> None:
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
                    self._record_discovered(topic, types, publishers)

    def _record_discovered(
        self, topic: str, types: list[str], publishers: list[TopicEndpointInfo]
    ) -> None:
        try:
            if len(types) > 1:
                raise FileError(f"it has several types: {', '.join(types)}")
            kind = import_type(types[0])
            offers = tuple(describe_qos(item.qos_profile) for item in publishers)
            self._record(topic, kind, adapt_qos(publishers, DISCOVERED_DEPTH), offers)
        except RigError as error:
            self._skipped[topic] = str(error)
            self.get_logger().warning(f"{topic} is not recorded: {error}")

    def _flush(self) -> None:
        try:
            self._writer.flush()
        except FileError as error:
            self._fail(error)

    def _fail(self, error: FileError) -> None:
        """Keep what was written, and tell everybody that nothing is recorded any more."""
        try:
            self._stop()
        except FileError:
            pass  # The first error names the cause; the finished chunks are on disk.
        self.report_fault(str(error))
        self._publish_state(str(error))

    def _stop(self) -> None:
        for timer in self._watches:
            self.destroy_timer(timer)
        self._watches.clear()
        for subscription in self._inputs.values():
            self.destroy_subscription(subscription)
        self._inputs.clear()
        self._skipped.clear()
        if self._writer is not None:
            self._writer.close()

    def _empty_queue(self, subscription: Any) -> None:
        for _ in range(DISCOVERED_DEPTH):
            with subscription.handle:
                taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is None or not self._is_recording:
                return
            subscription.callback(*taken)

    def _publish_state(self, message: str) -> None:
        if not self.context.ok():
            return
        writer = self._writer
        state = RecorderState(
            recording=self._is_recording,
            uri=str(writer.path),
            messages=writer.messages,
            size=writer.size,
            message=message,
        )
        state.header.stamp = self.get_clock().now().to_msg()
        self._state_publisher.publish(state)
        if not state.recording:
            self._state_publisher.wait_for_all_acked(Duration(seconds=FAREWELL_TIMEOUT))


def main() -> int:
    """Run the node."""
    return run_node(RecorderNode)


if __name__ == "__main__":
    raise SystemExit(main())
