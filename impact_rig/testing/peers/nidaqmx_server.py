"""A server that speaks the protocol of NI's gRPC device server, with a simulated device behind.

It is no NI software. It is written from the published protocol (`nidaqmx.proto`, as the Python
package `nidaqmx` carries it) and NI's manual, to try the drivers without NI's driver and without
a device. What it knows is what the drivers need: sessions that outlive a connection, reservation,
accelerometers, IEPE force sensors and voltages by their sensitivities, a 16-bit converter with
three ranges, a sample clock that is a whole part of 100 MHz, a reference trigger with pre-trigger
on the level of a channel, continuous acquisition with a buffer that overflows, overload, one
static output line for each task, and errors by NI's numbers. It does not simulate excitation and
coupling (both are checked or taken, without effect), triggers at a terminal, filters, the delay
of the converters, and noise of its own.
"""

# ruff: noqa: N802, the methods have the names of NI's calls
import math
import socket
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from impact_rig.devices.virtual.rig import VirtualHit

Volts = NDArray[np.float64]

NAME = "Dev1"
INPUTS = ("Dev1/ai0", "Dev1/ai1")
"""Where the hammer's and the sample's sensors are plugged in."""
LINES = tuple(f"Dev1/port0/line{number}" for number in range(8))
PRODUCT_TYPE = "virtual digitizer"
SERIAL_NUMBER = 0x01A2B3C4
RANGES = (1.0, 5.0, 10.0)
"""Of the inputs, either sign [V]."""
HIGHEST_RATE = 5e6
"""[Hz]"""
TIMEBASE = 100e6
"""Of which a sampling rate is a whole part [Hz]."""
BITS = 16
EXCITATIONS = (0.0, 0.0021, 0.004, 0.01)
"""IEPE currents that the inputs can drive [A]."""


class DaqmxError(Exception):
    """An error by NI-DAQmx's number, with NI-DAQmx's words."""

    def __init__(self, code: int, text: str) -> None:
        super().__init__(f"{text}\n\nStatus Code: {code}")
        self.code = code


@dataclass(frozen=True)
class Input:
    """An analog input channel of a task.

    Attributes
    ----------
    name, physical : str
        Of the virtual and of the physical channel.
    units_per_volt : float
        What the task's numbers are.
    limit : float
        Range of the converter, either sign [V].
    """

    name: str
    physical: str
    units_per_volt: float
    limit: float

    def convert(self, volts: Volts) -> Volts:
        """Return the numbers that the converter gives for some voltages."""
        step = self.limit / 2 ** (BITS - 1)
        counts = np.clip(np.round(volts / step), -(2 ** (BITS - 1)), 2 ** (BITS - 1) - 1)
        numbers: Volts = counts * step * self.units_per_volt
        return numbers

    def is_overloaded(self, volts: Volts) -> bool:
        """Return whether a voltage is beyond the range."""
        return bool(np.any(np.abs(volts) > self.limit))


