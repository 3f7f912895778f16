"""National Instruments' driver at the boundary of its Python library `nidaqmx`, with one device.

It stands where NI's driver would: all of `nidaqmx` above it is NI's own. It is written from that
library and NI's manual, and knows what the drivers need: reservation, accelerometers and voltages,
a 16-bit converter with every range, a sample clock that is a whole part of 100 MHz, a reference
trigger on the level of a channel, continuous acquisition with a buffer that overflows, overload,
one static output line, and errors by NI's numbers. A record is complete as soon as its hit is fed.
Excitation, coupling, filters, delays and noise are not simulated.
"""

import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import numpy as np
from nidaqmx.errors import DaqError, DaqReadError
from numpy.typing import NDArray

from impact_rig.devices.virtual.rig import VirtualHit

Volts = NDArray[np.float64]

NAME = "Dev1"
INPUTS = ("Dev1/ai0", "Dev1/ai1")  # of the hammer's and the sample's sensors
LINE = "Dev1/port0/line0"
HIGHEST_RATE = 5e6  # [Hz]
TIMEBASE = 100e6  # [Hz], of which a sampling rate is a whole part
LARGEST = 2**15  # counts of the converter, either sign

# NI's numbers.
CONTINUOUS = 10123
MOST_RECENT_SAMPLE = 10428
OVERWRITE_UNREAD = 10252
LEAVING_WINDOW = 10208
ACCELERATION_UNITS = (10186, 1000.0, 12509)  # g, of 1000 mV/g
COMMIT = 3
NOT_YET = -200284


@dataclass(frozen=True)
class Input:
    """An analog input channel of a task."""

    physical: str
    limit: float  # [V], of the converter, either sign

    def convert(self, volts: Volts) -> Volts:
        """Return what the converter gives for some voltages."""
        step = self.limit / LARGEST
        converted: Volts = np.clip(np.round(volts / step), -LARGEST, LARGEST - 1) * step
        return converted


@dataclass(frozen=True)
class Trigger:
    """The reference trigger: the first point beyond a level, behind one that is not."""

    source: str  # name of a channel
    pretrigger: int  # samples before it
    level: float  # [V], either sign


@dataclass(eq=False)
class SimulatedTask:
    """Channels, timing and state of one task."""

    inputs: dict[str, Input] = field(default_factory=dict)  # by the name of the channel
    line: str = ""
    rate: float = 1000.0  # [Hz]
    is_continuous: bool = False
    buffer: int = 0  # samples
    trigger: Trigger | None = None
    is_running: bool = False
    is_lost: bool = False  # its device was unplugged
    began: float = 0.0  # by the monotonic clock [s]
    first: int | None = None  # sample of the record; None: not triggered
    position: int = 0  # sample to read next
    settings: dict[int, int] = field(default_factory=dict)  # of the reads, by NI's numbers
    hits: list[tuple[int, dict[str, Volts]]] = field(default_factory=list)

    def start(self) -> None:
        """Run the sample clock from point 0."""
        self.is_running, self.began = True, time.monotonic()
        self.first, self.position, self.hits = None, 0, []

    def feed(self, volts: dict[str, Volts]) -> None:
        """See a hit from now on; a record begins behind its pre-trigger."""
        if not self.is_running:
            return
        if self.trigger is None:
            self.hits.append((self.count_now(), volts))
        elif self.first is None:
            self.hits = [(self.trigger.pretrigger, volts)]
            source = self.inputs[self.trigger.source]
            beyond = np.abs(source.convert(volts[source.physical])) > self.trigger.level
            crossings = np.flatnonzero(beyond[1:] & ~beyond[:-1])
            self.first = int(crossings[0]) + 1 if crossings.size else None

    def count_now(self) -> int:
        """Return how many samples were taken."""
        return int((time.monotonic() - self.began) * self.rate)

    def sample(self, begin: int, end: int) -> Volts:
        """Return samples, one row per channel."""
        rows = []
        for channel in self.inputs.values():
            volts = np.zeros(end - begin)
            for start, hit in self.hits:
                values = hit[channel.physical]
                low, high = max(begin, start), min(end, start + values.size)
                if low < high:
                    volts[low - begin : high - begin] = values[low - start : high - start]
            rows.append(channel.convert(volts))
        return np.array(rows)

    def list_overloaded(self) -> list[str]:
        """Return the channels whose voltage was beyond the range."""
        return [
            name
            for name, channel in self.inputs.items()
            if any(np.abs(hit[channel.physical]).max() > channel.limit for _, hit in self.hits)
        ]


