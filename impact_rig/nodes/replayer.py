"""The replayer: publishes a recording again, byte by byte, in its own namespace."""

from pathlib import Path
from typing import Any

from impact_rig_msgs.msg import Impact
from rclpy.qos import QoSProfile, ReliabilityPolicy

from impact_rig.core.errors import FileError, ParameterError
from impact_rig.nodes import interfaces
from impact_rig.nodes.playback import Playback, Window
from impact_rig.nodes.process import run_node
from impact_rig.nodes.rig_node import RigNode
from impact_rig.nodes.topics import import_type, make_qos, name_type
from impact_rig.recording.mcap_file import Channel, McapFile, RawMessage
from impact_rig.recording.mcap_reader import BLOCK_TYPE, find_namespaces, make_relative
from impact_rig.recording.message_definitions import find_message_definition, is_same_definition
from impact_rig.recording.qos_profiles import DEFAULT_DEPTH, choose_qos, parse_offered_qos
from impact_rig.recording.schema_decoder import SchemaDecoder

INPUTS = {
    name_type(topic.type): topic
    for topic in (
        interfaces.SETUP,
        interfaces.ACCELERATION,
        interfaces.RELEASE,
        interfaces.VIRTUAL_IMPACT,
    )
}
"""What an estimator works from, by type: all else in a recording are results and states."""
CONNECTION_PERIOD = 0.05
"""How often it is looked whether the subscribers are connected [s], our choice."""
SELECTIONS = ("inputs", "all")
"""Which topics may be asked for."""