@dataclass
class SimulatedDevice:
    """Inputs, output lines, and who has reserved them.

    Attributes
    ----------
    sensitivities : tuple of float
        Of the sensors on `INPUTS` [V per m/s^2].
    has_overload_detection : bool
        It can tell which channel was overloaded; many devices cannot.
    samples_at_once : bool
        Both inputs have converters of their own.
    on_level : callable
        Called with a line's name and its new level when that changes.
    levels, falls : dict
        Of the lines that were driven: their level, and how often each fell.
    """

    sensitivities: tuple[float, float]
    has_overload_detection: bool = True
    samples_at_once: bool = True
    on_level: Callable[[str, bool], None] | None = None
    is_present: bool = True
    tasks: "dict[str, SimulatedTask]" = field(default_factory=dict)
    levels: dict[str, bool] = field(default_factory=dict)
    falls: dict[str, int] = field(default_factory=dict)
    owners: "dict[str, SimulatedTask]" = field(default_factory=dict)
    changed: threading.Condition = field(default_factory=threading.Condition)

    def check_present(self) -> None:
        """Refuse to work while it is unplugged."""
        if not self.is_present:
            raise DaqmxError(
                -201003,
                "Device cannot be accessed.  Possible causes:\n\nDevice is no longer present in"
                f" the system.\nDevice is not powered.\n\nDevice Name: {NAME}",
            )

    def reserve(self, resource: str, task: "SimulatedTask") -> None:
        """Give a resource to a task, or refuse if another one has it."""
        if self.owners.setdefault(resource, task) is not task:
            raise DaqmxError(
                -50103,
                "The specified resource is reserved. The operation could not be completed as"
                f" specified.\n\nTask Name: {task.name}",
            )

    def drop(self, task: "SimulatedTask") -> None:
        """Forget a task, and what it had reserved."""
        self.tasks.pop(task.name, None)
        self.owners = {key: owner for key, owner in self.owners.items() if owner is not task}

    def set_level(self, line: str, *, level: bool) -> None:
        """Drive an output line."""
        with self.changed:
            before = self.levels.get(line, level)
            self.levels[line] = level
            if before and not level:
                self.falls[line] = self.falls.get(line, 0) + 1
        if before != level and self.on_level is not None:
            self.on_level(line, level)

    def set_present(self, *, present: bool) -> None:
        """Pull the device's own cable, or put it back; its tasks do not survive that."""
        with self.changed:
            self.is_present = present
            self.changed.notify_all()

    def feed(self, hit: "VirtualHit") -> None:
        """Strike: running tasks see the sensors' voltages from now on."""
        blocks = (hit.hammer, hit.specimen)
        volts = {
            physical: (block.output.astype(np.float64) * block.scale + block.offset) * sensitivity
            for physical, block, sensitivity in zip(
                INPUTS, blocks, self.sensitivities, strict=True
            )
        }
        with self.changed:
            for task in self.tasks.values():
                task.receive(volts, hit.sampling_rate)
            self.changed.notify_all()


FINITE = 10178
CONTINUOUS = 10123
CURRENT_READ_POSITION = 10425
MOST_RECENT_SAMPLE = 10428
OVERWRITE_UNREAD = 10252
"""Values of NI-DAQmx's attributes that a task knows."""
LEAST_BUFFERS = ((100.0, 1_000), (10e3, 10_000), (1e6, 100_000), (math.inf, 1_000_000))
"""Least buffer of a continuous task [samples per channel] up to a rate [Hz], by NI's manual."""
NOT_YET = -200284
"""Of a read whose samples do not come in time."""

Condition = Callable[[Volts], np.ndarray]
"""Which points of the trigger's channel lie beyond its level."""


@dataclass(frozen=True)
class Trigger:
    """The reference trigger: at the first point beyond a level behind one that is not.

    Attributes
    ----------
    source : str
        Name of a channel; a terminal never triggers by itself.
    pretrigger : int
        Samples before it.
    is_beyond : callable
        Which numbers of the source are beyond the level.
    """

    source: str
    pretrigger: int
    is_beyond: Condition


