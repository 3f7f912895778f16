"""Devices that sample all the time and have no trigger: hits are found in the stream."""

import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.errors import DeviceError
from impact_rig.core.records import Block
from impact_rig.devices.protocols import NOT_MEASURED, Acquisition, AcquisitionPlan, ChannelScale

CountArray = NDArray[np.int32]


class StreamCapture:
    """Takes points in one thread, and hands them out in another.

    Parameters
    ----------
    name : str
        What messages call the device: "sound device USB Audio".
    sampling_rate : float
        [Hz]
    scales : tuple of ChannelScale
        Of the hammer's and, where it is measured, the sample's channel.
    capacity : int
        Points to keep at least.

    Attributes
    ----------
    changed : Condition
        Guards all else; notified when points have come or the device has gone.
    blocks : deque of Block
        What came last; their points count from the beginning of the stream.
    count : int
        Points that have come since then, or were lost.
    """

    longest_silence = 2.0  # [s], without a point: the device is lost

    def __init__(
        self, name: str, sampling_rate: float, scales: tuple[ChannelScale, ...], capacity: int
    ) -> None:
        self.name = name
        self.sampling_rate = sampling_rate
        self.scales = scales
        self.changed = threading.Condition()
        self.blocks: deque[Block] = deque()
        self.count = 0
        self._capacity = capacity
        self._end = ""
        self._last_time = time.monotonic()
        self._clock = self._newest = (0, time.time_ns())

    def take(self, counts: CountArray, stamp: int, lost: int = 0) -> None:
        """Take the next points, shape (n, channels), which do not change any more.

        Parameters
        ----------
        counts : ndarray of int32
            As the device gives them.
        stamp : int
            When the first of them was taken [ns since the epoch].
        lost : int
            Points that are missing before them.
        """
        hammer, *others = [
            scale.make_block(counts[:, column]) for column, scale in enumerate(self.scales)
        ]
        with self.changed:
            first = self.count + lost
            specimen = others[0] if others else NOT_MEASURED
            self.blocks.append(Block(first, self.sampling_rate, hammer, specimen))
            self.count = first + len(counts)
            while get_end(self.blocks[0]) <= self.count - self._capacity:
                self.blocks.popleft()
            self._newest = (first, stamp)
            self._last_time = time.monotonic()
            self.changed.notify_all()

    def end(self, reason: str) -> None:
        """Mark the device as gone, with the reason."""
        with self.changed:
            self._end = self._end or reason
            self.changed.notify_all()

    def wait_for_points(self, count: int) -> None:
        """Wait until so many points have come; raises as `wait`."""
        with self.changed:
            while self.count < count:
                self.wait(time.monotonic() + self.longest_silence)

    def wait(self, deadline: float) -> None:
        """Wait for points until a time of `time.monotonic`; `changed` held; raises as `check`."""
        self.check()
        # Wakes in time to notice a silent device.
        self.changed.wait(max(min(deadline - time.monotonic(), self.longest_silence), 0.0))

    def check(self) -> None:
        """See that the device delivers; `changed` is held.

        Raises
        ------
        DeviceError
            If the device has gone, or is silent.
        """
        if self._end:
            raise DeviceError(f"{self.name} is gone: {self._end}")
        silent = time.monotonic() - self._last_time
        if silent > self.longest_silence:
            raise DeviceError(
                f"{self.name} is silent: it has delivered nothing for {silent:.1f} s"
            )

    def set_clock(self) -> None:
        """Count times from the newest points on; `changed` is held.

        Times from block to block jump on a busy computer.
        """
        self._clock = self._newest

    def date(self, block: Block, origin: int, *, last: bool = False) -> Block:
        """Return a block with its time, its points counted from `origin`; `changed` is held."""
        known, stamp = self._clock
        return replace(
            block,
            first_sample=block.first_sample - origin,
            sampling_rate=self.sampling_rate,
            last=last,
            stamp=stamp + round((block.first_sample - known) / self.sampling_rate * 1e9),
        )


