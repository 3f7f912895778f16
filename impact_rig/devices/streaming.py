"""Devices that sample all the time and have no trigger: hits are found in the stream."""

import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.given.errors import DeviceError
from impact_rig.core.given.records import NO_SPEED, Block, MeasuredSpeed, RawArray
from impact_rig.devices.protocols import NOT_MEASURED, Acquisition, AcquisitionPlan, ChannelScale
from impact_rig.devices.speed_gate import EdgeWatch


class StreamedSource(ABC):
    """An acceleration source whose trigger is in software.

    The trigger is the first point of the hammer whose size reaches the level while the one before
    it does not. The device streams from `configure` to `close`, armed or not, so that the time
    before a trigger is always there. `take` comes from a thread of the device's.
    """

    longest_silence = 2.0  # [s], without a point: the device is lost

    def __init__(self) -> None:
        # Guards all else; notified when points have come or the device has gone.
        self.changed = threading.Condition()
        # What came last; their points count from the beginning of the stream.
        self.blocks: deque[Block] = deque()
        self.count = 0  # points that have come since then, or were lost
        # Set by `open_device`: what messages call the device, its rate [Hz], and what its counts
        # mean, of the hammer's and, where it is measured, the sample's channel.
        self.name, self.sampling_rate = "", 0.0
        self.scales: tuple[ChannelScale, ...] = ()
        self.is_simulated = False  # the device computes its numbers
        self.gate_unit = 1.0  # what it delivers for 1 V at a light barrier
        self._record: deque[Block] = deque()
        self._is_armed = False
        self._armed_at = self._searched = 0
        self._trigger: int | None = None
        self._edges: EdgeWatch | None = None  # of a light barrier; None: there is none

    @abstractmethod
    def open_device(self, plan: AcquisitionPlan) -> None:
        """Open the device, and let it stream; errors as `AccelerationSource.configure`."""

    def configure(self, plan: AcquisitionPlan) -> Acquisition:
        """Open the device, and see that it delivers; errors as `AccelerationSource.configure`."""
        self._plan = plan
        # A reader that a busy computer holds up still finds the time before its trigger.
        late = 0 if plan.continuous else round(self.longest_silence * plan.sampling_rate)
        record = 2 * plan.points + plan.pre_trigger_points
        self._capacity = max(plan.depth * plan.block_size, record, late)
        self.blocks.clear()
        self.count, self._end = 0, ""
        self._last_time = time.monotonic()
        self._clock = self._newest = (0, time.time_ns())
        self._edges = None
        self.open_device(plan)
        with self.changed:
            while self.count < max(plan.pre_trigger_points, 1):
                self._wait(time.monotonic() + self.longest_silence)
        return Acquisition(self.name, self.sampling_rate, self.is_simulated)

    def take(self, counts: RawArray, stamp: int, lost: int = 0) -> None:
        """Take the next points, shape (n, inputs), which do not change any more.

        Parameters
        ----------
        counts : ndarray of int32 or float64
            As the device gives them.
        stamp : int
            When the first of them was taken [ns since the epoch].
        lost : int
            Points that are missing before them.
        """
        hammer, *others = [
            scale.make_block(counts[:, column]) for column, scale in enumerate(self.scales)
        ]
        specimen = (*others, NOT_MEASURED)[0]
        with self.changed:
            first = self.count + lost
            speed = self._measure_speed(first, counts)
            block = Block(first, self.sampling_rate, hammer, specimen, impact_speed=speed)
            self.blocks.append(block)
            self.count = first + len(counts)
            while get_end(self.blocks[0]) <= self.count - self._capacity:
                self.blocks.popleft()
            self._newest = (first, stamp)
            self._last_time = time.monotonic()
            self.changed.notify_all()

    def _measure_speed(self, first: int, counts: RawArray) -> MeasuredSpeed:
        """Return the speed of the hit in the next points; its barrier is their last column."""
        if (gate := self._plan.gate) is None:
            return NO_SPEED
        if self._edges is None:
            self._edges = EdgeWatch(gate, self.gate_unit, self._trigger_level)
        return self._edges.follow(first, counts[:, 0], counts[:, -1], self.sampling_rate)

    @property
    def _trigger_level(self) -> float:
        """Size of the hammer's signal that triggers, as the device gives it."""
        return self._plan.trigger_level / abs(self.scales[0].scale)

    def end(self, reason: str) -> None:
        """Mark the device as gone, with the reason."""
        with self.changed:
            self._end = self._end or reason
            self.changed.notify_all()

    def arm(self) -> None:
        """Wait for the level to be crossed; in continuous mode begin to deliver."""
        with self.changed:
            self._stop()
            self._is_armed = True
            # Times count from here: from block to block they jump on a busy computer.
            self._clock = self._newest
            self._armed_at = self._searched = self.count
            if self._plan.continuous:
                self.blocks.clear()
            elif self.blocks:
                # A record is whole, as far as the time before the trigger is concerned.
                whole = self.blocks[0].first_sample + self._plan.pre_trigger_points
                self._searched = max(self._armed_at, whole)

    def read(self, timeout: float) -> Block | None:
        """Return the next block; None if there is none in time.

        Raises
        ------
        DeviceError
            If the device has gone, or has stopped to deliver.
        """
        deadline = time.monotonic() + timeout
        with self.changed:
            while True:
                if self._is_armed and self._plan.continuous and self.blocks:
                    return self._date(self.blocks.popleft(), self._armed_at)
                if self._is_armed and not self._plan.continuous:
                    self._cut_record()
                if self._record:
                    return self._record.popleft()
                self._wait(deadline)
                if time.monotonic() >= deadline:
                    return None

    def disarm(self) -> None:
        """Deliver no more."""
        with self.changed:
            self._stop()

    def check(self) -> None:
        """See that the device still delivers.

        Raises
        ------
        DeviceError
            If the device has gone, or is silent.
        """
        with self.changed:
            if self._end:
                raise DeviceError(f"{self.name} is gone: {self._end}")
            silent = time.monotonic() - self._last_time
            if silent > self.longest_silence:
                raise DeviceError(
                    f"{self.name} is silent: it has delivered nothing for {silent:.1f} s"
                )

    def _wait(self, deadline: float) -> None:
        """Wait for points until a time of `time.monotonic`; `changed` held; raises as `check`."""
        self.check()
        # Wakes in time to notice a silent device.
        self.changed.wait(max(min(deadline - time.monotonic(), self.longest_silence), 0.0))

    def _stop(self) -> None:
        self._is_armed, self._trigger = False, None
        self._record.clear()

    def _date(self, block: Block, origin: int, *, last: bool = False) -> Block:
        """Return a block with its time, its points counted from `origin`; `changed` is held."""
        known, stamp = self._clock
        return replace(
            block,
            first_sample=block.first_sample - origin,
            sampling_rate=self.sampling_rate,
            last=last,
            stamp=stamp + round((block.first_sample - known) / self.sampling_rate * 1e9),
        )

    def _cut_record(self) -> None:
        """Look for the trigger, then wait for the end of its record and cut it."""
        if self._trigger is None:
            self._trigger = self._find_trigger()
        if self._trigger is None:
            return
        first = self._trigger - self._plan.pre_trigger_points
        stop = first + self._plan.points
        if self.count < stop:
            return
        pieces = [
            block.cut(max(first - block.first_sample, 0), stop - block.first_sample)
            for block in self.blocks
            if block.first_sample < stop and get_end(block) > first
        ]
        self._record.extend(self._date(piece, first, last=piece is pieces[-1]) for piece in pieces)
        self._is_armed = False

    def _find_trigger(self) -> int | None:
        """Return the place where the hammer's size reaches the level; None: not yet."""
        level = self._trigger_level
        before: Block | None = None
        for block in self.blocks:
            if get_end(block) > self._searched:
                place = block.first_sample
                counts: NDArray[Any] = block.hammer.output
                # The point before those that are searched tells whether the first one crosses;
                # where points are missing, the one before them.
                if before is not None:
                    place, counts = place - 1, np.append(before.hammer.output[-1:], counts)
                hidden = max(self._searched - 1 - place, 0)
                crossing = find_crossing(counts[hidden:], level)
                if crossing < counts.size - hidden:
                    return place + hidden + crossing
            before = block
        self._searched = max(self._searched, self.count)
        return None


def get_end(block: Block) -> int:
    """Return the place behind a block's last point."""
    return block.first_sample + block.hammer.output.size


def find_crossing(counts: NDArray[Any], level: float) -> int:
    """Return where counts, shape (n,), first reach a level in size from below; n: nowhere.

    What is no number reaches it: the record says so, where no trigger would say nothing.
    """
    is_large = ~((counts < level) & (counts > -level))
    crossings = np.flatnonzero(is_large[1:] & ~is_large[:-1])
    return int(crossings[0]) + 1 if crossings.size else counts.size
