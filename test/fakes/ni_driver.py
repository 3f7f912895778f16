"""National Instruments' driver at the boundary of its Python library `nidaqmx`, with one device.

It stands where NI's driver would: all of `nidaqmx` above it is NI's own. It is written from that
library and NI's manual, and knows what the drivers need: reservation, accelerometers and voltages,
a 16-bit converter with three ranges, a sample clock that is a whole part of 100 MHz, a reference
trigger on the level of a channel, continuous acquisition with a buffer that overflows, overload,
one static output line for each task, and errors by NI's numbers. Excitation, coupling, filters,
delays and noise are not simulated.
"""

import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from nidaqmx.errors import DaqError, DaqReadError
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


@dataclass(frozen=True)
class Input:
    """An analog input channel of a task, whose numbers are volts."""

    name: str  # of the virtual channel
    physical: str
    limit: float  # [V], of the converter, either sign

    def convert(self, volts: Volts) -> Volts:
        """Return what the converter gives for some voltages."""
        step = self.limit / 2 ** (BITS - 1)
        counts = np.clip(np.round(volts / step), -(2 ** (BITS - 1)), 2 ** (BITS - 1) - 1)
        converted: Volts = counts * step
        return converted

    def is_overloaded(self, volts: Volts) -> bool:
        """Return whether a voltage is beyond the range."""
        return bool(np.any(np.abs(volts) > self.limit))