@dataclass(eq=False)
class SimulatedTask:
    """Channels, timing and state of one task; all calls hold `device.changed`."""

    name: str
    device: SimulatedDevice
    inputs: list[Input] = field(default_factory=list)
    line: str = ""
    rate: float = 1000.0
    mode: int = FINITE
    count: int = 1000
    trigger: Trigger | None = None
    overwrite: int = 10159
    relative_to: int = CURRENT_READ_POSITION
    offset: int = 0
    position: int = 0
    is_running: bool = False
    was_lost: bool = False
    _begin: float = 0.0
    _first: int | None = None
    _hits: list[tuple[int, dict[str, Volts]]] = field(default_factory=list)

    def set_clock(self, rate: float, mode: int, count: int) -> None:
        """Take sampling rate [Hz], mode and number of samples; the rate is what is possible."""
        if rate > HIGHEST_RATE:
            raise DaqmxError(
                -200332,
                "Specified sample rate is higher than the fastest rate supported by the"
                f" device.\n\nRequested Value: {rate}\nMaximum Value: {HIGHEST_RATE}",
            )
        self.rate = TIMEBASE / round(TIMEBASE / rate)
        self.mode = mode
        self.count = count

    def reserve(self) -> None:
        """Take what the task needs of the device."""
        self.device.check_present()
        self.device.reserve(self.line or "analog input", self)

    def start(self) -> None:
        """Let the sample clock run from point 0."""
        self.reserve()
        self.is_running = True
        self.position = 0
        self._begin = time.monotonic()
        self._first = 0 if self.trigger is None else None
        self._hits = []

    def stop(self) -> None:
        """Stop; what was not read is lost."""
        self.is_running = False
        self._first = None
        self.device.changed.notify_all()

    def check_usable(self) -> None:
        """Refuse to work with a device that is gone, or was meanwhile."""
        self.was_lost |= not self.device.is_present
        if self.was_lost:
            raise DaqmxError(
                -50405,
                "No transfer is in progress because the transfer was aborted by the client. The"
                f" operation could not be completed as specified.\n\nTask Name: {self.name}",
            )

    def receive(self, volts: Mapping[str, Volts], sampling_rate: float) -> None:
        """See a hit, its voltages at its own rate; a trigger waits for its pre-trigger first."""
        if not self.is_running:
            return
        resampled = {name: _resample(v, sampling_rate, self.rate) for name, v in volts.items()}
        size = max(values.size for values in resampled.values())
        begin = self._count_now()
        if self.trigger is not None and self._first is None:
            begin = max(begin, self.trigger.pretrigger)
            self._hits = [(begin, resampled)]
            self._find_trigger(self.trigger, begin, size)
        else:
            self._hits.append((begin, resampled))

    def compute_end(self) -> float:
        """Return when all samples will be there, by the monotonic clock [s]; inf: not known."""
        if not self.is_running or self._first is None or self.mode == CONTINUOUS:
            return math.inf
        return self._begin + (self._first + self.count) / self.rate

    def is_done(self) -> bool:
        """Return whether all samples are there."""
        return time.monotonic() >= self.compute_end()

    def read(self, count: int, *, is_late: bool) -> tuple[int, Volts] | None:
        """Return status and samples, one row per channel; None: wait for more.

        Parameters
        ----------
        count : int
            Samples per channel.
        is_late : bool
            Do not wait: return what there is.
        """
        if self.mode == FINITE:
            if not self.is_done():
                return (NOT_YET, self._sample(0, 0)) if is_late else None
            first = self._first or 0
            begin, end = first + self.position, first + min(self.position + count, self.count)
        else:
            begin = self._compute_start()
            end = min(begin + count, self._count_now())
            if end - begin < count and not is_late:
                return None
        self.position = end - (self._first or 0)
        return (0 if end - begin == count else NOT_YET), self._sample(begin, end)

    def list_overloaded(self) -> list[str]:
        """Return the names of the channels whose voltage was beyond the range."""
        return [
            channel.name
            for channel in self.inputs
            if any(channel.is_overloaded(volts[channel.physical]) for _, volts in self._hits)
        ]

    def _compute_start(self) -> int:
        """Return where a continuous task's next read begins; an error if that is overwritten."""
        now = self._count_now()
        least = next(size for limit, size in LEAST_BUFFERS if self.rate <= limit)
        begin = self.position + self.offset
        if self.relative_to == MOST_RECENT_SAMPLE:
            begin = max(0, now + self.offset)
        if now - begin > max(self.count, least):
            if self.overwrite != OVERWRITE_UNREAD:
                self.stop()
            raise DaqmxError(
                -200279,
                "The application is not able to keep up with the hardware acquisition.\n\n"
                "Increasing the buffer size, reading the data more frequently, or specifying a"
                " fixed number of samples to read instead of reading all available samples might"
                f" correct the problem.\n\nTask Name: {self.name}",
            )
        return begin

    def _count_now(self) -> int:
        return math.ceil((time.monotonic() - self._begin) * self.rate)

    def _find_trigger(self, trigger: Trigger, begin: int, size: int) -> None:
        source = [channel for channel in self.inputs if channel.name == trigger.source]
        if not source:
            return
        numbers = self._convert(source[0], begin - 1, begin + size)
        beyond = trigger.is_beyond(numbers)
        crossings = np.flatnonzero(beyond[1:] & ~beyond[:-1])
        if crossings.size:
            self._first = begin + int(crossings[0]) - trigger.pretrigger

    def _sample(self, begin: int, end: int) -> Volts:
        return np.array([self._convert(channel, begin, end) for channel in self.inputs])

    def _convert(self, channel: Input, begin: int, end: int) -> Volts:
        volts = np.zeros(end - begin)
        for start, hit in self._hits:
            values = hit[channel.physical]
            low, high = max(begin, start), min(end, start + values.size)
            if low < high:
                volts[low - begin : high - begin] += values[low - start : high - start]
        return channel.convert(volts)


def _resample(values: Volts, before: float, after: float) -> Volts:
    """Return a trace at another rate [Hz]."""
    if math.isclose(before, after, rel_tol=1e-9):
        return values
    size = int(values.size * after / before)
    resampled: Volts = np.interp(np.arange(size) / after, np.arange(values.size) / before, values)
    return resampled


