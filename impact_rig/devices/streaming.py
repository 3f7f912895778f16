"""Devices that sample all the time and have no trigger: hits are found in the stream."""

import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.errors import DeviceError
from impact_rig.core.signals.record import Block, ChannelBlock
from impact_rig.devices.protocols import NOT_MEASURED, Acquisition, AcquisitionPlan

CountArray = NDArray[np.int32]


class Run(NamedTuple):
    """Points without a gap.

    Attributes
    ----------
    place : int
        Of the first one, counted since the stream began.
    counts : ndarray of int32, shape (n, channels)
        The points.
    """

    place: int
    counts: CountArray

    @property
    def end(self) -> int:
        """Place behind the last one."""
        return self.place + len(self.counts)


class SampleStore:
    """Keeps what came last.

    Parameters
    ----------
    capacity : int
        Points to keep at least; what is much older is dropped.

    Attributes
    ----------
    end : int
        Place of the next point.
    """

    def __init__(self, capacity: int) -> None:
        self.end = 0
        self._capacity = capacity
        self._runs: deque[Run] = deque()

    @property
    def start(self) -> int:
        """Place of the first point that is there."""
        return self._runs[0].place if self._runs else self.end

    def append(self, counts: CountArray) -> None:
        """Take the next points, shape (n, channels), which nobody changes any more."""
        if not len(counts):
            return
        self._runs.append(Run(self.end, counts))
        self.end += len(counts)
        self.forget(self.end - self._capacity)

    def skip(self, points: int) -> None:
        """Leave a gap, because so many points were lost."""
        self.end += points

    def forget(self, place: int) -> None:
        """Drop what lies before a place, as far as it came in one piece."""
        while self._runs and self._runs[0].end <= place:
            self._runs.popleft()

    def read_runs(self, start: int, stop: int) -> list[Run]:
        """Return what is there from one place to before another, joined where there is no gap."""
        found: list[list[Run]] = []
        for run in self._runs:
            low, high = max(start - run.place, 0), min(stop - run.place, len(run.counts))
            if low >= high:
                continue
            part = Run(run.place + low, run.counts[low:high])
            if found and found[-1][-1].end == part.place:
                found[-1].append(part)
            else:
                found.append([part])
        return [
            Run(parts[0].place, np.concatenate([part.counts for part in parts])) for parts in found
        ]


@dataclass(frozen=True)
class CountScale:
    """Of one channel.

    Attributes
    ----------
    scale, offset : float
        Acceleration of one count, and at count 0 [m/s^2].
    full_scale : float
        Largest acceleration that the channel can show, either sign [m/s^2].
    lowest, highest : int
        Counts from which on the channel is overloaded.
    """

    scale: float
    full_scale: float
    lowest: int
    highest: int
    offset: float = 0.0

    def make_block(self, counts: CountArray) -> ChannelBlock:
        """Return counts, shape (n,), as a calibrated block."""
        return ChannelBlock(
            output=counts,
            scale=self.scale,
            offset=self.offset,
            full_scale=self.full_scale,
            overloaded=bool(
                counts.size and (counts.max() >= self.highest or counts.min() <= self.lowest)
            ),
        )


LONGEST_SILENCE = 2.0
"""After so long without a point the device is lost [s], our choice: these devices deliver every
few hundredths of a second."""


