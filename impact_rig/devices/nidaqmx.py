"""Digitizers and output lines of National Instruments, by NI-DAQmx: the drivers `nidaqmx`."""

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, ClassVar

import numpy as np

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.core.given.errors import DeviceError, RigError
from impact_rig.core.given.records import Block, FloatArray
from impact_rig.devices.drivers import read_example
from impact_rig.devices.protocols import (
    NOT_MEASURED,
    Acquisition,
    AcquisitionPlan,
    ChannelScale,
    CommandedHolder,
    FoundDevice,
    HolderState,
    SourceChannel,
    take_energized_state,
)

# Names of errors, as in `nidaqmx.error_codes`.
UNKNOWN_PROPERTY = "ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT"
OVERWRITTEN = "SAMPLES_NO_LONGER_AVAILABLE"
NOT_YET = "SAMPLES_NOT_YET_AVAILABLE"
NOT_DONE = "WAIT_UNTIL_DONE_DOES_NOT_INDICATE_DONE"


@contextmanager
def report_errors(subject: str, options: TomlTable | None = None, key: str = "") -> Iterator[None]:
    """Turn what `nidaqmx` raises into errors of the rig.

    Parameters
    ----------
    subject : str
        Of the message: "NI device Dev1".
    options, key : TomlTable, str
        The value of the rig file that the device may refuse: then the error is a `ParameterError`
        with its line.
    """
    from nidaqmx.errors import (
        DaqError,
        DaqFunctionNotSupportedError,
        DaqNotFoundError,
        DaqNotSupportedError,
    )

    try:
        yield
    except (DaqNotFoundError, DaqNotSupportedError, DaqFunctionNotSupportedError):
        raise DeviceError(
            f"{subject}: NI-DAQmx is not installed on this computer, or too old for it: install it"
            " from ni.com"
        ) from None
    except DaqError as error:
        text = f"{subject}: NI-DAQmx says: {' '.join(str(error).split())}"
        raise (DeviceError(text) if options is None else options.make_error(key, text)) from None


class NidaqmxDriver:
    """Common part of source and holder."""

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return the devices that NI-DAQmx knows; `DeviceError` if it is not installed."""
        from nidaqmx.system import System

        with report_errors("NI-DAQmx"):
            return tuple(
                FoundDevice(device.name, describe_device(device)) for device in System().devices
            )

    def __init__(self, options: TomlTable, subject: str) -> None:
        self._options = options
        self._subject = subject  # of messages
        self._task: Any = None

    def close(self) -> None:
        """End the task: a line stays as it is. Never raises: the device may be gone."""
        if self._task is not None:
            with suppress(RigError), report_errors(self._subject):
                self._task.close()
        self._task = None


def describe_device(device: Any) -> str:
    """Return maker, model and serial number."""
    kind = ", simulated" if device.is_simulated else ""
    return f"NI {device.product_type} {device.serial_num:08X}{kind}"


def find_device(terminal: str, key: str, table: TomlTable) -> Any:
    """Return the device of a channel or line like "Dev1/ai0", which is a key of a table.

    Raises
    ------
    ParameterError
        If this is no name of a terminal.
    DeviceError
        If NI-DAQmx knows no such device: it may come.
    """
    from nidaqmx.system import System

    name, slash, rest = terminal.partition("/")
    if not (name and slash and rest) or "," in terminal:
        raise table.make_error(
            key, f"{key} of {table.place} is {terminal!r}: give device and terminal, like Dev1/ai0"
        )
    known = System().devices.device_names
    if name not in known:
        listed = ", ".join(known) or "none"
        raise DeviceError(
            str(table.make_error(key, f"NI-DAQmx knows no device {name!r}: known are {listed}"))
        )
    return System().devices[name]


RAIL = 0.999  # part of the range from which on a channel is overloaded; 16 bits end at 0.99997


def add_input(task: Any, channel: SourceChannel) -> ChannelScale:
    """Add a sensor's channel to a task; options: iepe_current, coupling, range.

    Raises
    ------
    ParameterError
        If an option is wrong, or the device cannot do it.
    """
    from nidaqmx.constants import Coupling

    options = channel.options
    options.check_keys("iepe_current", "coupling", "range")
    limit = _take_range(channel)
    current = _take_current(options)
    name = channel.sensor.channel
    with report_errors(f"analog input {channel.name}", options):
        if current:
            # NI-DAQmx supplies accelerometers only. At 1 V/g their numbers are volts.
            found = task.ai_channels.add_ai_accel_chan(
                channel.name, name, min_val=-limit, max_val=limit, sensitivity=1000.0,
                current_excit_val=current,
            )  # fmt: skip
        else:
            found = task.ai_channels.add_ai_voltage_chan(
                channel.name, name, min_val=-limit, max_val=limit
            )
        if current or "coupling" in options:
            # AC keeps the supply's bias out.
            found.ai_coupling = Coupling[options.take_choice("coupling", ("AC", "DC"), "AC")]
        limit = float(found.ai_rng_high)
    with options.locating():
        return channel.make_scale(1.0, limit, RAIL * limit)


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
    return options.take_quantity("range", "V", "5 V", default, low=1e-3, high=1e3)


def _take_current(options: TomlTable) -> float:
    """Return the current of the sensor's supply [A]; 0: the sensor has its own supply."""
    if options.get("iepe_current") == "off":
        return 0.0
    return options.take_quantity("iepe_current", "A", "4 mA", REQUIRED, low=1e-4, high=0.1)


