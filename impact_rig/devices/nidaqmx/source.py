"""Acceleration source: digitizers of National Instruments."""

from typing import TYPE_CHECKING, ClassVar

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.errors import DeviceError
from impact_rig.devices.acceleration_source import (
    AcquiredBlock,
    Acquisition,
    AcquisitionPlan,
    SourceChannel,
)
from impact_rig.devices.found_device import FoundDevice
from impact_rig.devices.nidaqmx.errors import report_errors
from impact_rig.devices.nidaqmx.identity import (
    check_serial_number,
    describe_device,
    find_device,
    find_devices,
)
from impact_rig.devices.nidaqmx.inputs import add_input, check_terminal
from impact_rig.devices.nidaqmx.readings import Reading, RecordReading, StreamReading
from impact_rig.devices.nidaqmx.session import Session, take_server
from impact_rig.devices.nidaqmx.triggers import Trigger

if TYPE_CHECKING:
    from nidaqmx import Task

PATIENCE = 5.0
"""Longest time for an answer of NI's server beyond what a call waits itself [s], our choice: to
commit a task of a networked chassis takes a second or two."""
RATE_TOLERANCE = 0.01
"""How far the device's rate may be from the rig file's, part of it [-], our choice: the clock's
own rate is what is used then."""


class NidaqmxSource:
    """Analog inputs with a sample clock and a reference trigger, by NI-DAQmx.

    Parameters
    ----------
    options : TomlTable
        trigger, edge, serial_number, server.

    Raises
    ------
    ParameterError
        If a key is unknown, or a value cannot be meant.
    """

    description: ClassVar[str] = "digitizers of National Instruments, by NI-DAQmx"
    example: ClassVar[str] = """\
[source]
driver = "nidaqmx"
sampling_rate = "2.5 MHz"
trigger_level = "5 g"
trigger = "analog"           # the hammer's signal (default), or a terminal like "/Dev1/PFI0"
edge = "either"              # of the acceleration: either (default), rising, falling
# serial_number = "01A2B3C4" # of the device: another one is refused
# server = "192.168.1.30:31763"  # a computer that runs NI's gRPC device server

[source.hammer]
channel = "Dev1/ai0"
sensitivity = "10 mV/g"
iepe_current = "4 mA"        # or "off": the sensor has a supply of its own
# coupling = "AC"            # or "DC"; default: AC with a current, else the device's own
range = "5 V"                # default: the sensor's full_scale

[source.specimen]
channel = "Dev1/ai1"
sensitivity = "10 mV/g"
iepe_current = "4 mA"
range = "5 V"
"""

    def __init__(self, options: TomlTable) -> None:
        options.check_keys("trigger", "edge", "serial_number", "server")
        self._options = options
        self._server = take_server(options)
        self._trigger = Trigger(options)
        self._session: Session | None = None
        self._reading: Reading | None = None
        self._channels: tuple[SourceChannel, ...] = ()

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return what NI-DAQmx of this computer knows."""
        return find_devices()

    def configure(self, plan: AcquisitionPlan) -> Acquisition:
        """Set a task up and reserve the device."""
        self.close()
        device = plan.hammer.name.partition("/")[0]
        self._session = Session(f"NI device {device}", self._server, PATIENCE)
        try:
            with report_errors(self._session.subject):
                return self._configure(self._session, plan)
        except BaseException:
            self.close()
            raise

    def arm(self) -> None:
        """Start the task: its sample clock runs, and its trigger waits."""
        if self._session is None or self._reading is None:
            raise DeviceError("NI device: it is not configured")
        with report_errors(self._session.subject):
            self._reading.start()

    def read(self, timeout: float) -> AcquiredBlock | None:
        """Return the next block."""
        if self._session is None or self._reading is None:
            return None
        with report_errors(self._session.subject):
            return self._reading.read(timeout)

    def disarm(self) -> None:
        """Stop the task."""
        if self._session is not None and self._reading is not None:
            with report_errors(self._session.subject):
                self._reading.stop()

    def check(self) -> None:
        """See that NI-DAQmx still knows the device; raises `DeviceError`."""
        if self._session is None:
            raise DeviceError("NI device: it is not configured")
        with report_errors(self._session.subject):
            system = self._session.find_system()
            for channel in self._channels:
                find_device(system, channel.name, "channel", channel.options)

    def close(self) -> None:
        """End task and connection."""
        session, self._session = self._session, None
        self._reading = None
        if session is not None:
            session.close()

    def _configure(self, session: Session, plan: AcquisitionPlan) -> Acquisition:
        from nidaqmx.constants import TaskMode

        channels = tuple(
            channel for channel in (plan.hammer, plan.specimen) if channel is not None
        )
        identity = self._check_devices(session, channels)
        task = session.open_task(plan.hammer.name)
        inputs = tuple(add_input(task, channel) for channel in channels)
        rate = self._set_clock(task, plan)
        if not plan.continuous:
            self._trigger.set_up(task, plan, inputs[0])
        with report_errors(session.subject, self._options):
            # Whatever NI-DAQmx checks late, and the reservation.
            task.control(TaskMode.TASK_COMMIT)
        kind = StreamReading if plan.continuous else RecordReading
        self._reading = kind(task, plan, rate, inputs)
        self._channels = channels
        return Acquisition(identity, rate)

    def _check_devices(self, session: Session, channels: tuple[SourceChannel, ...]) -> str:
        """Require the right devices and inputs; return what they are."""
        system = session.find_system()
        identities = []
        for channel in channels:
            device = find_device(system, channel.name, "channel", channel.options)
            check_terminal(device, channel)
            if len(channels) > 1 and not device.ai_simultaneous_sampling_supported:
                raise channel.options.make_error(
                    "channel",
                    f"{device.name} samples its inputs one behind the other, hammer and sample"
                    " must be sampled at once: take another device, or leave [source.specimen]"
                    " out",
                )
            if channel is channels[0]:
                check_serial_number(device, self._options)
            identities.append(f"{describe_device(device)}, {device.name}")
        place = f" at {self._server}" if self._server else ""
        return " and ".join(dict.fromkeys(identities)) + place

    def _set_clock(self, task: "Task", plan: AcquisitionPlan) -> float:
        """Set sampling rate and length; return the rate that it became [Hz]."""
        from nidaqmx.constants import AcquisitionType

        mode = AcquisitionType.CONTINUOUS if plan.continuous else AcquisitionType.FINITE
        # In continuous mode the number is the size of the buffer.
        count = plan.block_size * plan.depth if plan.continuous else plan.points
        with report_errors("sample clock", self._options, "sampling_rate"):
            task.timing.cfg_samp_clk_timing(
                plan.sampling_rate, sample_mode=mode, samps_per_chan=count
            )
            rate = float(task.timing.samp_clk_rate)
        if abs(rate / plan.sampling_rate - 1.0) > RATE_TOLERANCE:
            raise self._options.make_error(
                "sampling_rate",
                f"sampling_rate of {self._options.place} is {plan.sampling_rate:g} Hz: the"
                f" nearest that the device can is {rate:g} Hz",
            )
        return rate