class StreamedSource(ABC):
    """An acceleration source whose trigger is in software.

    The trigger is the first point of the hammer whose size reaches the level while the one before
    it does not. The device streams from `configure` to `close`, armed or not, so that the time
    before a trigger is always there.
    """

    def __init__(self) -> None:
        self._plan: AcquisitionPlan | None = None
        self._capture: StreamCapture | None = None
        self._is_armed = False
        self._armed_at = self._searched = 0
        self._trigger: int | None = None
        self._blocks: deque[Block] = deque()

    @abstractmethod
    def open_device(self, plan: AcquisitionPlan, capacity: int) -> StreamCapture:
        """Open the device, and let it stream; errors as `AccelerationSource.configure`.

        Parameters
        ----------
        plan : AcquisitionPlan
            What it should do.
        capacity : int
            Points that its capture must keep at least.
        """

    def configure(self, plan: AcquisitionPlan) -> Acquisition:
        """Open the device, and see that it delivers; errors as `AccelerationSource.configure`."""
        self.close()
        capture = self.open_device(
            plan, max(plan.depth * plan.block_size, 2 * plan.points + plan.pre_trigger_points)
        )
        self._plan, self._capture = plan, capture
        try:
            capture.wait_for_points(max(plan.pre_trigger_points, 1))
        except DeviceError:
            self.close()
            raise
        return Acquisition(capture.name, capture.sampling_rate)

    def arm(self) -> None:
        """Wait for the level to be crossed; in continuous mode begin to deliver."""
        plan, capture = self._get_running()
        with capture.changed:
            self._stop()
            self._is_armed = True
            capture.set_clock()
            self._armed_at = self._searched = capture.count
            if plan.continuous:
                capture.blocks.clear()
            elif capture.blocks:
                # A record is whole, as far as the time before the trigger is concerned.
                whole = capture.blocks[0].first_sample + plan.pre_trigger_points
                self._searched = max(self._armed_at, whole)

    def read(self, timeout: float) -> Block | None:
        """Return the next block; None if there is none in time.

        Raises
        ------
        DeviceError
            If the device has gone, or has stopped to deliver.
        """
        plan, capture = self._get_running()
        deadline = time.monotonic() + timeout
        with capture.changed:
            while True:
                if self._is_armed and plan.continuous and capture.blocks:
                    return capture.date(capture.blocks.popleft(), self._armed_at)
                if self._is_armed and not plan.continuous:
                    self._cut_record(plan, capture)
                if self._blocks:
                    return self._blocks.popleft()
                capture.wait(deadline)
                if time.monotonic() >= deadline:
                    return None

    def disarm(self) -> None:
        """Deliver no more."""
        if self._capture is not None:
            with self._capture.changed:
                self._stop()

    def check(self) -> None:
        """See that the device still delivers; raises `DeviceError`."""
        _, capture = self._get_running()
        with capture.changed:
            capture.check()

    def close(self) -> None:
        """Deliver no more; a driver closes its device, too."""
        self._capture = None
        self._stop()

    def _stop(self) -> None:
        self._is_armed, self._trigger = False, None
        self._blocks.clear()

    def _get_running(self) -> tuple[AcquisitionPlan, StreamCapture]:
        if self._plan is None or self._capture is None:
            raise DeviceError("the device is not open: configure the source first")
        return self._plan, self._capture

    def _cut_record(self, plan: AcquisitionPlan, capture: StreamCapture) -> None:
        """Look for the trigger, then wait for the end of its record and cut it."""
        if self._trigger is None:
            self._trigger = self._find_trigger(plan, capture)
        if self._trigger is None:
            return
        first = self._trigger - plan.pre_trigger_points
        stop = first + plan.points
        if capture.count < stop:
            return
        pieces = [
            block.cut(max(first - block.first_sample, 0), stop - block.first_sample)
            for block in capture.blocks
            if block.first_sample < stop and get_end(block) > first
        ]
        self._blocks.extend(
            capture.date(piece, first, last=piece is pieces[-1]) for piece in pieces
        )
        self._is_armed = False

    def _find_trigger(self, plan: AcquisitionPlan, capture: StreamCapture) -> int | None:
        """Return the place where the hammer's size reaches the level; None: not yet."""
        level = plan.trigger_level / abs(capture.scales[0].scale)
        before: Block | None = None
        for block in capture.blocks:
            if get_end(block) > self._searched:
                place = block.first_sample
                counts: NDArray[Any] = block.hammer.output
                # The point before those that are searched tells whether the first one crosses.
                if before is not None and get_end(before) == place:
                    place, counts = place - 1, np.append(before.hammer.output[-1:], counts)
                hidden = max(self._searched - 1 - place, 0)
                crossing = find_crossing(counts[hidden:], level)
                if crossing < counts.size - hidden:
                    return place + hidden + crossing
            before = block
        self._searched = max(self._searched, capture.count)
        return None


def get_end(block: Block) -> int:
    """Return the place behind a block's last point."""
    return block.first_sample + block.hammer.output.size


def find_crossing(counts: NDArray[Any], level: float) -> int:
    """Return where counts, shape (n,), first reach a level in size from below; n: nowhere."""
    is_large = (counts >= level) | (counts <= -level)
    crossings = np.flatnonzero(is_large[1:] & ~is_large[:-1])
    return int(crossings[0]) + 1 if crossings.size else counts.size