@dataclass
class SimulatedDevice:
    """Inputs, output lines, and who has reserved them."""

    sensitivities: tuple[float, float]  # [V per m/s^2], of the sensors on `INPUTS`
    has_overload_detection: bool = True  # many devices have none
    samples_at_once: bool = True  # each input has its own converter
    is_present: bool = True
    tasks: "dict[str, SimulatedTask]" = field(default_factory=dict)
    levels: dict[str, bool] = field(default_factory=dict)  # of the lines that were driven
    falls: dict[str, int] = field(default_factory=dict)  # how often each of them fell
    owners: "dict[str, SimulatedTask]" = field(default_factory=dict)
    changed: threading.Condition = field(default_factory=threading.Condition)

    def check_present(self) -> None:
        """Refuse to work while it is unplugged."""
        if not self.is_present:
            raise DaqError(
                "Device cannot be accessed.  Possible causes:\n\nDevice is no longer present in"
                f" the system.\nDevice is not powered.\n\nDevice Name: {NAME}",
                -201003,
            )

    def reserve(self, resource: str, task: "SimulatedTask") -> None:
        """Give a resource to a task, or refuse if another one has it."""
        if self.owners.setdefault(resource, task) is not task:
            raise DaqError(
                "The specified resource is reserved. The operation could not be completed as"
                f" specified.\n\nTask Name: {task.name}",
                -50103,
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
NOT_YET = -200284
"""Of a read whose samples do not come in time."""


@dataclass(frozen=True)
class Trigger:
    """The reference trigger: at the first point beyond a level behind one that is not."""

    source: str  # name of a channel
    pretrigger: int  # samples before it
    level: float  # [V], either sign


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
            raise DaqError(
                "Specified sample rate is higher than the fastest rate supported by the"
                f" device.\n\nRequested Value: {rate}\nMaximum Value: {HIGHEST_RATE}",
                -200332,
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
            raise DaqError(
                "No transfer is in progress because the transfer was aborted by the client. The"
                f" operation could not be completed as specified.\n\nTask Name: {self.name}",
                -50405,
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
        begin = self.position + self.offset
        if self.relative_to == MOST_RECENT_SAMPLE:
            begin = max(0, now + self.offset)
        if now - begin > self.count:
            if self.overwrite != OVERWRITE_UNREAD:
                self.stop()
            raise DaqError(
                "The application is not able to keep up with the hardware acquisition.\n\n"
                "Increasing the buffer size, reading the data more frequently, or specifying a"
                " fixed number of samples to read instead of reading all available samples might"
                f" correct the problem.\n\nTask Name: {self.name}",
                -200279,
            )
        return begin

    def _count_now(self) -> int:
        return math.ceil((time.monotonic() - self._begin) * self.rate)

    def _find_trigger(self, trigger: Trigger, begin: int, size: int) -> None:
        source = next(channel for channel in self.inputs if channel.name == trigger.source)
        beyond = np.abs(self._convert(source, begin - 1, begin + size)) > trigger.level
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


LEAVING_WINDOW = 10208
ACCELERATION_UNITS = (10186, 1000.0, 12509)  # g, of 1000 mV/g
STOP, COMMIT, ABORT = 1, 3, 6
"""NI's numbers of trigger conditions, units and actions."""
UNKNOWN_PROPERTY = -200452


class FakeDriver:
    """NI-DAQmx with one device, with the calls of `nidaqmx`; a task's handle is its name.

    `errors` names the calls that fail, with the number of the error.
    """

    def __init__(self, hammer_sensitivity: float, specimen_sensitivity: float) -> None:
        self.device = SimulatedDevice((hammer_sensitivity, specimen_sensitivity))
        self.errors: dict[str, int] = {}
        self._count = 0

    def feed(self, hit: "VirtualHit") -> None:
        """Let the hammer strike now."""
        self.device.feed(hit)

    def get_system_info_attribute_string(self, attribute: int) -> str:
        return {0x193B: NAME if self.device.is_present else ""}[attribute]

    def get_device_attribute_string(self, name: str, attribute: int) -> str:
        self._check_device(name)
        return {
            0x631: PRODUCT_TYPE, 0x231E: ", ".join(INPUTS), 0x2322: ", ".join(LINES)
        }[attribute]  # fmt: skip

    def get_device_attribute_uint32(self, name: str, attribute: int) -> int:
        self._check_device(name)
        return {0x632: SERIAL_NUMBER}[attribute]

    def get_device_attribute_bool(self, name: str, attribute: int) -> bool:
        self._check_device(name)
        return {0x22CA: True, 0x298F: self.device.samples_at_once}[attribute]

    def _check_device(self, name: str) -> None:
        if name != NAME or not self.device.is_present:
            raise DaqError(f"Device identifier is invalid.\n\nDevice Specified: {name}", -200220)

    def create_task(self, _: str) -> tuple[str, bool]:
        self._count += 1
        name = f"task {self._count}"
        self.device.tasks[name] = SimulatedTask(name, self.device)
        return name, True

    def clear_task(self, task: str) -> None:
        self.device.drop(self._find_task(task))

    def get_task_attribute_string(self, task: str, attribute: int) -> str:
        inputs = ", ".join(channel.name for channel in self._find_task(task).inputs)
        return {0x1276: task, 0x1273: inputs}[attribute]

    def get_task_attribute_uint32(self, task: str, attribute: int) -> int:
        found = self._find_task(task)
        return {0x2181: len(found.inputs) + bool(found.line)}[attribute]

    def get_timing_attribute_double(self, task: str, attribute: int) -> float:
        return {0x1344: self._find_task(task).rate}[attribute]

    def get_read_attribute_bool(self, task: str, attribute: int) -> bool:
        if not self.device.has_overload_detection:
            raise DaqError("Specified property is not supported by the device.", UNKNOWN_PROPERTY)
        return {0x2174: bool(self._find_task(task).list_overloaded())}[attribute]

    def get_read_attribute_string(self, task: str, attribute: int, _size: int = 0) -> str:
        return {0x2175: ", ".join(self._find_task(task).list_overloaded())}[attribute]

    def get_read_attribute_uint64(self, task: str, attribute: int) -> int:
        return {0x1221: self._find_task(task).position}[attribute]

    def set_read_attribute_int32(self, task: str, attribute: int, value: int) -> None:
        names = {0x190A: "relative_to", 0x190B: "offset", 0x1211: "overwrite"}
        setattr(self._find_task(task), names[attribute], value)

    def get_chan_attribute_double(self, task: str, channel: str, attribute: int) -> float:
        channels = {item.name: item for item in self._find_task(task).inputs}
        return {0x1815: channels[channel].limit}[attribute]

    def set_chan_attribute_int32(self, *_: Any) -> None:
        """Take the coupling, which makes no difference here."""

    def create_ai_accel_chan(
        self, task: str, physical: str, name: str, _terminal: int, low: float, high: float,
        units: int, sensitivity: float, sensitivity_units: int, _source: int, current: float,
        _scale: str,
    ) -> None:  # fmt: skip
        assert (units, sensitivity, sensitivity_units) == ACCELERATION_UNITS
        self._add_input(task, physical, name, (low, high), current)

    def create_ai_voltage_chan(
        self, task: str, physical: str, name: str, _terminal: int, low: float, high: float,
        _units: int, _scale: str,
    ) -> None:  # fmt: skip
        self._add_input(task, physical, name, (low, high), 0.0)

    def create_do_chan(self, task: str, line: str, _name: str, _grouping: int) -> None:
        self._find_task(task).line = line

    def cfg_samp_clk_timing(
        self, task: str, rate: float, _source: str, _edge: int, mode: int, count: int
    ) -> None:
        self._find_task(task).set_clock(rate, mode, count)

    def cfg_anlg_window_ref_trig(
        self, task: str, source: str, top: float, bottom: float, pretrigger: int, when: int
    ) -> None:
        assert when == LEAVING_WINDOW
        assert top == -bottom
        self._find_task(task).trigger = Trigger(source, pretrigger, top)

    def task_control(self, task: str, action: int) -> None:
        if action == COMMIT:
            self._find_task(task).reserve()
        elif action in {STOP, ABORT}:
            self._find_task(task).stop()

    def start_task(self, task: str) -> None:
        self._find_usable(task).start()

    def stop_task(self, task: str) -> None:
        self._find_usable(task).stop()

    def wait_until_task_done(self, task: str, time_to_wait: float) -> None:
        found = self._find_task(task)
        if not self._wait(found, time_to_wait, found.is_done):
            raise DaqError("Wait Until Done did not indicate that the task was done.", -200560)

    def read_analog_f64(
        self, task: str, count: int, timeout: float, _mode: int, array: Volts
    ) -> tuple[Volts, int]:
        found = self._find_usable(task)
        answers: list[Any] = []

        def read() -> bool:
            answers[:] = [found.read(count, is_late=False)]
            return answers[0] is not None

        if not self._wait(found, timeout, read):
            answers[:] = [found.read(count, is_late=True)]
        status, samples = answers[0]
        array.ravel()[: samples.size] = samples.ravel()
        if status:
            raise DaqReadError(
                "Some of the samples are not yet available.", status, samples.shape[1]
            )
        return array, samples.shape[1]

    def write_digital_lines(
        self, task: str, _count: int, _start: bool, _timeout: float, _layout: int, array: Any
    ) -> int:
        found = self._find_usable(task)
        found.reserve()
        self.device.set_level(found.line, level=bool(array[0]))
        return 1

    def read_digital_lines(
        self, task: str, _count: int, _timeout: float, _mode: int, array: Any
    ) -> tuple[Any, int, int]:
        array[0] = self.device.levels.get(self._find_usable(task).line, False)
        return array, 1, 1

    def _find_task(self, task: str) -> SimulatedTask:
        if task not in self.device.tasks:
            raise DaqError("Task specified is invalid or does not exist.", -200088)
        return self.device.tasks[task]

    def _find_usable(self, task: str) -> SimulatedTask:
        found = self._find_task(task)
        found.check_usable()
        return found

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

    def _add_input(
        self, task: str, physical: str, name: str, limits: tuple[float, float], current: float
    ) -> None:
        if current not in EXCITATIONS:
            raise _make_refusal("AI.Excit.Val", current)
        wanted = max(map(abs, limits))
        # A part in a billion beyond a range is rounding.
        fitting = [limit for limit in RANGES if limit >= wanted * (1 - 1e-9)]
        if not fitting:
            raise _make_refusal("AI.Max", limits[1])
        self._find_task(task).inputs.append(Input(name, physical, fitting[0]))


def _make_refusal(what: str, value: Any) -> DaqError:
    return DaqError(
        "Requested value is not a supported value for this property.\n\n"
        f"Property: {what}\nRequested Value: {value}",
        -200077,
    )


class Interpreter:
    """What `nidaqmx` calls: one call at a time, which fails if a test says so."""

    def __init__(self, driver: FakeDriver) -> None:
        self._driver = driver

    def __getattr__(self, name: str) -> Callable[..., Any]:
        """Return a call."""

        def call(*arguments: Any) -> Any:
            if name in self._driver.errors:
                raise DaqError("It fails because a test wants it.", self._driver.errors[name])
            with self._driver.device.changed:
                return getattr(self._driver, name)(*arguments)

        return call