Fields = dict[str, Any]
"""Of the answer to a call."""


TASK_PROPERTIES: dict[str, dict[str, Callable[[SimulatedTask], Any]]] = {
    "GetTaskAttributeString": {
        "NAME": lambda task: task.name,
        "CHANNELS": lambda task: ", ".join(channel.name for channel in task.inputs),
    },
    "GetTaskAttributeUInt32": {"NUM_CHANS": lambda task: len(task.inputs) + bool(task.line)},
    "GetTimingAttributeDouble": {"SAMP_CLK_RATE": lambda task: task.rate},
    "GetReadAttributeBool": {"OVERLOADED_CHANS_EXIST": lambda task: bool(task.list_overloaded())},
    "GetReadAttributeString": {"OVERLOADED_CHANS": lambda task: ", ".join(task.list_overloaded())},
    "GetReadAttributeUInt64": {"CURR_READ_POS": lambda task: task.position},
}
DEVICE_PROPERTIES: dict[str, dict[str, Callable[[SimulatedDevice], Any]]] = {
    "GetDeviceAttributeString": {
        "PRODUCT_TYPE": lambda _: PRODUCT_TYPE,
        "AI_PHYSICAL_CHANS": lambda _: ", ".join(INPUTS),
        "DO_LINES": lambda _: ", ".join(LINES),
    },
    "GetDeviceAttributeUInt32": {"SERIAL_NUM": lambda _: SERIAL_NUMBER},
    "GetDeviceAttributeBool": {
        "IS_SIMULATED": lambda _: True,
        "AI_SIMULTANEOUS_SAMPLING_SUPPORTED": lambda device: device.samples_at_once,
    },
}
"""What can be asked, by the calls that ask it and NI's names of the properties."""


def _choose(request: Any, values: Mapping[str, Any]) -> Any:
    """Return what belongs to the property that is asked for, by NI's name of it."""
    number = getattr(request, request.WhichOneof("attribute_enum"))
    known = request.DESCRIPTOR.fields_by_name["attribute"].enum_type.values_by_number
    name = known[number].name.partition("_ATTRIBUTE_")[2] if number in known else f"{number:#x}"
    if name not in values:
        raise DaqmxError(
            -200452,
            "Specified property is not supported by the device or is not applicable to the"
            f" task.\n\nProperty: {name}",
        )
    return values[name]


STANDARD_GRAVITY = 9.80665
"""[m/s^2]"""
POUND = 4.4482216152605
"""[N]"""
METERS_PER_SECOND_SQUARED = 12470
NEWTONS = 15875
RISING, LEAVING_WINDOW, VOLTS = 10280, 10208, 10348
STOP, COMMIT, ABORT = 1, 3, 6
"""NI's numbers of units, trigger conditions and actions."""
ACCELERATION_SENSITIVITIES = {12509: 1e-3 / STANDARD_GRAVITY, 12510: 1.0 / STANDARD_GRAVITY}
FORCE_SENSITIVITIES = {15891: 1e-3, 15892: 1e-3 / POUND}
"""Voltage for 1 m/s^2 or 1 N of NI's units of sensitivity [V]."""