class ReplayerNode(RigNode):
    """Replays while it is active; becomes inactive, or ends its process, when it is done."""

    def __init__(self, **options: Any) -> None:
        super().__init__("replayer", **options)
        self.declare("file", "", "path of the recording (.mcap)")
        self.declare(
            "rate", 1.0,
            "speed, part of the original's [-]; 0: as fast as the subscribers take it",
            low=0.0, high=1000.0,
        )  # fmt: skip
        self.declare(
            "topics", "inputs",
            "inputs: set-up, blocks, releases and virtual impacts, for a fresh estimator; all:"
            " everything that was recorded",
        )  # fmt: skip
        self.declare(
            "required_subscribers", "estimator",
            "nodes of this namespace, by commas, that must be connected before the start",
        )  # fmt: skip
        self.declare("recorded_namespace", "", "of the rig in the recording; empty: found there")
        self.declare("exit_when_done", False, "end the process at the end of the recording")
        self._file: McapFile | None = None
        self._outputs: dict[int, Any] = {}
        self._gates: list[Any] = []
        self._playback: Playback | None = None
        self._watch: Any = None
        self._end = self.create_guard_condition(self._finish)
        self._decoder = SchemaDecoder()
        self._verdicts: Any = None
        self._progress = "no recording"

    def configure(self) -> None:
        """Open the recording and announce its topics."""
        if not self.get_value("file"):
            raise ParameterError("file is empty: it must be the path of a recording (.mcap)")
        selection = self.get_value("topics")
        if selection not in SELECTIONS:
            raise ParameterError(f"topics is {selection!r}: it must be {' or '.join(SELECTIONS)}")
        file = McapFile(Path(self.get_value("file")).expanduser())
        if not file.is_complete:
            self.get_logger().warning(f"{file.path} was never closed: its end is missing")
        namespace = self._choose_namespace(file)
        try:
            for channel in file.read_channels():
                self._announce(file, channel, namespace, is_everything=selection == "all")
        except FileError:
            self.cleanup()
            raise
        if not self._outputs:
            names = ", ".join(topic.name for topic in INPUTS.values())
            raise FileError(f"{file.path} holds nothing to replay: no topic of {names}")
        self._file = file
        self._progress = "ready"

    def activate(self) -> None:
        """Start as soon as the subscribers are there."""
        file = self._file
        if file is None:
            raise FileError("no recording is open: configure the node first")
        verdicts = self.resolve_topic_name(interfaces.IMPACT.name)
        is_judged = self.get_value("topics") == "inputs"
        window = Window(lambda: is_judged and self.count_publishers(verdicts) > 0)
        self._playback = Playback(
            file.read_messages(lambda channel: channel.id in self._outputs),
            self._outputs,
            float(self.get_value("rate")),
            window,
            self._find_record,
            self._end.trigger,
        )
        # Volatile: what was judged before this replay does not count.
        self._verdicts = self.create_subscription(
            Impact,
            interfaces.IMPACT.name,
            lambda message: window.note_verdict(message.record),
            QoSProfile(depth=200, reliability=ReliabilityPolicy.RELIABLE),
        )
        self._progress = "waiting for subscribers"
        self._watch = self.create_timer(CONNECTION_PERIOD, self._start_if_ready)

    def deactivate(self) -> None:
        """Stop publishing."""
        self._stop_watching()
        if self._playback is not None:
            self._playback.stop()
            self._playback = None
        if self._verdicts is not None:
            self.destroy_subscription(self._verdicts)
            self._verdicts = None

    def cleanup(self) -> None:
        """Withdraw the topics."""
        for publisher in set(self._outputs.values()):
            self.destroy_publisher(publisher)
        self._outputs.clear()
        self._gates.clear()
        self._progress = "no recording"

    def autostart(self) -> None:
        """Start; a process that is to end with its recording ends at once if there is none."""
        super().autostart()
        if self.get_value("exit_when_done") and self.fault:
            raise FileError(self.fault)

    def diagnose(self) -> dict[str, Any]:
        """Return how far the replay has come."""
        playback = self._playback
        return {
            "file": self._file.path if self._file else "",
            "progress": self._progress,
            "messages": playback.published if playback else 0,
            "recorded time [s]": f"{playback.recorded_time:.3f}" if playback else "",
        }

    def _choose_namespace(self, file: McapFile) -> str:
        chosen = self.get_value("recorded_namespace")
        found = (chosen,) if chosen else find_namespaces(file)
        if len(found) > 1:
            raise FileError(
                f"{file.path} holds several rigs, in the namespaces {', '.join(found)}: choose one"
                " by the parameter recorded_namespace"
            )
        return "/" + (found[0] if found else "").strip("/")

    def _announce(
        self, file: McapFile, channel: Channel, namespace: str, *, is_everything: bool
    ) -> None:
        """Create the publisher of a recorded topic, if it is to be replayed."""
        name = make_relative(channel.topic, namespace)
        known = INPUTS.get(channel.type_name) if not name.startswith("/") else None
        if known is None and not is_everything:
            return
        try:
            kind = import_type(channel.type_name)
            installed = find_message_definition(channel.type_name)
            if not is_same_definition(installed.text, channel.schema):
                raise FileError(
                    f"{channel.topic} was recorded with another version of {channel.type_name}"
                    " than is installed"
                )
        except FileError as error:
            if known is not None:
                raise FileError(f"{file.path}: {error}") from None
            self.get_logger().warning(f"{channel.topic} is not replayed: {error}")
            return
        offer = choose_qos(parse_offered_qos(channel.metadata.get("offered_qos_profiles", "")))
        qos = make_qos(offer, known.qos.depth if known else DEFAULT_DEPTH)
        publisher = self.create_publisher(
            kind,
            known.name if known else name,
            qos,
        )
        self._outputs[channel.id] = publisher
        if channel.type_name == BLOCK_TYPE:
            self._gates.append(publisher)

    def _start_if_ready(self) -> None:
        """Begin once the blocks have their subscribers."""
        if self._playback is None or self._progress != "waiting for subscribers":
            return
        required = self.get_value("required_subscribers")
        gates = self._gates or list(self._outputs.values())
        if any(self.find_missing_subscribers(gate, required) for gate in gates):
            return
        self._stop_watching()
        self._progress = "replaying"
        self.get_logger().info("replaying")
        self._playback.start()

    def _stop_watching(self) -> None:
        if self._watch is not None:
            self.destroy_timer(self._watch)
            self._watch = None

    def _find_record(self, message: RawMessage) -> int | None:
        if message.channel.type_name != BLOCK_TYPE:
            return None
        return int(self._decoder.decode(message.channel, message.data).record)

    def _finish(self) -> None:
        """End what the playback's thread has finished, in the executor's thread."""
        playback = self._playback
        if playback is None:
            return
        self.get_logger().info(f"{playback.published} messages replayed")
        self._progress = f"done: {playback.published} messages"
        if self.get_value("exit_when_done"):
            if playback.problem:
                raise FileError(playback.problem)
            self.stop_requested.set()
            return
        self.trigger_deactivate()
        if playback.problem:
            self.report_fault(playback.problem)


def main() -> int:
    """Run the node."""
    return run_node(ReplayerNode)


if __name__ == "__main__":
    raise SystemExit(main())
