"""What is read of a running task: triggered records, or a stream."""

import time
import warnings
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

import numpy as np

from impact_rig.core.errors import DeviceError
from impact_rig.core.signals.record import ChannelBlock, FloatArray
from impact_rig.devices.acceleration_source import AcquiredBlock, AcquisitionPlan
from impact_rig.devices.nidaqmx.errors import (
    NOT_DONE,
    NOT_YET,
    OVERWRITTEN,
    STOPPED_EARLY,
    UNKNOWN_PROPERTY,
)
from impact_rig.devices.nidaqmx.inputs import Input

if TYPE_CHECKING:
    from nidaqmx import Task

NO_CHANNEL = ChannelBlock(np.empty(0), 1.0, 0.0, 0.0)
"""Of a sample that is not measured."""


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
        self._begin = 0

    def start(self) -> None:
        """Let the task run."""
        self._begin = time.time_ns()
        self._task.start()

    @abstractmethod
    def read(self, timeout: float) -> AcquiredBlock | None:
        """Return the next block; None if there is none in time [s]."""

    def stop(self) -> None:
        """Stop the task, and forget what was not read."""
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

    def _find_overloaded(self) -> tuple[bool, ...]:
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
    ) -> AcquiredBlock:
        channels = [
            channel.make_block(row, overloaded=flag)
            for channel, row, flag in zip(self._inputs, numbers, overloaded, strict=True)
        ]
        return AcquiredBlock(first, channels[0], (*channels[1:], NO_CHANNEL)[0], **fields)


class RecordReading(Reading):
    """One record for each trigger, cut into blocks."""

    _numbers: FloatArray | None = None
    _overloaded: tuple[bool, ...] = ()
    _next = 0
    _is_waiting = False

    def start(self) -> None:
        """Wait for the trigger."""
        _expect_early_stops()
        self._numbers = None
        self._next = 0
        super().start()
        self._is_waiting = True

    def read(self, timeout: float) -> AcquiredBlock | None:
        """Return the next block of the record, None if there is none in time [s]."""
        if self._is_waiting and not self._fetch(timeout):
            return None
        if self._numbers is None:
            return None
        first = self._next
        self._next = min(first + self._plan.block_size, self._plan.points)
        is_last = self._next == self._plan.points
        block = self._make_block(
            first,
            self._numbers[:, first : self._next],
            self._overloaded,
            last=is_last,
            stamp=self._begin + round(first / self._rate * 1e9),
        )
        if is_last:
            self._numbers = None
        return block

    def stop(self) -> None:
        """Forget the trigger, or the record."""
        self._numbers = None
        if self._is_waiting:
            self._is_waiting = False
            super().stop()

    def _fetch(self, timeout: float) -> bool:
        """Read the record if it is complete in time [s]."""
        from nidaqmx.errors import DaqError

        try:
            self._task.wait_until_done(timeout)
        except DaqError as error:
            if error.error_type.name == NOT_DONE:
                return False
            raise
        points = self._plan.points
        # The record ended just now.
        self._begin = time.time_ns() - round(points / self._rate * 1e9)
        numbers = self._read_numbers(points, 0.0)
        if numbers.shape[1] != points:
            raise DeviceError(
                f"NI-DAQmx gave {numbers.shape[1]} of the {points} samples of a complete record"
            )
        numbers.setflags(write=False)
        self._overloaded = self._find_overloaded()
        self._numbers = numbers
        self._task.stop()
        self._is_waiting = False
        return True


class StreamReading(Reading):
    """Everything that comes."""

    _is_running = False

    def start(self) -> None:
        """Let samples come."""
        from nidaqmx.constants import OverwriteMode

        # Who reads too late loses samples, not the stream.
        self._task.in_stream.overwrite = OverwriteMode.OVERWRITE_UNREAD_SAMPLES
        super().start()
        self._is_running = True

    def read(self, timeout: float) -> AcquiredBlock | None:
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
            self._find_overloaded(),
            stamp=self._begin + round(first / self._rate * 1e9),
        )

    def stop(self) -> None:
        """Stop, and forget what was not read."""
        if self._is_running:
            self._is_running = False
            super().stop()

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
