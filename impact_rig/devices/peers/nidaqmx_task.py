"""A task of the simulated NI-DAQmx: sample clock, reference trigger, buffer and reads."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from impact_rig.devices.peers.nidaqmx_device import (
    HIGHEST_RATE,
    TIMEBASE,
    DaqmxError,
    Input,
    SimulatedDevice,
    Volts,
)

FINITE = 10178
CONTINUOUS = 10123
FIRST_SAMPLE = 10424
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

    def find_end(self) -> float:
        """Return when all samples will be there, by the monotonic clock [s]; inf: not known."""
        if not self.is_running or self._first is None or self.mode == CONTINUOUS:
            return math.inf
        return self._begin + (self._first + self.count) / self.rate

    def is_done(self) -> bool:
        """Return whether all samples are there."""
        return time.monotonic() >= self.find_end()

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
            begin = self._find_start()
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

    def _find_start(self) -> int:
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
