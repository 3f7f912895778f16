"""A simulated two-channel digitizer, as NI-DAQmx would see it; no NI software."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from impact_rig.devices.peers.nidaqmx_task import SimulatedTask
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
