"""Digitizers and output lines of National Instruments: the drivers `nidaqmx`."""

import time
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.core.errors import DeviceError, ParameterError
from impact_rig.core.setup.calibration import STANDARD_GRAVITY
from impact_rig.core.signals.record import Block, ChannelBlock, FloatArray
from impact_rig.devices.nidaqmx.session import (
    NOT_DONE,
    NOT_YET,
    OVERWRITTEN,
    STOPPED_EARLY,
    UNKNOWN_PROPERTY,
    Session,
    check_serial_number,
    describe_device,
    find_device,
    find_devices,
    report_errors,
    take_server,
)
from impact_rig.devices.protocols import (
    NOT_MEASURED,
    Acquisition,
    AcquisitionPlan,
    FoundDevice,
    HolderState,
    SourceChannel,
    ToldHolder,
    take_energized_state,
)

if TYPE_CHECKING:
    from nidaqmx import Task
    from nidaqmx.system.device import Device

COUPLINGS = ("AC", "DC")
RAIL = 0.999
"""Part of the input's range from which on a number counts as overload [-], our choice: 16 bits end
three parts in 100 000 below the range."""
HIGHEST_RANGE = 1000.0
"""[V] What no input exceeds."""
HIGHEST_CURRENT = 0.1
"""[A] What no IEPE supply exceeds."""


@dataclass(frozen=True)
class Input:
    """A channel of a task, and what its numbers mean.

    Attributes
    ----------
    name : str
        Of the virtual channel.
    scale : float
        Acceleration for one unit of the task's numbers, signed [m/s^2].
    full_scale : float
        Largest acceleration that sensor and input can show [m/s^2].
    limit : float
        The task's number at the end of the input's range.
    """

    name: str
    scale: float
    full_scale: float
    limit: float

    def make_block(self, numbers: FloatArray, *, overloaded: bool = False) -> ChannelBlock:
        """Return some numbers as a block; at the end of the range they are overloaded, too."""
        at_rail = bool(np.any(np.abs(numbers) >= RAIL * self.limit))
        return ChannelBlock(numbers, self.scale, 0.0, self.full_scale, overloaded or at_rail)


def check_terminal(device: "Device", channel: SourceChannel) -> None:
    """Require that the device has the analog input.

    Raises
    ------
    ParameterError
        If it has not.
    """
    known = device.ai_physical_chans.channel_names
    if channel.name not in known:
        raise channel.options.make_error(
            "channel",
            f"{device.name} has no analog input {channel.name!r}: it has {', '.join(known)}",
        )


def add_input(task: "Task", channel: SourceChannel) -> Input:
    """Add a sensor's channel to a task.

    Parameters
    ----------
    task : Task
        Not yet started.
    channel : SourceChannel
        Options: iepe_current, coupling, range.

    Raises
    ------
    ParameterError
        If an option cannot be meant, or the device cannot do it.
    """
    from nidaqmx.constants import Coupling

    options = channel.options
    options.check_keys("iepe_current", "coupling", "range")
    try:
        volts_scale = channel.compute_scale()
    except ParameterError as error:
        raise options.locate(error) from None
    limit = _take_range(channel)
    current = _take_current(channel)
    coupling = _take_coupling(channel, current)
    add, unit_per_volt = _choose_channel(task, channel, current)
    subject = f"analog input {channel.name}"
    with report_errors(subject, options, "range"):
        largest = limit * unit_per_volt
        found = add(channel.name, channel.sensor.channel, min_val=-largest, max_val=largest)
    if coupling:
        with report_errors(subject, options, "coupling"):
            found.ai_coupling = Coupling[coupling]
    electrical = float(found.ai_rng_high)
    return Input(
        name=channel.sensor.channel,
        # Sensitivities are positive in NI-DAQmx: their sign is here.
        scale=volts_scale / unit_per_volt,
        full_scale=channel.compute_full_scale(electrical),
        limit=electrical * unit_per_volt,
    )