class FakeDriver:
    """NI-DAQmx with one device, with the calls of `nidaqmx`; a task's handle is its name.

    `errors` names the calls that fail, with the number of the error.
    """

    def __init__(self, hammer_sensitivity: float, specimen_sensitivity: float) -> None:
        self.sensitivities = (hammer_sensitivity, specimen_sensitivity)  # [V per m/s^2]
        self.has_overload_detection = True  # many devices have none
        self.samples_at_once = True  # each input has its own converter
        self.is_present = True
        self.levels: dict[str, bool] = {}  # of the lines that were driven
        self.falls: Counter[str] = Counter()  # of each line
        self.errors: dict[str, int] = {}
        self.changed = threading.Condition()  # held by every call
        self._newest = ""  # channel
        self._tasks: dict[str, SimulatedTask] = {}
        self._owners: dict[str, SimulatedTask] = {}
        self._names = map("task {}".format, count(1))

    def feed(self, hit: VirtualHit) -> None:
        """Strike: running tasks see the sensors' voltages from now on."""
        volts = {
            physical: block.acceleration * sensitivity
            for physical, block, sensitivity in zip(
                INPUTS, (hit.hammer, hit.specimen), self.sensitivities, strict=True
            )
        }
        with self.changed:
            for task in self._tasks.values():
                task.feed(volts)
            self.changed.notify_all()

    def unplug(self) -> None:
        """Pull the device's cable; its tasks do not survive that."""
        with self.changed:
            self.is_present = False
            for task in self._tasks.values():
                task.is_lost = True
            self.changed.notify_all()

    def plug(self) -> None:
        """Put the cable back."""
        self.is_present = True

    def get_attribute(self, attribute: int, owner: str) -> Any:
        """Return a property of the system, of a device or of a task, by NI's number."""
        if attribute == 0x193B:
            return NAME if self.is_present else ""
        of_device = {
            0x631: "virtual digitizer", 0x632: 0x01A2B3C4, 0x22CA: True,
            0x298F: self.samples_at_once,
        }  # fmt: skip
        if attribute in of_device:
            if owner != NAME or not self.is_present:
                raise DaqError(f"Device identifier is invalid.\n\nDevice: {owner}", -200220)
            return of_device[attribute]
        task = self._tasks[owner]
        overloaded = task.list_overloaded()
        if attribute == 0x2174 and not self.has_overload_detection:
            raise DaqError("Specified property is not supported by the device.", -200452)
        return {
            0x1276: owner,
            0x1273: ", ".join(task.inputs),
            0x1344: task.rate,
            0x2174: bool(overloaded),
            0x2175: ", ".join(overloaded),
            0x1221: task.position,
            0x2181: len(task.inputs),  # of the task
            0x217B: len(task.inputs),  # of its reads
            0x1815: max((channel.limit for channel in task.inputs.values()), default=0.0),
        }[attribute]

    def set_read_attribute_int32(self, task: str, attribute: int, value: int) -> None:
        self._tasks[task].settings[attribute] = value

    def set_chan_attribute_int32(self, *_: Any) -> None:
        """Take the coupling, which makes no difference here."""

    def create_task(self, _: str) -> tuple[str, bool]:
        name = next(self._names)
        self._tasks[name] = SimulatedTask()
        return name, True

    def clear_task(self, task: str) -> None:
        gone = self._tasks.pop(task)
        self._owners = {key: owner for key, owner in self._owners.items() if owner is not gone}

    def create_ai_accel_chan(
        self, task: str, physical: str, name: str, _terminal: int, low: float, high: float,
        units: int, sensitivity: float, sensitivity_units: int, _source: int, _current: float,
        _scale: str,
    ) -> None:  # fmt: skip
        assert (units, sensitivity, sensitivity_units) == ACCELERATION_UNITS
        self.create_ai_voltage_chan(task, physical, name, _terminal, low, high, 0, "")

    def create_ai_voltage_chan(
        self, task: str, physical: str, name: str, _terminal: int, _low: float, high: float,
        _units: int, _scale: str,
    ) -> None:  # fmt: skip
        if physical not in INPUTS:
            raise _make_unknown(physical)
        self._newest = name or physical
        self._tasks[task].inputs[self._newest] = Input(physical, high)

    def internal_get_last_created_chan(self) -> str:
        return self._newest

    def create_do_chan(self, task: str, line: str, _name: str, _grouping: int) -> None:
        if line != LINE:
            raise _make_unknown(line)
        self._tasks[task].line = self._newest = line

    def cfg_samp_clk_timing(
        self, task: str, rate: float, _source: str, _edge: int, mode: int, count: int
    ) -> None:
        if rate > HIGHEST_RATE:
            raise DaqError(
                "Requested value is not a supported value for this property.\n\n"
                f"Property: SampClk.Rate\nRequested Value: {rate}",
                -200077,
            )
        found = self._tasks[task]
        found.rate = TIMEBASE / round(TIMEBASE / rate)
        found.is_continuous, found.buffer = mode == CONTINUOUS, count

    def cfg_anlg_window_ref_trig(
        self, task: str, source: str, top: float, bottom: float, pretrigger: int, when: int
    ) -> None:
        assert (when, bottom) == (LEAVING_WINDOW, -top)
        self._tasks[task].trigger = Trigger(source, pretrigger, top)

    def task_control(self, task: str, action: int) -> None:
        if action == COMMIT:
            self._reserve(self._tasks[task])

    def start_task(self, task: str) -> None:
        self._find_usable(task).start()

    def stop_task(self, task: str) -> None:
        self._find_usable(task).is_running = False

    def wait_until_task_done(self, task: str, timeout: float) -> None:
        found = self._tasks[task]
        self.changed.wait_for(lambda: found.is_lost or found.first is not None, timeout)
        if self._find_usable(task).first is None:
            raise DaqError("Wait Until Done did not indicate that the task was done.", -200560)

    def read_analog_f64(
        self, task: str, count: int, timeout: float, _mode: int, array: Volts
    ) -> tuple[Volts, int]:
        found = self._find_usable(task)
        if found.is_continuous:
            begin = self._find_place(found)
            due = found.began + (begin + count + 1) / found.rate
            wait = min(timeout, due - time.monotonic())
            self.changed.wait_for(lambda: found.is_lost, max(wait, 0.0))
            self._find_usable(task)
            end = min(begin + count, found.count_now())
        else:
            begin = found.first or 0
            end = begin + count
        found.position = end
        samples = found.sample(begin, end)
        array.ravel()[: samples.size] = samples.ravel()
        if end - begin < count:
            raise DaqReadError("Some samples are not yet available.", NOT_YET, end - begin)
        return array, count

    def _find_place(self, task: SimulatedTask) -> int:
        """Return where a read of a stream begins; an error if that is overwritten."""
        begin, now = task.position, task.count_now()
        if task.settings.get(0x190A) == MOST_RECENT_SAMPLE:
            begin = max(now + task.settings[0x190B], 0)
        if now - begin > task.buffer:
            assert task.settings[0x1211] == OVERWRITE_UNREAD, "the task would stop"
            raise DaqError(
                "The application is not able to keep up with the hardware acquisition.", -200279
            )
        return begin

    def write_digital_lines(
        self, task: str, _count: int, _start: bool, _timeout: float, _layout: int, array: Any
    ) -> int:
        found = self._find_usable(task)
        self._reserve(found)
        level = bool(array[0])
        self.falls[found.line] += self.levels.get(found.line, False) and not level
        self.levels[found.line] = level
        return 1

    def read_digital_lines(
        self, task: str, _count: int, _timeout: float, _mode: int, array: Any
    ) -> tuple[Any, int, int]:
        array[0] = self.levels.get(self._find_usable(task).line, False)
        return array, 1, 1

    def _find_usable(self, task: str) -> SimulatedTask:
        found = self._tasks[task]
        if found.is_lost:
            raise DaqError("No transfer is in progress: it was aborted by the client.", -50405)
        return found

    def _reserve(self, task: SimulatedTask) -> None:
        """Give line or inputs to a task, or refuse if another one has them."""
        if not self.is_present:
            raise DaqError("Device cannot be accessed.\n\nDevice is not powered.", -201003)
        if self._owners.setdefault(task.line or "analog input", task) is not task:
            raise DaqError("The specified resource is reserved.", -50103)


def _make_unknown(physical: str) -> DaqError:
    return DaqError(
        f"Physical channel specified does not exist on this device.\n\nName: {physical}", -200170
    )


class Interpreter:
    """What `nidaqmx` calls: one call at a time, which fails if a test says so."""

    def __init__(self, driver: FakeDriver) -> None:
        self._driver = driver

    def __getattr__(self, name: str) -> Callable[..., Any]:
        """Return a call."""

        def call(*arguments: Any) -> Any:
            driver = self._driver
            if name in driver.errors:
                raise DaqError("It fails\n\nbecause a test wants it.", driver.errors[name])
            with driver.changed:
                if "_attribute_" in name and name.startswith("get_"):
                    owner = next((item for item in arguments if isinstance(item, str)), "")
                    attribute = next(item for item in arguments if isinstance(item, int))
                    return driver.get_attribute(attribute, owner)
                return getattr(driver, name)(*arguments)

        return call
