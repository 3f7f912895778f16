"""Hammer holder: a digital output line of a device of National Instruments."""

from typing import TYPE_CHECKING, Any, ClassVar

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.core.errors import DeviceError
from impact_rig.devices.found_device import FoundDevice
from impact_rig.devices.hammer_holder import HolderState
from impact_rig.devices.nidaqmx.errors import report_errors
from impact_rig.devices.nidaqmx.identity import (
    check_serial_number,
    describe_device,
    find_device,
    find_devices,
)
from impact_rig.devices.nidaqmx.session import Session, take_server

if TYPE_CHECKING:
    from nidaqmx import Task

PATIENCE = 0.4
"""Longest time for an answer of NI's server [s], our choice: no call of a holder takes longer than
half a second."""
WRITE_TIME = 0.1
"""Longest time for the line itself [s], our choice: it is not clocked."""
ENERGIZED = ("holds", "releases")


class NidaqmxHolder:
    """A line that drives what holds the hammer, by NI-DAQmx.

    The line keeps its level when the task ends. What it does while the computer starts is the
    line's power-up state, which is set once with NI's own tools. When a release is not answered in
    time nobody knows whether the line has changed: it holds again when it is configured again.

    Parameters
    ----------
    options : TomlTable
        line, energized, serial_number, server.

    Raises
    ------
    ParameterError
        If a key is unknown or lacks, or a value cannot be meant.
    """

    description: ClassVar[str] = "a digital output line of National Instruments, by NI-DAQmx"
    example: ClassVar[str] = """\
[holder]
driver = "nidaqmx"
line = "Dev1/port0/line0"
energized = "holds"          # with a high line the hammer is held (default), or "releases"
# serial_number = "01A2B3C4" # of the device: another one is refused
# server = "192.168.1.30:31763"  # a computer that runs NI's gRPC device server
"""
    is_by_hand: ClassVar[bool] = False

    def __init__(self, options: TomlTable) -> None:
        options.check_keys("line", "energized", "serial_number", "server")
        self._options = options
        self._line = options.take_text("line", REQUIRED, "Dev1/port0/line0")
        self._holds_high = options.take_choice("energized", ENERGIZED, "holds") == "holds"
        self._session = Session(f"NI line {self._line}", take_server(options), PATIENCE)
        self._writer: Any = None
        self._reader: Any = None
        self._state = HolderState.HOLDING

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return what NI-DAQmx of this computer knows."""
        return find_devices()

    def configure(self) -> str:
        """Take the line, and hold."""
        self.close()
        try:
            with report_errors(self._session.subject, self._options, "line"):
                identity = self._check_device()
                self._take_line(self._session.open_task(self._line))
            self.hold()
        except BaseException:
            self.close()
            raise
        return identity

    def hold(self) -> None:
        """Hold."""
        self._write(HolderState.HOLDING)

    def release(self) -> None:
        """Let go."""
        self._write(HolderState.RELEASED)

    def read_state(self) -> HolderState:
        """Read the line back."""
        self._check_configured()
        with report_errors(self._session.subject):
            is_high = bool(self._reader.read_one_sample_one_line(WRITE_TIME))
        found = HolderState.HOLDING if is_high == self._holds_high else HolderState.RELEASED
        if found is not self._state:
            level = "high" if is_high else "low"
            raise DeviceError(
                f"{self._session.subject} is {level}, which is {found.value}: it was told"
                f" {self._state.value}"
            )
        return found

    def close(self) -> None:
        """End task and connection; the line stays as it is."""
        self._writer = self._reader = None
        self._session.close()

    def _write(self, state: HolderState) -> None:
        self._check_configured()
        is_high = (state is HolderState.HOLDING) == self._holds_high
        with report_errors(self._session.subject):
            self._writer.write_one_sample_one_line(is_high, WRITE_TIME)
        self._state = state

    def _check_configured(self) -> None:
        if self._writer is None:
            raise DeviceError(f"{self._session.subject} is not configured")

    def _check_device(self) -> str:
        """Require the right device and line; return what it is."""
        device = find_device(self._session.find_system(), self._line, "line", self._options)
        known = device.do_lines.channel_names
        if self._line not in known:
            raise self._options.make_error(
                "line", f"{device.name} has no output line {self._line!r}: it has"
                f" {', '.join(known)}",
            )  # fmt: skip
        check_serial_number(device, self._options)
        return f"{describe_device(device)}, {self._line}"

    def _take_line(self, task: "Task") -> None:
        from nidaqmx.constants import LineGrouping
        from nidaqmx.stream_readers import DigitalSingleChannelReader
        from nidaqmx.stream_writers import DigitalSingleChannelWriter

        task.do_channels.add_do_chan(self._line, line_grouping=LineGrouping.CHAN_PER_LINE)
        self._reader = DigitalSingleChannelReader(task.in_stream)
        self._writer = DigitalSingleChannelWriter(task.out_stream, auto_start=True)