class DaqmxService:
    """NI-DAQmx with one device."""

    def __init__(self, device: SimulatedDevice) -> None:
        self.device = device

    def find_call(self, name: str) -> Callable[[Any], Fields] | None:
        """Return what answers a call; None: it is not simulated."""
        if name in TASK_PROPERTIES:
            return lambda request: self._tell_of_task(request, TASK_PROPERTIES[name])
        if name in DEVICE_PROPERTIES:
            return lambda request: self._tell_of_device(request, DEVICE_PROPERTIES[name])
        call: Callable[[Any], Fields] | None = getattr(self, name, None)
        return call

    def _tell_of_task(self, request: Any, known: Mapping[str, Callable[[Any], Any]]) -> Fields:
        task = self._find_task(request)
        if "OVERLOADED_CHANS_EXIST" in known and not self.device.has_overload_detection:
            known = {}
        return {"value": _choose(request, known)(task)}

    def _tell_of_device(self, request: Any, known: Mapping[str, Callable[[Any], Any]]) -> Fields:
        name = request.device_name
        if name != NAME or not self.device.is_present:
            raise DaqmxError(-200220, f"Device identifier is invalid.\n\nDevice Specified: {name}")
        return {"value": _choose(request, known)(self.device)}

    def GetSystemInfoAttributeString(self, request: Any) -> Fields:
        """Return the names of the devices."""
        return {"value": _choose(request, {"DEV_NAMES": NAME if self.device.is_present else ""})}

    def GetChanAttributeDouble(self, request: Any) -> Fields:
        """Return the upper end of a channel's range."""
        channels = {channel.name: channel for channel in self._find_task(request).inputs}
        return {"value": _choose(request, {"AI_RNG_HIGH": channels[request.channel].limit})}

    def SetChanAttributeInt32(self, request: Any) -> Fields:
        """Take the coupling, which makes no difference here."""
        _choose(request, {"AI_COUPLING": None})
        return {}

    def SetReadAttributeInt32(self, request: Any) -> Fields:
        """Take where reads begin, and whether unread samples are overwritten."""
        names = {"RELATIVE_TO": "relative_to", "OFFSET": "offset", "OVERWRITE": "overwrite"}
        value = getattr(request, request.WhichOneof("value_enum"))
        setattr(self._find_task(request), _choose(request, names), value)
        return {}

    def _find_task(self, request: Any) -> SimulatedTask:
        """Return the task that a call is for."""
        try:
            return self.device.tasks[request.task.name]
        except KeyError:
            raise DaqmxError(-200088, "Task specified is invalid or does not exist.") from None

    def CreateTask(self, request: Any) -> Fields:
        """Begin a session, or attach to one that a lost connection left behind."""
        name = request.session_name or f"_unnamedTask<{time.monotonic_ns():X}>"
        is_known = name in self.device.tasks
        if not is_known:
            self.device.tasks[name] = SimulatedTask(name, self.device)
        return {"task": {"name": name}, "new_session_initialized": not is_known}

    def ClearTask(self, request: Any) -> Fields:
        """End a session."""
        self.device.drop(self._find_task(request))
        return {}

    def CreateAIAccelChan(self, request: Any) -> Fields:
        """Add an accelerometer."""
        unit = ACCELERATION_SENSITIVITIES[request.sensitivity_units_raw]
        _require("AI.Accel.Units", request.units_raw, (METERS_PER_SECOND_SQUARED,))
        return self._add_sensor(request, request.sensitivity * unit)

    def CreateAIForceIEPEChan(self, request: Any) -> Fields:
        """Add a force sensor."""
        unit = FORCE_SENSITIVITIES[request.sensitivity_units_raw]
        _require("AI.Force.Units", request.units_raw, (NEWTONS,))
        return self._add_sensor(request, request.sensitivity * unit)

    def CreateAIVoltageChan(self, request: Any) -> Fields:
        """Add a voltage."""
        _require("AI.Voltage.Units", request.units_raw, (VOLTS,))
        return self._add_input(request, 1.0)

    def CreateDOChan(self, request: Any) -> Fields:
        """Add an output line."""
        if request.lines not in LINES:
            raise _make_unknown(request.lines)
        self._find_task(request).line = request.lines
        return {}

    def CfgSampClkTiming(self, request: Any) -> Fields:
        """Set rate and length."""
        task = self._find_task(request)
        task.set_clock(request.rate, request.sample_mode_raw, request.samps_per_chan)
        return {}

    def CfgAnlgEdgeRefTrig(self, request: Any) -> Fields:
        """Trigger where a channel crosses a level one way."""
        level, sign = request.trigger_level, 1 if request.trigger_slope_raw == RISING else -1
        return self._set_trigger(request, lambda numbers: sign * numbers >= sign * level)

    def CfgAnlgWindowRefTrig(self, request: Any) -> Fields:
        """Trigger where a channel leaves a window."""
        _require("RefTrig.AnlgWin.TrigWhen", request.trigger_when_raw, (LEAVING_WINDOW,))
        low, high = request.window_bottom, request.window_top
        return self._set_trigger(request, lambda numbers: (numbers > high) | (numbers < low))

    def CfgDigEdgeRefTrig(self, request: Any) -> Fields:
        """Trigger by a terminal: here nothing is connected to it."""
        return self._set_trigger(request, lambda numbers: np.zeros(numbers.shape, dtype=bool))

    def TaskControl(self, request: Any) -> Fields:
        """Reserve what the task needs, or stop it."""
        task = self._find_task(request)
        if request.action_raw == COMMIT:
            task.reserve()
        elif request.action_raw in {STOP, ABORT}:
            task.stop()
        return {}

    def StartTask(self, request: Any) -> Fields:
        """Start the sample clock."""
        self._find_usable(request).start()
        return {}

    def StopTask(self, request: Any) -> Fields:
        """Stop it."""
        self._find_usable(request).stop()
        return {}

    def WaitUntilTaskDone(self, request: Any) -> Fields:
        """Wait for the end of a finite acquisition."""
        task = self._find_task(request)
        if not self._wait(task, request.time_to_wait, task.is_done):
            raise DaqmxError(
                -200560,
                "Wait Until Done did not indicate that the task was done within the specified"
                f" timeout.\n\nTask Name: {task.name}",
            )
        return {}

    def ReadAnalogF64(self, request: Any) -> Fields:
        """Read samples, grouped by channel; too few are told in the answer's status."""
        task = self._find_usable(request)
        found: list[Any] = []

        def read() -> bool:
            found[:] = [task.read(request.num_samps_per_chan, is_late=False)]
            return found[0] is not None

        if not self._wait(task, request.timeout, read):
            found[:] = [task.read(request.num_samps_per_chan, is_late=True)]
        status, samples = found[0]
        return {
            "status": status,
            "read_array": samples.ravel(),
            "samps_per_chan_read": samples.shape[1],
        }

    def WriteDigitalLines(self, request: Any) -> Fields:
        """Drive the task's line."""
        task = self._find_usable(request)
        task.reserve()
        self.device.set_level(task.line, level=bool(request.write_array[0]))
        return {"samps_per_chan_written": 1}

    def ReadDigitalLines(self, request: Any) -> Fields:
        """Read the task's line back."""
        level = self.device.levels.get(self._find_usable(request).line, False)
        return {"read_array": bytes([level]), "samps_per_chan_read": 1, "num_bytes_per_samp": 1}

    def _find_usable(self, request: Any) -> SimulatedTask:
        task = self._find_task(request)
        task.check_usable()
        return task

    def _wait(self, task: SimulatedTask, timeout: float, is_ready: Callable[[], bool]) -> bool:
        """Wait until something is so; False: it did not come in time."""
        deadline = time.monotonic() + timeout
        while True:
            task.check_usable()
            if is_ready():
                return True
            now = time.monotonic()
            if now >= deadline:
                return False
            pause = 1e-3 if task.mode != FINITE else task.compute_end() - now
            self.device.changed.wait(max(1e-4, min(deadline - now, pause, 1.0)))

    def _add_sensor(self, request: Any, volts: float) -> Fields:
        _require("AI.Excit.Val", request.current_excit_val, EXCITATIONS)
        return self._add_input(request, 1.0 / volts)

    def _add_input(self, request: Any, units_per_volt: float) -> Fields:
        if request.physical_channel not in INPUTS:
            raise _make_unknown(request.physical_channel)
        wanted = max(abs(request.min_val), abs(request.max_val)) / units_per_volt
        # A part in a billion beyond a range is rounding.
        fitting = [limit for limit in RANGES if limit >= wanted * (1 - 1e-9)]
        if not fitting:
            raise _make_refusal("AI.Max", request.max_val, f"{RANGES[-1] * units_per_volt}")
        name = request.name_to_assign_to_channel or request.physical_channel
        self._find_task(request).inputs.append(
            Input(name, request.physical_channel, units_per_volt, fitting[0])
        )
        return {}

    def _set_trigger(self, request: Any, is_beyond: Callable[[Any], Any]) -> Fields:
        task = self._find_task(request)
        task.trigger = Trigger(request.trigger_source, request.pretrigger_samples, is_beyond)
        return {}