def _choose_channel(
    task: "Task", channel: SourceChannel, current: float
) -> tuple[Callable[..., Any], float]:
    """Return how the channel is added, and its units per volt."""
    from functools import partial

    from nidaqmx.constants import (
        AccelSensitivityUnits,
        AccelUnits,
        ExcitationSource,
        ForceIEPESensorSensitivityUnits,
        ForceUnits,
    )

    if not current:
        return task.ai_channels.add_ai_voltage_chan, 1.0
    excitation = {
        "current_excit_source": ExcitationSource.INTERNAL,
        "current_excit_val": current,
    }
    unit_per_volt = abs(channel.compute_scale())
    if channel.sensor.quantity == "force":
        unit_per_volt *= channel.moving_mass
        return partial(
            task.ai_channels.add_ai_force_iepe_chan,
            units=ForceUnits.NEWTONS,
            sensitivity=1e3 / unit_per_volt,
            sensitivity_units=ForceIEPESensorSensitivityUnits.MILLIVOLTS_PER_NEWTON,
            **excitation,
        ), unit_per_volt
    return partial(
        task.ai_channels.add_ai_accel_chan,
        units=AccelUnits.METERS_PER_SECOND_SQUARED,
        sensitivity=1e3 * STANDARD_GRAVITY / unit_per_volt,
        sensitivity_units=AccelSensitivityUnits.MILLIVOLTS_PER_G,
        **excitation,
    ), unit_per_volt


def _take_range(channel: SourceChannel) -> float:
    """Return the largest voltage that is expected [V]."""
    options = channel.options
    default = abs(channel.sensor.full_scale * channel.sensor.sensitivity)
    if "range" not in options and not default:
        raise options.make_error(
            "range",
            f'{options.place} lacks range: give it, for example range = "5 V", or the sensor\'s'
            " full_scale",
        )
    limit = options.take_quantity("range", "V", "5 V", default, low=0.0, high=HIGHEST_RANGE)
    if not limit > 0.0:
        raise options.refuse("range", "above zero")
    return limit


def _take_current(channel: SourceChannel) -> float:
    """Return the current of the sensor's supply [A]; 0: it has one of its own."""
    options = channel.options
    if options.get("iepe_current") == "off":
        return 0.0
    current = options.take_quantity(
        "iepe_current", "A", "4 mA", REQUIRED, low=0.0, high=HIGHEST_CURRENT
    )
    if not current > 0.0:
        raise options.refuse("iepe_current", 'above zero, or "off"')
    return current


def _take_coupling(channel: SourceChannel, current: float) -> str:
    """Return the input's coupling; empty: the device's own."""
    if not current and "coupling" not in channel.options:
        return ""
    # The bias of a supply is kept out, unless the rig file wants it.
    return channel.options.take_choice("coupling", COUPLINGS, COUPLINGS[0])


ANALOG = "analog"
"""The trigger is the hammer's own signal; else a terminal."""
EITHER = "either"
EDGES = (EITHER, "rising", "falling")


class Trigger:
    """What the rig file says of it.

    Parameters
    ----------
    options : TomlTable
        trigger: "analog" or a terminal; edge: of the acceleration, or of the terminal's voltage.

    Raises
    ------
    ParameterError
        If a value is none of these.
    """

    def __init__(self, options: TomlTable) -> None:
        self._options = options
        self._source = options.take_text("trigger", ANALOG)
        is_analog = self._source == ANALOG
        if not is_analog and not self._source.startswith("/"):
            raise options.refuse("trigger", "analog, or a terminal like /Dev1/PFI0")
        edges = EDGES if is_analog else EDGES[1:]
        self._edge = options.take_choice("edge", edges, edges[0])

    def set_up(self, task: "Task", plan: AcquisitionPlan, hammer: Input) -> None:
        """Tell the task.

        Raises
        ------
        ParameterError
            If the device cannot trigger so.
        """
        with report_errors(f"trigger {self._source}", self._options, "trigger"):
            if self._source == ANALOG:
                self._set_up_analog(task, plan, hammer)
            else:
                self._set_up_terminal(task, plan)

    def _set_up_analog(self, task: "Task", plan: AcquisitionPlan, hammer: Input) -> None:
        from nidaqmx.constants import Slope, WindowTriggerCondition1

        if plan.trigger_level >= hammer.full_scale:
            raise self._options.make_error(
                "trigger_level",
                f"trigger_level of {self._options.place} is {plan.trigger_level:g} m/s^2: the"
                f" hammer's channel shows {hammer.full_scale:g} m/s^2 at most",
            )
        level = plan.trigger_level / abs(hammer.scale)
        trigger = task.triggers.reference_trigger
        if self._edge == EITHER:
            trigger.cfg_anlg_window_ref_trig(
                hammer.name, level, -level, plan.pre_trigger_points,
                WindowTriggerCondition1.LEAVING_WINDOW,
            )  # fmt: skip
            return
        # A sensor that looks the other way falls where the acceleration rises.
        is_rising = (self._edge == "rising") == (hammer.scale > 0.0)
        trigger.cfg_anlg_edge_ref_trig(
            hammer.name,
            plan.pre_trigger_points,
            Slope.RISING if is_rising else Slope.FALLING,
            level if is_rising else -level,
        )

    def _set_up_terminal(self, task: "Task", plan: AcquisitionPlan) -> None:
        from nidaqmx.constants import Edge

        task.triggers.reference_trigger.cfg_dig_edge_ref_trig(
            self._source, plan.pre_trigger_points, Edge[self._edge.upper()]
        )


