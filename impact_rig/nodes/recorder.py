"""The recorder: writes every topic of the rig to MCAP, as received."""

import contextlib
from collections.abc import Callable
from datetime import datetime
from functools import partial
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
from impact_rig.nodes.recorder_run import RecordingRun
from impact_rig.nodes.rig_node import RigNode
from impact_rig.recordings.new_file import DiskFullError, choose_free
from impact_rig.recordings.provenance import read_attached_file
from impact_rig.recordings.source import SUFFIX
from impact_rig.recordings.writer import COMPRESSIONS, RecordingWriter


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
            "record_stream", False,
            "in continuous mode, whether the running stream of the accelerometers is recorded as"
            " a whole, beside the hits that are found in it; 72 GB an hour at 2.5 MS/s,"
            " uncompressed",
        )  # fmt: skip
        self.declare("notes", "", "in the operator's words; they go into the recording")
        self.declare("attachments", "", "files, by commas, that go into the recording")
        self._run: RecordingRun | None = None
        self._message = ""
        self._warning: str | None = None
        self._publish = self.advertise_state(interfaces.RECORDER_STATE)
        self._stored = self.advertise(interfaces.RECORD_STORED)
        for period, work in ((0.2, RecordingRun.discover), (1.0, self._check_health)):
            self.create_timer(period / self.pace, partial(self._run_guarded, work))
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
            record_stream=self.get_value("record_stream"),
        )
        self._warning = None
        run.write_provenance(self.get_value("notes"))
        for file in attachments:
            run.writer.add_attachment(file.name, file.media_type, file.data)
        self.get_logger().info(f"recording to {run.writer.path}")
        run.discover()
        self._publish_state(f"recording since {datetime.now().astimezone():%Y-%m-%d %H:%M:%S}")

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

    def describe_warning(self) -> str | None:
        """Return what the recording lacks."""
        return self._run.describe_losses() if self._run else None

    def diagnose(self) -> dict[str, Any]:
        """Return what was written so far, and what was not."""
        return {
            "recording": self._is_recording,
            **(self._run.diagnose() if self._run else {}),
        }

    @property
    def _is_recording(self) -> bool:
        return self._run is not None and not self._run.writer.closed

    def _open(self) -> RecordingWriter:
        output = self.get_value("output")
        path = Path(output or choose_run_folder() / RECORDING_NAME)
        return RecordingWriter(
            # An earlier one is there if the node is activated or started again.
            choose_free(path.expanduser().absolute()),
            compression=self.get_value("compression"),
            library=f"impact_rig {__version__}",
        )

    def _run_guarded(self, work: Callable[[RecordingRun], None]) -> None:
        """Do some of the work of an open recording; it ends with an error of the file."""
        run = self._run
        if run is not None and not run.writer.closed:
            try:
                work(run)
            except FileError as error:
                self._on_failed(error)

    def _check_health(self, run: RecordingRun) -> None:
        """Write what waits to the disk, and publish further losses."""
        run.writer.flush()
        warning = run.describe_losses()
        if warning is not None and warning != self._warning:
            self._warning = warning
            self.get_logger().warning(warning)
            self._publish_state(f"warning: {warning}")

    def _on_failed(self, error: FileError) -> None:
        """Keep what was written, and publish that nothing is recorded any more."""
        # The first error names the cause; the finished chunks are on disk.
        if self._run is not None and self._is_recording:
            with contextlib.suppress(FileError):
                self._run.close("disk full" if isinstance(error, DiskFullError) else "error")
        self.report_fault(str(error))

    def _publish_state(self, message: str) -> None:
        self._message = message
        fields: dict[str, Any] = {}
        if self._run is not None:
            fields["uri"] = str(self._run.writer.path)
            fields["messages_lost"] = self._run.messages_lost
        if self.context.ok():
            self._publish(recording=self._is_recording, message=message, **fields)


def _split_paths(text: str) -> list[str]:
    """Return the paths in a text that lists them by commas, or the one path that has a comma."""
    return [text] if Path(text).is_file() else split_names(text)
