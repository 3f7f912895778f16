"""The recorder: writes every topic of the rig to MCAP, as received."""

import contextlib
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

from impact_rig_msgs.srv import JoinCampaign

from impact_rig import __version__
from impact_rig.configuration.processes import (
    RECORDING_NAME,
    choose_run_folder,
    split_names,
)
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.nodes import interfaces
from impact_rig.nodes.process import run_node
from impact_rig.nodes.recorder_run import RecordingRun
from impact_rig.nodes.rig_node import RigNode
from impact_rig.recordings.new_file import DiskFullError, choose_free
from impact_rig.recordings.provenance import read_attached_file
from impact_rig.recordings.source import SUFFIX
from impact_rig.recordings.writer import COMPRESSIONS, RecordingWriter

DISCOVERY_PERIOD = 0.2
"""How often further topics and nodes are looked for [s], our choice: the ROS graph sends no event
here."""
HEALTH_PERIOD = 1.0
"""How often losses are published, and how long a message may wait to be written to disk [s]."""


class RecorderNode(RigNode):
    """Records while it is active: one activation, one recording."""

    def __init__(self, **options: Any) -> None:
        super().__init__("recorder", **options)
        self.declare(
            "output", "",
            f"the new recording, an {SUFFIX} file; empty: runs/<time>/{RECORDING_NAME} under the"
            " working directory",
        )  # fmt: skip
        self.declare("compression", "zstd", "of chunks", choices=COMPRESSIONS)
        self.declare(
            "required_topics", "acceleration, release, impact",
            "topics, by commas, that must be connected before the recorder calls itself"
            " recording, and a release is possible", live=True,
        )  # fmt: skip
        self.declare(
            "record_stream", False,
            "in continuous mode, whether the running stream of the accelerometers is recorded as"
            " a whole, beside the hits that are found in it; 72 GB an hour at 2.5 MS/s,"
            " uncompressed",
        )  # fmt: skip
        self.declare(
            "stream_depth", 10 * interfaces.STREAM_DEPTH,
            "how many blocks of the running stream may wait to be written; more are lost",
            low=interfaces.STREAM_DEPTH, high=100_000,
        )  # fmt: skip
        self.declare("notes", "", "in the operator's words; they go into the recording")
        self.declare("attachments", "", "files, by commas, that go into the recording")
        self._run: RecordingRun | None = None
        self._is_connected = False
        self._warning = self._message = ""
        self._publish = self.advertise_state(interfaces.RECORDER_STATE)
        self._stored = self.advertise(interfaces.RECORD_STORED)
        self.create_timer(DISCOVERY_PERIOD / self.pace, lambda: self._run_guarded(self._discover))
        self.create_timer(HEALTH_PERIOD / self.pace, lambda: self._run_guarded(self._check_health))
        self.offer_to_join()

    def configure(self) -> None:
        """Check the name of the recording."""
        output = self.get_value("output")
        if output and Path(output).suffix != SUFFIX:
            raise ParameterError(f"output is {output!r}: the name must end in {SUFFIX}")

    def activate(self) -> None:
        """Begin the recording, and subscribe to the rig's topics."""
        attachments = [
            read_attached_file(Path(name).expanduser())
            for name in _split_paths(self.get_value("attachments"))
        ]
        run = self._run = RecordingRun(
            self,
            self._open(),
            self._stored,
            self._on_failed,
            stream_depth=self.get_value("stream_depth") * self.get_value("record_stream"),
        )
        self._is_connected, self._warning = False, ""
        run.write_provenance(self.get_value("notes"))
        for file in attachments:
            run.writer.add_attachment(file.name, file.media_type, file.data)
        self.get_logger().info(f"recording to {run.writer.path}")
        self._discover()
        if not self._is_connected:
            self._publish_state(f"waiting: {self._describe_missing_topics()}")

    def deactivate(self) -> None:
        """Finish the recording."""
        run = self._run
        if run is None or run.writer.closed:
            return
        try:
            run.close("closed")
        except FileError as error:
            self.report_fault(str(error))
            return
        writer = run.writer
        self.get_logger().info(
            f"{writer.path} is closed: {writer.messages} messages, {writer.size / 1e6:.3g} MB"
        )
        self._publish_state("closed")

    def join(self, request: JoinCampaign.Request, response: JoinCampaign.Response) -> None:
        """Record what belongs to a campaign, and nothing of any other."""
        if self._run is not None and self._is_recording:
            response.recording = str(self._run.writer.path)
        else:
            response.message = f"nothing is being recorded ({self._message}): start the recorder"

    def autostart(self) -> None:
        """Start, or publish that nothing is recorded yet."""
        if not self.get_value("autostart"):
            self._publish_state("the recorder is not active")
        super().autostart()

    def report_fault(self, text: str) -> None:
        """Publish an error in the state, too."""
        super().report_fault(text)
        self._publish_state(text)

    def describe_warning(self) -> str:
        """Return what the recording lacks."""
        return self._run.describe_losses() if self._run else ""

    def diagnose(self) -> dict[str, Any]:
        """Return what was written so far, and what was not."""
        return {
            "recording": self._is_recording,
            "waiting for": self._describe_missing_topics(),
            **(self._run.diagnose() if self._run else {}),
        }

    def count_messages(self, topic: str) -> int:
        """Return how many messages of a topic, by its full name, are in the recording."""
        return self._run.writer.count_messages(topic) if self._run else 0

    @property
    def _is_open(self) -> bool:
        return self._run is not None and not self._run.writer.closed

    @property
    def _is_recording(self) -> bool:
        """Whether a recording is open and connected to the required topics."""
        return self._is_open and self._is_connected

    def _open(self) -> RecordingWriter:
        output = self.get_value("output")
        path = Path(output or choose_run_folder() / RECORDING_NAME)
        return RecordingWriter(
            # An earlier one is there if the node is activated or started again.
            choose_free(path.expanduser().absolute()),
            compression=self.get_value("compression"),
            library=f"impact_rig {__version__}",
        )

    def _describe_missing_topics(self) -> str:
        """Return which required topics have no publisher; empty: all have one."""
        if self._run is None or not self._is_open:
            return ""
        required = split_names(self.get_value("required_topics"))
        missing = self._run.find_unconnected(required)
        return f"no publisher yet of {', '.join(missing)}" if missing else ""

    def _run_guarded(self, work: Callable[[], None]) -> None:
        """Do some of the work of an open recording; it ends with an error of the file."""
        if self._is_open:
            try:
                work()
            except FileError as error:
                self._on_failed(error)

    def _discover(self) -> None:
        """Record further topics; publish that everything is recorded once it is."""
        if self._run is not None:
            self._run.discover()
        if not self._is_connected and not self._describe_missing_topics():
            self._is_connected = True
            now = datetime.now().astimezone()
            self._publish_state(f"recording since {now:%Y-%m-%d %H:%M:%S}")

    def _check_health(self) -> None:
        """Write what waits to the disk, and publish further losses."""
        if self._run is not None:
            self._run.writer.flush()
        warning = self.describe_warning()
        if warning != self._warning and self._is_connected:
            self._warning = warning
            self.get_logger().warning(warning)
            self._publish_state(f"warning: {warning}")

    def _on_failed(self, error: FileError) -> None:
        """Keep what was written, and publish that nothing is recorded any more."""
        # The first error names the cause; the finished chunks are on disk.
        if self._run is not None and self._is_open:
            with contextlib.suppress(FileError):
                self._run.close("disk full" if isinstance(error, DiskFullError) else "error")
        self.report_fault(str(error))

    def _publish_state(self, message: str) -> None:
        self._message = message
        fields: dict[str, Any] = {}
        if self._run is not None:
            writer, total, stream = self._run.writer, self._run.records.total, self._run.stream
            fields = {
                "uri": str(writer.path),
                "messages": writer.messages,
                "size": writer.size,
                "gaps": total.gaps + stream.gaps,
                "missing_points": total.missing_points + stream.missing_points,
                "messages_lost": self._run.messages_lost,
            }
        if self.context.ok():
            self._publish(
                recording=self._is_recording,
                waiting=self._is_open and not self._is_connected,
                message=message,
                **fields,
            )


def _split_paths(text: str) -> list[str]:
    """Return the paths in a text that lists them by commas, or the one path that has a comma."""
    return [text] if Path(text).is_file() else split_names(text)


def main() -> int:
    """Run the node."""
    return run_node(RecorderNode)