RATE_TOLERANCE = 0.01  # relative; within it the clock's own rate is used


class NidaqmxSource(NidaqmxDriver):
    """Analog inputs with a sample clock, and a reference trigger on the hammer's signal.

    Parameters
    ----------
    options : TomlTable
        Has no keys.

    Raises
    ------
    ParameterError
        If it has any.
    """

    description: ClassVar[str] = "digitizers of National Instruments, by NI-DAQmx"
    example: ClassVar[str] = read_example("nidaqmx_source")

    def __init__(self, options: TomlTable) -> None:
        options.check_keys()
        super().__init__(options, "NI device")
        self._scales: dict[str, ChannelScale] = {}  # by the name of the virtual channel
        self._is_running = False

    def configure(self, plan: AcquisitionPlan) -> Acquisition:
        """Set a task up and reserve the device."""
        self._plan, self._is_running = plan, False
        self._subject = f"NI device {plan.hammer.name.partition('/')[0]}"
        with report_errors(self._subject):
            return self._configure(plan)

    def arm(self) -> None:
        """Start the task: its sample clock runs, and its trigger waits."""
        with report_errors(self._subject):
            self._begin = time.time_ns()  # since the epoch
            self._task.start()
        self._is_running = True

    def read(self, timeout: float) -> Block | None:
        """Return the next block."""
        if not self._is_running:
            return None
        with report_errors(self._subject):
            read = self._read_stream if self._plan.continuous else self._read_record
            return read(self._task, self._plan, timeout)

    def disarm(self) -> None:
        """Stop the task, and forget what was not read."""
        if self._is_running:
            self._is_running = False
            with report_errors(self._subject):
                self._task.stop()

    def check(self) -> None:
        """See that NI-DAQmx still knows the device; raises `DeviceError`."""
        with report_errors(self._subject):
            for channel in self._plan.channels:
                find_device(channel.name, "channel", channel.options)

    def _configure(self, plan: AcquisitionPlan) -> Acquisition:
        from nidaqmx import Task
        from nidaqmx.constants import OverwriteMode, TaskMode
        from nidaqmx.stream_readers import AnalogMultiChannelReader

        identity, is_simulated = _check_devices(plan.channels)
        self._task = task = Task()
        self._scales = {
            channel.sensor.channel: add_input(task, channel) for channel in plan.channels
        }
        self._rate = self._set_clock(task, plan)
        if plan.continuous:
            # A late reader loses samples, not the stream.
            task.in_stream.overwrite = OverwriteMode.OVERWRITE_UNREAD_SAMPLES
        else:
            self._set_trigger(task, plan)
        # NI-DAQmx reserves the device, and checks what it has not checked before.
        task.control(TaskMode.TASK_COMMIT)
        self._reader = AnalogMultiChannelReader(task.in_stream)
        # The array fits the task's channels: asking for them again costs two calls.
        self._reader.verify_array_shape = False
        return Acquisition(identity, self._rate, is_simulated)

    def _set_clock(self, task: Any, plan: AcquisitionPlan) -> float:
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
                f" nearest rate of the device is {rate:g} Hz",
            )
        return rate

    def _set_trigger(self, task: Any, plan: AcquisitionPlan) -> None:
        from nidaqmx.constants import WindowTriggerCondition1

        name = plan.hammer.sensor.channel
        hammer = self._scales[name]
        if plan.trigger_level >= hammer.full_scale:
            raise self._options.make_error(
                "trigger_level",
                f"trigger_level of {self._options.place} is {plan.trigger_level:g} m/s^2: the"
                f" hammer's channel shows {hammer.full_scale:g} m/s^2 at most",
            )
        level = plan.trigger_level / abs(hammer.scale)
        with report_errors("trigger", self._options, "trigger_level"):
            task.triggers.reference_trigger.cfg_anlg_window_ref_trig(
                name, level, -level, plan.pre_trigger_points,
                WindowTriggerCondition1.LEAVING_WINDOW,
            )  # fmt: skip

    def _read_record(self, task: Any, plan: AcquisitionPlan, timeout: float) -> Block | None:
        """Return the record; None if it is not complete in time [s]."""
        from nidaqmx.errors import DaqError

        try:
            task.wait_until_done(timeout)
        except DaqError as error:
            if error.error_type.name == NOT_DONE:
                return None
            raise
        # The record ended just now.
        stamp = time.time_ns() - round(plan.points / self._rate * 1e9)
        volts = self._read_volts(plan.points, 0.0)
        block = self._make_block(task, 0, volts, last=True, stamp=stamp)
        self.disarm()
        return block

    def _read_stream(self, task: Any, plan: AcquisitionPlan, timeout: float) -> Block | None:
        """Return the next samples; None if there are none in time [s]."""
        from nidaqmx.constants import ReadRelativeTo
        from nidaqmx.errors import DaqError

        stream = task.in_stream
        try:
            volts = self._read_volts(plan.block_size, timeout)
        except DaqError as error:
            if error.error_type.name != OVERWRITTEN:
                raise
            # Go on with the newest block.
            stream.relative_to = ReadRelativeTo.MOST_RECENT_SAMPLE
            stream.offset = -plan.block_size
            volts = self._read_volts(plan.block_size, 0.0)
            stream.relative_to = ReadRelativeTo.CURRENT_READ_POSITION
            stream.offset = 0
        if not volts.size:
            return None
        first = int(stream.curr_read_pos) - volts.shape[1]
        stamp = self._begin + round(first / self._rate * 1e9)
        return self._make_block(task, first, volts, last=False, stamp=stamp)

    def _read_volts(self, count: int, timeout: float) -> FloatArray:
        """Return samples, one row per channel; fewer if not all come in time [s]."""
        from nidaqmx.errors import DaqReadError

        volts = np.full((len(self._scales), count), np.nan)
        try:
            size = self._reader.read_many_sample(volts, count, timeout)
        except DaqReadError as error:
            if error.error_type.name != NOT_YET:
                raise
            size = error.samps_per_chan_read
        # Too few samples lie together at the beginning, channel by channel.
        taken = volts.ravel()[: len(self._scales) * size]
        return taken.reshape(len(self._scales), size)

    def _make_block(
        self, task: Any, first: int, volts: FloatArray, *, last: bool, stamp: int
    ) -> Block:
        overloaded = self._list_overloaded(task)
        channels = [
            scale.make_block(row, overloaded=name in overloaded)
            for (name, scale), row in zip(self._scales.items(), volts, strict=True)
        ]
        specimen = (*channels[1:], NOT_MEASURED)[0]
        return Block(first, self._rate, channels[0], specimen, last=last, stamp=stamp)

    def _list_overloaded(self, task: Any) -> list[str]:
        """Return the channels that the device says were overloaded since it was asked last."""
        from nidaqmx.errors import DaqError

        try:
            if task.in_stream.overloaded_chans_exist:
                return list(task.in_stream.overloaded_chans)
        except DaqError as error:
            if error.error_type.name != UNKNOWN_PROPERTY:
                raise
        return []