class Reading(ABC):
    """Reads blocks of a task.

    Parameters
    ----------
    task : Task
        Set up, not started.
    plan : AcquisitionPlan
        What was asked for.
    rate : float
        What it became [Hz].
    inputs : tuple of Input
        The task's channels: hammer, and sample if it is measured.
    """

    def __init__(
        self, task: "Task", plan: AcquisitionPlan, rate: float, inputs: tuple[Input, ...]
    ) -> None:
        from nidaqmx.stream_readers import AnalogMultiChannelReader

        self._task = task
        self._plan = plan
        self._rate = rate
        self._inputs = inputs
        self._reader = AnalogMultiChannelReader(task.in_stream)
        # The array is made for the task's channels: asking for them again costs two calls.
        self._reader.verify_array_shape = False
        self._tells_overload = True
        self._is_running = False
        self._begin = 0

    def start(self) -> None:
        """Let the task run."""
        self._begin = time.time_ns()
        self._task.start()
        self._is_running = True

    @abstractmethod
    def read(self, timeout: float) -> Block | None:
        """Return the next block; None if there is none in time [s]."""

    def stop(self) -> None:
        """Stop the task, if it runs, and forget what was not read."""
        if self._is_running:
            self._is_running = False
            self._task.stop()

    def _read_numbers(self, count: int, timeout: float) -> FloatArray:
        """Return samples, one row per channel; fewer if not all come in time [s]."""
        from nidaqmx.errors import DaqReadError

        numbers = np.full((len(self._inputs), count), np.nan)
        try:
            size = self._reader.read_many_sample(numbers, count, timeout)
        except DaqReadError as error:
            if error.error_type.name != NOT_YET:
                raise
            size = error.samps_per_chan_read
        except (AssertionError, ValueError):
            # `nidaqmx` finds more numbers than fit into the array.
            size = -1
        # Too few samples lie together at the beginning, channel by channel.
        taken = numbers.ravel()[: len(self._inputs) * max(size, 0)]
        if not 0 <= size <= count or np.isnan(taken).any():
            raise DeviceError(
                f"{self._inputs[0].name} channel: NI-DAQmx was asked for {count} samples of"
                f" {len(self._inputs)} channels, and its answer does not fit"
            )
        return taken.reshape(len(self._inputs), size)

    def _read_overloaded(self) -> tuple[bool, ...]:
        """Return which inputs the device says were overloaded since it was asked last."""
        from nidaqmx.errors import DaqError

        names: list[str] = []
        try:
            if self._tells_overload and self._task.in_stream.overloaded_chans_exist:
                names = self._task.in_stream.overloaded_chans
        except DaqError as error:
            if error.error_type.name != UNKNOWN_PROPERTY:
                raise
            self._tells_overload = False
        return tuple(channel.name in names for channel in self._inputs)

    def _make_block(
        self, first: int, numbers: FloatArray, overloaded: tuple[bool, ...], **fields: Any
    ) -> Block:
        channels = [
            channel.make_block(row, overloaded=flag)
            for channel, row, flag in zip(self._inputs, numbers, overloaded, strict=True)
        ]
        specimen = (*channels[1:], NOT_MEASURED)[0]
        return Block(first, self._rate, channels[0], specimen, **fields)


class RecordReading(Reading):
    """One record for each trigger."""

    def start(self) -> None:
        """Wait for the trigger."""
        _expect_early_stops()
        super().start()

    def read(self, timeout: float) -> Block | None:
        """Return the record; None if it is not complete in time [s]."""
        from nidaqmx.errors import DaqError

        if not self._is_running:
            return None
        try:
            self._task.wait_until_done(timeout)
        except DaqError as error:
            if error.error_type.name == NOT_DONE:
                return None
            raise
        points = self._plan.points
        # The record ended just now.
        stamp = time.time_ns() - round(points / self._rate * 1e9)
        numbers = self._read_numbers(points, 0.0)
        if numbers.shape[1] != points:
            raise DeviceError(
                f"NI-DAQmx gave {numbers.shape[1]} of the {points} samples of a complete record"
            )
        overloaded = self._read_overloaded()
        self.stop()
        return self._make_block(0, numbers, overloaded, last=True, stamp=stamp)


