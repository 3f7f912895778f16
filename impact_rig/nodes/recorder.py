"""The recorder: writes every topic of the rig to MCAP, as received."""

import contextlib
from datetime import datetime
from pathlib import Path
from typing import Any

from impact_rig_msgs.msg import RecorderState
from impact_rig_msgs.srv import JoinCampaign
from rclpy.duration import Duration
from rclpy.parameter import Parameter

from impact_rig import __version__
from impact_rig.configuration.processes import RECORDING_NAME, make_run_folder_name
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.nodes import interfaces
from impact_rig.nodes.process import run_node
from impact_rig.nodes.recorder_run import RecordingRun
from impact_rig.nodes.rig_node import RigNode, split_names
from impact_rig.nodes.topics import name_type
from impact_rig.recordings.new_file import DiskFullError, choose_free
from impact_rig.recordings.provenance import read_attached_file
from impact_rig.recordings.schemas import find_message_definition
from impact_rig.recordings.source import SUFFIX
from impact_rig.recordings.writer import (
    COMPRESSIONS,
    DEFAULT_CHUNK_SIZE,
    RecordingWriter,
)


def declare_parameters(node: RigNode) -> None:
    """Declare them all."""
    _declare_file(node)
    _declare_content(node)


def _declare_file(node: RigNode) -> None:
    node.declare(
        "output", "",
        f"the new recording, an {SUFFIX} file; empty: runs/<time>/{RECORDING_NAME} under the"
        " working directory",
    )  # fmt: skip
    node.declare("compression", "zstd", "of chunks", choices=COMPRESSIONS)
    node.declare(
        "chunk_size", DEFAULT_CHUNK_SIZE, "size at which a chunk is finished [byte]",
        low=1000, high=2**28,
    )  # fmt: skip
    node.declare(
        "flush_period", 1.0,
        "how long a message may wait to be written to disk [s]; 0: until its chunk is full",
        low=0.0, high=3600.0,
    )  # fmt: skip


def _declare_content(node: RigNode) -> None:
    node.declare(
        "required_topics", "acceleration, release, impact",
        "topics, by commas, that must be connected before the recorder calls itself"
        " recording, and a release is possible", live=True,
    )  # fmt: skip
    node.declare(
        "record_stream", False,
        "in continuous mode, whether the running stream of the accelerometers is recorded as a"
        " whole, beside the hits that are found in it; 72 GB an hour at 2.5 MS/s, uncompressed",
    )  # fmt: skip
    node.declare(
        "stream_depth", 10 * interfaces.STREAM_DEPTH,
        "how many blocks of the running stream may wait to be written; more are lost",
        low=interfaces.STREAM_DEPTH, high=100_000,
    )  # fmt: skip
    node.declare("notes", "", "in the operator's words; they go into the recording", live=True)
    node.declare("attachments", "", "files, by commas, that go into the recording")


CONNECTION_PERIOD = 0.05
"""How often it is looked whether the required topics are connected [s], our choice."""
HEALTH_PERIOD = 1.0
"""How often the counts of what is missing are looked at [s]."""
ACKNOWLEDGEMENT_TIMEOUT = 0.2
"""How long what is said last may take to reach its subscribers [s], our choice."""