class StreamCapture:
    """Takes points in one thread, and hands them out in another.

    A driver's subclass runs the device from when it is made until `close`.

    Parameters
    ----------
    name : str
        What messages call the device: "sound device USB Audio".
    sampling_rate : float
        [Hz]
    scales : tuple of CountScale
        Of the hammer's and, where it is measured, the sample's channel.
    capacity : int
        Points to keep at least.

    Attributes
    ----------
    changed : Condition
        Guards all else; notified when points have come or the device has gone.
    store : SampleStore
        The points.
    """

    def __init__(
        self, name: str, sampling_rate: float, scales: tuple[CountScale, ...], capacity: int
    ) -> None:
        self.name = name
        self.sampling_rate = sampling_rate
        self.scales = scales
        self.changed = threading.Condition()
        self.store = SampleStore(capacity)
        self._end = ""
        self._last_time = time.monotonic()
        self._anchor = (0, time.time_ns())

    def close(self) -> None:
        """Let the device go; never raises."""

    def take(self, counts: CountArray, stamp: int, lost: int = 0) -> None:
        """Take the next points, shape (n, channels), which nobody changes any more.

        Parameters
        ----------
        counts : ndarray of int32
            As the device gives them.
        stamp : int
            When the first of them was taken [ns since the epoch].
        lost : int
            Points that are missing before them.
        """
        with self.changed:
            self.store.skip(lost)
            self._anchor = (self.store.end, stamp)
            self.store.append(counts)
            self._last_time = time.monotonic()
            self.changed.notify_all()

    def end(self, reason: str) -> None:
        """Note that no more will come, and why."""
        with self.changed:
            self._end = self._end or reason
            self.changed.notify_all()

    def wait_for_points(self, count: int) -> None:
        """Wait until so many points have come; raises as `wait`."""
        with self.changed:
            while self.store.end < count:
                self.wait(time.monotonic() + LONGEST_SILENCE)

    def wait(self, deadline: float) -> None:
        """Wait for points until a time of `time.monotonic`; `changed` held; raises as `check`."""
        self.check()
        # The silence is noticed by waking up in vain.
        self.changed.wait(max(min(deadline - time.monotonic(), LONGEST_SILENCE), 0.0))

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
        if silent > LONGEST_SILENCE:
            raise DeviceError(
                f"{self.name} is silent: it has delivered nothing for {silent:.1f} s"
            )

    def compute_stamp(self, place: int) -> int:
        """Return when a point was taken [ns since the epoch]; `changed` is held."""
        known, stamp = self._anchor
        return stamp + round((place - known) / self.sampling_rate * 1e9)


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
        self._armed_at = self._earliest = self._cursor = 0
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
            self._armed_at = self._cursor = capture.store.end
            # A record is whole, as far as the time before the trigger is concerned.
            self._earliest = max(self._armed_at, capture.store.start + plan.pre_trigger_points)

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
                if self._is_armed and plan.continuous:
                    self._cut_stream(plan, capture)
                elif self._is_armed:
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
        """Let the device go."""
        capture, self._capture = self._capture, None
        self._stop()
        if capture is not None:
            # Its thread may want the lock before it ends.
            capture.close()

    def _stop(self) -> None:
        self._is_armed, self._trigger = False, None
        self._blocks.clear()

    def _get_running(self) -> tuple[AcquisitionPlan, StreamCapture]:
        if self._plan is None or self._capture is None:
            raise DeviceError("the device is not open: configure the source first")
        return self._plan, self._capture

    def _cut_stream(self, plan: AcquisitionPlan, capture: StreamCapture) -> None:
        """Take the next block of the stream, if it has come or a gap ends it."""
        store = capture.store
        runs = store.read_runs(self._cursor, store.end)
        if not runs or (len(runs) == 1 and len(runs[0].counts) < plan.block_size):
            return
        run = Run(runs[0].place, runs[0].counts[: plan.block_size])
        self._cursor = run.end
        store.forget(self._cursor)
        self._blocks.append(_make_block(capture, run, self._armed_at))

    def _cut_record(self, plan: AcquisitionPlan, capture: StreamCapture) -> None:
        """Look for the trigger, then wait for the end of its record and cut it."""
        store = capture.store
        if self._trigger is None:
            self._trigger = self._find_trigger(plan, capture)
        if self._trigger is None:
            return
        first = self._trigger - plan.pre_trigger_points
        if store.end < first + plan.points:
            return
        runs = store.read_runs(first, first + plan.points)
        pieces = [piece for run in runs for piece in _split(run, plan.block_size)]
        self._blocks.extend(
            _make_block(capture, piece, first, last=piece is pieces[-1]) for piece in pieces
        )
        self._is_armed = False

    def _find_trigger(self, plan: AcquisitionPlan, capture: StreamCapture) -> int | None:
        """Return the place where the hammer's size reaches the level; None: not yet."""
        store, scale = capture.store, capture.scales[0]
        level = plan.trigger_level / abs(scale.scale)
        # The point before those that are searched tells whether the first one crosses the level.
        for run in store.read_runs(max(self._cursor, self._earliest) - 1, store.end):
            self._cursor = run.end
            place = run.place + find_crossing(run.counts[:, 0], level, scale.offset / scale.scale)
            if place < run.end:
                return place
        return None


def find_crossing(counts: CountArray, level: float, offset: float = 0.0) -> int:
    """Return where counts, shape (n,), first reach a level in size from below; n: nowhere.

    Parameters
    ----------
    counts : ndarray of int32
        To be searched.
    level : float
        Size that is reached, in counts.
    offset : float
        What is added to the counts before, in counts.
    """
    is_large = (counts >= level - offset) | (counts <= -level - offset)
    crossings = np.flatnonzero(is_large[1:] & ~is_large[:-1])
    return int(crossings[0]) + 1 if crossings.size else counts.size


def _split(run: Run, size: int) -> Iterator[Run]:
    for start in range(0, len(run.counts), size):
        yield Run(run.place + start, run.counts[start : start + size])


def _make_block(capture: StreamCapture, run: Run, origin: int, *, last: bool = False) -> Block:
    """Return points as a block that counts from the place `origin`."""
    blocks = [
        scale.make_block(run.counts[:, column]) for column, scale in enumerate(capture.scales)
    ]
    return Block(
        first_sample=run.place - origin,
        sampling_rate=capture.sampling_rate,
        hammer=blocks[0],
        specimen=blocks[1] if len(blocks) > 1 else NOT_MEASURED,
        last=last,
        stamp=capture.compute_stamp(run.place),
    )