def _check_devices(channels: tuple[SourceChannel, ...]) -> tuple[str, bool]:
    """Require inputs that are sampled at once; return the devices, whether they are simulated."""
    identities, is_simulated = [], False
    for channel in channels:
        device = find_device(channel.name, "channel", channel.options)
        if len(channels) > 1 and not device.ai_simultaneous_sampling_supported:
            raise channel.options.make_error(
                "channel",
                f"{device.name} samples its inputs one after the other, but hammer and sample need"
                " the same moment: use another device, or remove [source.specimen]",
            )
        identities.append(f"{describe_device(device)}, {device.name}")
        is_simulated = is_simulated or device.is_simulated
    return " and ".join(dict.fromkeys(identities)), is_simulated


WRITE_TIME = 0.1  # [s], of the line itself


class NidaqmxHolder(NidaqmxDriver, CommandedHolder):
    """A line that drives what holds the hammer, by NI-DAQmx.

    The line keeps its level when the task ends. What it does while the computer starts is the
    line's power-up state, which is set once with NI's own tools.

    Parameters
    ----------
    options : TomlTable
        line, energized.

    Raises
    ------
    ParameterError
        If a key is unknown or lacks, or a value cannot be meant.
    """

    description: ClassVar[str] = "a digital output line of National Instruments, by NI-DAQmx"
    example: ClassVar[str] = read_example("nidaqmx_holder")

    def __init__(self, options: TomlTable) -> None:
        options.check_keys("line", "energized")
        self._line = options.take_text("line", REQUIRED, "Dev1/port0/line0")
        self._when_high = take_energized_state(options, HolderState.HOLDING)
        super().__init__(options, f"NI line {self._line}")

    def configure(self) -> str:
        """Take the line, and hold."""
        from nidaqmx import Task
        from nidaqmx.constants import LineGrouping
        from nidaqmx.stream_readers import DigitalSingleChannelReader
        from nidaqmx.stream_writers import DigitalSingleChannelWriter

        with report_errors(self._subject, self._options, "line"):
            device = find_device(self._line, "line", self._options)
            self._task = Task()
            self._task.do_channels.add_do_chan(
                self._line, line_grouping=LineGrouping.CHAN_PER_LINE
            )
        self._reader = DigitalSingleChannelReader(self._task.in_stream)
        self._writer = DigitalSingleChannelWriter(self._task.out_stream, auto_start=True)
        self.hold()
        return f"{describe_device(device)}, {self._line}"

    def read_state(self) -> HolderState:
        """Read the line back."""
        with report_errors(self._subject):
            is_high = bool(self._reader.read_one_sample_one_line(WRITE_TIME))
        if is_high is not (self.commanded is self._when_high):
            raise DeviceError(
                f"{self._subject} is {'high' if is_high else 'low'}, but the last command was"
                f" {self.commanded.value}"
            )
        return self.commanded

    def command(self, state: HolderState) -> None:
        """Bring the device into a state; raises `DeviceError` if it does not obey."""
        with report_errors(self._subject):
            self._writer.write_one_sample_one_line(state is self._when_high, WRITE_TIME)
        self.commanded = state