class StreamReading(Reading):
    """Everything that comes."""

    def start(self) -> None:
        """Let samples come."""
        from nidaqmx.constants import OverwriteMode

        # Who reads too late loses samples, not the stream.
        self._task.in_stream.overwrite = OverwriteMode.OVERWRITE_UNREAD_SAMPLES
        super().start()

    def read(self, timeout: float) -> Block | None:
        """Return the next samples; None if there are none in time [s]."""
        from nidaqmx.errors import DaqError

        if not self._is_running:
            return None
        stream = self._task.in_stream
        try:
            numbers = self._read_numbers(self._plan.block_size, timeout)
        except DaqError as error:
            if error.error_type.name != OVERWRITTEN:
                raise
            numbers = self._read_newest()
        if not numbers.size:
            return None
        first = int(stream.curr_read_pos) - numbers.shape[1]
        return self._make_block(
            first,
            numbers,
            self._read_overloaded(),
            stamp=self._begin + round(first / self._rate * 1e9),
        )

    def _read_newest(self) -> FloatArray:
        """Read the last block of what there is, and go on from there."""
        from nidaqmx.constants import ReadRelativeTo

        stream = self._task.in_stream
        stream.relative_to = ReadRelativeTo.MOST_RECENT_SAMPLE
        stream.offset = -self._plan.block_size
        numbers = self._read_numbers(self._plan.block_size, 0.0)
        stream.relative_to = ReadRelativeTo.CURRENT_READ_POSITION
        stream.offset = 0
        return numbers


def _expect_early_stops() -> None:
    """Let NI-DAQmx not warn where a task is stopped before its trigger: that is what `stop` is."""
    from nidaqmx.errors import DaqWarning

    warnings.filterwarnings("ignore", rf"\s*Warning {STOPPED_EARLY} occurred", DaqWarning)


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

    def read(self, timeout: float) -> Block | None:
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

        identity, is_simulated = self._check_devices(session, plan.channels)
        task = session.open_task(plan.hammer.name)
        inputs = tuple(add_input(task, channel) for channel in plan.channels)
        rate = self._set_clock(task, plan)
        if not plan.continuous:
            self._trigger.set_up(task, plan, inputs[0])
        with report_errors(session.subject, self._options):
            # Whatever NI-DAQmx checks late, and the reservation.
            task.control(TaskMode.TASK_COMMIT)
        kind = StreamReading if plan.continuous else RecordReading
        self._reading = kind(task, plan, rate, inputs)
        self._channels = plan.channels
        return Acquisition(identity, rate, is_simulated)

    def _check_devices(
        self, session: Session, channels: tuple[SourceChannel, ...]
    ) -> tuple[str, bool]:
        """Require the right devices and inputs; return what they are, and whether of software."""
        system = session.find_system()
        identities, is_simulated = [], False
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
            is_simulated = is_simulated or device.is_simulated
        place = f" at {self._server}" if self._server else ""
        return " and ".join(dict.fromkeys(identities)) + place, is_simulated

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


HOLDER_PATIENCE = 0.4
"""Longest time for an answer of NI's server [s], our choice: no call of a holder takes longer than
half a second."""
WRITE_TIME = 0.1
"""Longest time for the line itself [s], our choice: it is not clocked."""


class NidaqmxHolder(ToldHolder):
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

    def __init__(self, options: TomlTable) -> None:
        options.check_keys("line", "energized", "serial_number", "server")
        self._options = options
        self._line = options.take_text("line", REQUIRED, "Dev1/port0/line0")
        self._when_high = take_energized_state(options, HolderState.HOLDING)
        self._session = Session(f"NI line {self._line}", take_server(options), HOLDER_PATIENCE)
        self._writer: Any = None
        self._reader: Any = None

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

    def read_state(self) -> HolderState:
        """Read the line back."""
        self._check_configured()
        with report_errors(self._session.subject):
            is_high = bool(self._reader.read_one_sample_one_line(WRITE_TIME))
        found = next(state for state in HolderState if (state is self._when_high) == is_high)
        if found is not self.told:
            raise DeviceError(
                f"{self._session.subject} is {'high' if is_high else 'low'}, which is"
                f" {found.value}: it was told {self.told.value}"
            )
        return found

    def close(self) -> None:
        """End task and connection; the line stays as it is."""
        self._writer = self._reader = None
        self._session.close()

    def tell(self, state: HolderState) -> None:
        """Bring the device into a state; raises `DeviceError` if it does not obey."""
        self._check_configured()
        with report_errors(self._session.subject):
            self._writer.write_one_sample_one_line(state is self._when_high, WRITE_TIME)
        self.told = state

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