def _require(what: str, value: Any, known: tuple[Any, ...]) -> None:
    if value not in known:
        raise _make_refusal(what, value, ", ".join(str(item) for item in known))


def _make_refusal(what: str, value: Any, possible: str) -> DaqmxError:
    return DaqmxError(
        -200077,
        "Requested value is not a supported value for this property. The property value may be"
        f" invalid because it conflicts with another property.\n\nProperty: {what}\n"
        f"Requested Value: {value}\nYou Can Select: {possible}",
    )


def _make_unknown(name: str) -> DaqmxError:
    return DaqmxError(
        -200170,
        "Physical channel specified does not exist on this device.\n\nRefer to the documentation"
        f" for channels available on this device.\n\nPhysical Channel Name: {name}",
    )


HOST = "127.0.0.1"
WORKERS = 4
"""Calls at one time."""


class NidaqmxServer:
    """The server, in threads of this process.

    Parameters
    ----------
    hammer_sensitivity, specimen_sensitivity : float
        Of the sensors that are plugged in [V per m/s^2], signed.

    Attributes
    ----------
    device : SimulatedDevice
        Behind the server.
    errors : dict
        Calls that fail: their names, and the number of the error.
    silent : set of str
        Calls that are never answered and do nothing, by their names.
    spoiled : dict
        Calls whose answers are changed: their names, and what to make of the answer's fields.
    calls : list of str
        Names of all calls so far.
    """

    def __init__(self, hammer_sensitivity: float, specimen_sensitivity: float) -> None:
        self.device = SimulatedDevice((hammer_sensitivity, specimen_sensitivity))
        self.errors: dict[str, int] = {}
        self.silent: set[str] = set()
        self.spoiled: dict[str, Callable[[Fields], Fields]] = {}
        self.calls: list[str] = []
        self._service = DaqmxService(self.device)
        self._unplugged = threading.Event()
        # A socket that never listens keeps the port ours while the server is away.
        self._place = socket.socket()
        self._server: Any = None

    def __enter__(self) -> Self:
        """Take a free port of this computer, and listen."""
        self._place.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        self._place.bind((HOST, 0))
        self.plug()
        return self

    def __exit__(self, *_: object) -> None:
        """Close everything."""
        self.unplug()
        self._place.close()

    @property
    def address(self) -> str:
        """Where it listens, or did: "host:port"."""
        return f"{HOST}:{self._place.getsockname()[1]}"

    def feed(self, hit: "VirtualHit") -> None:
        """Let the hammer strike now."""
        self.device.feed(hit)

    def plug(self) -> None:
        """Listen again on the same port; sessions are as they were."""
        import grpc

        self._unplugged.clear()
        self._server = grpc.server(ThreadPoolExecutor(WORKERS), options=[("grpc.so_reuseport", 1)])
        self._server.add_generic_rpc_handlers((self._make_handlers(),))
        self._server.add_insecure_port(self.address)
        self._server.start()

    def unplug(self) -> None:
        """Close the port and all connections, as if the network cable was pulled."""
        self._unplugged.set()
        with self.device.changed:
            self.device.changed.notify_all()
        if self._server is not None:
            self._server.stop(0).wait()
            self._server = None

    def _make_handlers(self) -> Any:
        """Return a handler for each method of the service."""
        import grpc
        from google.protobuf.message_factory import (  # type: ignore[import-untyped]
            GetMessageClass,
        )
        from nidaqmx._stubs import nidaqmx_pb2

        description = nidaqmx_pb2.DESCRIPTOR.services_by_name["NiDAQmx"]
        handlers = {
            method.name: grpc.unary_unary_rpc_method_handler(
                self._make_behavior(method.name, call, GetMessageClass(method.output_type)),
                request_deserializer=GetMessageClass(method.input_type).FromString,
                response_serializer=GetMessageClass(method.output_type).SerializeToString,
            )
            for method in description.methods
            if (call := self._service.find_call(method.name))
        }
        return grpc.method_handlers_generic_handler(description.full_name, handlers)

    def _make_behavior(
        self, name: str, call: Callable[[Any], Fields], answer: Any
    ) -> Callable[[Any, Any], Any]:
        """Return what the server does when a method is called."""
        import grpc

        def behave(request: Any, context: Any) -> Any:
            self.calls.append(name)
            if name in self.silent:
                self._stay_silent(context)
                context.abort(grpc.StatusCode.CANCELLED, "nobody waits for this any more")
            try:
                if name in self.errors:
                    raise DaqmxError(self.errors[name], "It fails because a test wants it.")
                with self.device.changed:
                    fields = call(request)
                return answer(**self.spoiled.get(name, dict)(fields))
            except DaqmxError as error:
                # As NI's server tells an error: its number in the trailing metadata.
                context.set_trailing_metadata((("ni-error", str(error.code)),))
                context.abort(grpc.StatusCode.UNKNOWN, str(error))

        return behave

    def _stay_silent(self, context: Any) -> None:
        """Return when the caller has given up, or the server is unplugged."""
        given_up = threading.Event()
        context.add_callback(given_up.set)
        while not given_up.wait(0.01) and not self._unplugged.is_set():
            pass