class RecorderNode(RigNode):
    """Records while it is active: one activation, one recording."""

    def __init__(self, **options: Any) -> None:
        super().__init__("recorder", **options)
        declare_parameters(self)
        self._run: RecordingRun | None = None
        self._is_connected = False
        self._begun = ""
        self._warning = ""
        self._state_publisher = self.advertise(interfaces.RECORDER_STATE)
        self._stored_publisher = self.advertise(interfaces.RECORD_STORED)
        self.add_post_set_parameters_callback(self._take_parameters)
        self._states.append(lambda: self._publish_state(self._message))
        self._message = ""
        self.offer_to_join()

    def configure(self) -> None:
        """Check before anything is opened."""
        output = self.get_value("output")
        if output and Path(output).suffix != SUFFIX:
            raise ParameterError(f"output is {output!r}: the name must end in {SUFFIX}")
        for topic in interfaces.RECORDED_TOPICS:
            find_message_definition(name_type(topic.type))

    def activate(self) -> None:
        """Begin the recording, subscribe to the rig's topics and look for others from now on."""
        attachments = [
            read_attached_file(Path(name).expanduser())
            for name in _split_paths(self.get_value("attachments"))
        ]
        run = self._run = RecordingRun(
            self,
            self._open(),
            self._stored_publisher,
            self._fail,
            stream_depth=self.get_value("stream_depth") * self.get_value("record_stream"),
        )
        self._is_connected, self._begun, self._warning = False, "", ""
        run.write_provenance(self.get_value("notes"))
        run.attach(attachments)
        run.start(self.get_value("flush_period"))
        self.get_logger().info(f"recording to {run.writer.path}")
        run.call_every(HEALTH_PERIOD, self._check_health)
        run.call_every(CONNECTION_PERIOD, self._look_for_peers, until=lambda: self._is_connected)
        self._look_for_peers()
        if not self._is_connected:
            self._publish_state(f"waiting: {self._describe_missing_peers()}")

    def deactivate(self) -> None:
        """Finish the recording and say so; what came before has been written by now."""
        run = self._run
        if run is None or not run.is_open:
            return
        try:
            run.close("closed")
        except FileError as error:
            self.report_fault(str(error))
            return
        # By another topic: a record that is said to be stored after "closed" gets no verdict.
        self._stored_publisher.wait_for_all_acked(Duration(seconds=ACKNOWLEDGEMENT_TIMEOUT))
        writer = run.writer
        self.get_logger().info(
            f"{writer.path} is closed: {writer.messages} messages, {writer.size / 1e6:.3g} MB"
        )
        self._publish_state("closed")

    def join(self, request: JoinCampaign.Request, response: JoinCampaign.Response) -> str:
        """Record what belongs to a campaign, and nothing of any other."""
        if not self._is_recording or not self._is_connected:
            return f"nothing is being recorded ({self._message}): start the recorder"
        response.recording = str(self._run.writer.path) if self._run else ""
        return ""

    def autostart(self) -> None:
        """Start, or say that nothing is recorded yet to those who would wait for it."""
        if not self.get_value("autostart"):
            self._publish_state("the recorder is not active")
        super().autostart()

    def report_fault(self, text: str) -> None:
        """Tell everybody who relies on the recorder, beside the log and the diagnostics."""
        super().report_fault(text)
        self._publish_state(text)

    def describe_warning(self) -> str:
        """Return what the recording lacks."""
        return self._run.describe_losses() if self._run else ""

    def diagnose(self) -> dict[str, Any]:
        """Return what was written so far, and what was not."""
        run = self._run
        if run is None:
            return {"recording": False}
        writer, watch = run.writer, run.storage.watch
        return {
            "recording": self._is_recording and self._is_connected,
            "waiting for": self._describe_missing_peers(),
            "file": writer.path,
            "messages": writer.messages,
            "size": writer.size,
            "topics": len(run.topics),
            "topics not recorded": ", ".join(run.topics.skipped),
            "blocks": watch.blocks,
            "gaps": watch.gaps,
            "missing points": watch.missing_points,
            **run.diagnose_stream(),
            "messages lost": run.topics.messages_lost,
            "longest lag [s]": f"{run.storage.longest_lag:.3g}",
        }

    def count_messages(self, topic: str) -> int:
        """Return how many messages of a topic, by its full name, are in the recording."""
        return self._run.writer.count_messages(topic) if self._run else 0

    @property
    def _is_recording(self) -> bool:
        return self._run is not None and self._run.is_open

    def _open(self) -> RecordingWriter:
        output = self.get_value("output")
        folder = make_run_folder_name(datetime.now().astimezone())
        return RecordingWriter(
            # Its own of before, if it is activated or started again.
            choose_free(Path(output or Path(folder, RECORDING_NAME)).expanduser().absolute()),
            compression=self.get_value("compression"),
            chunk_size=self.get_value("chunk_size"),
            library=f"impact_rig {__version__}",
        )

    def _describe_missing_peers(self) -> str:
        """Return who is not connected yet that must be; empty: nobody."""
        if self._run is None or not self._run.is_open:
            return ""
        required = split_names(self.get_value("required_topics"))
        if missing := self._run.topics.list_unconnected(required):
            return f"nobody publishes {', '.join(missing)} yet"
        return ""

    def _look_for_peers(self) -> None:
        """Say that everything is being recorded, once it is; a lost peer is no loss here."""
        if self._describe_missing_peers():
            return
        self._is_connected = True
        self._begun = f"recording since {datetime.now().astimezone():%Y-%m-%d %H:%M:%S}"
        self._publish_state(self._begun)

    def _check_health(self) -> None:
        """Tell everybody when what needs attention has changed."""
        warning = self.describe_warning()
        if warning == self._warning or not self._is_connected:
            return
        self._warning = warning
        if warning:
            self.get_logger().warning(warning)
        self._publish_state(f"warning: {warning}" if warning else self._begun)

    def _take_parameters(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == "notes" and self._run is not None and self._run.is_open:
                try:
                    self._run.write_provenance(parameter.value)
                except FileError as error:
                    self._fail(error)

    def _fail(self, error: FileError) -> None:
        """Keep what was written, and tell everybody that nothing is recorded any more."""
        # The first error names the cause; the finished chunks are on disk.
        if self._run is not None and self._run.is_open:
            with contextlib.suppress(FileError):
                self._run.close("disk full" if isinstance(error, DiskFullError) else "error")
        self.report_fault(str(error))

    def _publish_state(self, message: str) -> None:
        self._message = message
        if not self.context.ok():
            return
        state = RecorderState(
            recording=self._is_recording and self._is_connected,
            waiting=self._is_recording and not self._is_connected,
            message=message,
        )
        if self._run is not None:
            writer, storage = self._run.writer, self._run.storage
            watch, stream = storage.watch, storage.stream
            state.uri = str(writer.path)
            state.messages, state.size = writer.messages, writer.size
            state.gaps = watch.gaps + stream.gaps
            state.missing_points = watch.missing_points + stream.missing_points
            state.messages_lost = self._run.topics.messages_lost
        self.membership.identity.fill(state)
        state.header.stamp = self.get_clock().now().to_msg()
        self._state_publisher.publish(state)
        if not self._is_recording:
            self._state_publisher.wait_for_all_acked(Duration(seconds=ACKNOWLEDGEMENT_TIMEOUT))


def _split_paths(text: str) -> list[str]:
    """Return the paths in a text that lists them by commas, unless it is one that has a comma."""
    return [text] if Path(text).is_file() else split_names(text)


def main() -> int:
    """Run the node."""
    return run_node(RecorderNode)
