"""Hits cut out of what a device streams all the time."""

import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from impact_rig.core.errors import DeviceError
from impact_rig.devices.acceleration_source import AcquiredBlock, Acquisition, AcquisitionPlan
from impact_rig.devices.streaming.capture import StreamCapture
from impact_rig.devices.streaming.count_scale import NOT_MEASURED, CountScale
from impact_rig.devices.streaming.sample_store import CountArray, Run


@dataclass(frozen=True)
class Streaming:
    """A device that streams.

    Attributes
    ----------
    capture : StreamCapture
        Of the hammer's and, where it is measured, the sample's channel.
    scales : tuple of CountScale
        Of these channels.
    """

    capture: StreamCapture
    scales: tuple[CountScale, ...]


class StreamedSource(ABC):
    """An acceleration source whose trigger is in software.

    The trigger is the first point of the hammer whose size reaches the level while the one before
    it does not. The device streams from `configure` to `close`, armed or not, so that the time
    before a trigger is always there.
    """

    def __init__(self) -> None:
        self._plan: AcquisitionPlan | None = None
        self._streaming: Streaming | None = None
        self._is_armed = False
        self._armed_at = self._earliest = self._cursor = 0
        self._trigger: int | None = None
        self._blocks: deque[AcquiredBlock] = deque()

    @abstractmethod
    def open_device(self, plan: AcquisitionPlan, capacity: int) -> Streaming:
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
        streaming = self.open_device(
            plan, max(plan.depth * plan.block_size, 2 * plan.points + plan.pre_trigger_points)
        )
        self._plan, self._streaming = plan, streaming
        try:
            streaming.capture.wait_for_points(max(plan.pre_trigger_points, 1))
        except DeviceError:
            self.close()
            raise
        return Acquisition(streaming.capture.name, streaming.capture.sampling_rate)

    def arm(self) -> None:
        """Wait for the level to be crossed; in continuous mode begin to deliver."""
        plan, streaming = self._get_running()
        capture = streaming.capture
        with capture.changed:
            self._stop()
            self._is_armed = True
            self._armed_at = self._cursor = capture.store.end
            # A record is whole, as far as the time before the trigger is concerned.
            self._earliest = max(self._armed_at, capture.store.start + plan.pre_trigger_points)

    def read(self, timeout: float) -> AcquiredBlock | None:
        """Return the next block; None if there is none in time.

        Raises
        ------
        DeviceError
            If the device has gone, or has stopped to deliver.
        """
        plan, streaming = self._get_running()
        deadline = time.monotonic() + timeout
        with streaming.capture.changed:
            while True:
                if self._is_armed and plan.continuous:
                    self._cut_stream(plan, streaming)
                elif self._is_armed:
                    self._cut_record(plan, streaming)
                if self._blocks:
                    return self._blocks.popleft()
                streaming.capture.wait(deadline)
                if time.monotonic() >= deadline:
                    return None

    def disarm(self) -> None:
        """Deliver no more."""
        if self._streaming is not None:
            with self._streaming.capture.changed:
                self._stop()

    def check(self) -> None:
        """See that the device still delivers; raises `DeviceError`."""
        capture = self._get_running()[1].capture
        with capture.changed:
            capture.check()

    def close(self) -> None:
        """Let the device go."""
        streaming, self._streaming = self._streaming, None
        self._stop()
        if streaming is not None:
            # Its thread may want the lock before it ends.
            streaming.capture.close()

    def _stop(self) -> None:
        self._is_armed, self._trigger = False, None
        self._blocks.clear()

    def _get_running(self) -> tuple[AcquisitionPlan, Streaming]:
        if self._plan is None or self._streaming is None:
            raise DeviceError("the device is not open: configure the source first")
        return self._plan, self._streaming

    def _cut_stream(self, plan: AcquisitionPlan, streaming: Streaming) -> None:
        """Take the next block of the stream, if it has come or a gap ends it."""
        store = streaming.capture.store
        runs = store.find_runs(self._cursor, store.end)
        if not runs or (len(runs) == 1 and len(runs[0].counts) < plan.block_size):
            return
        run = Run(runs[0].place, runs[0].counts[: plan.block_size])
        self._cursor = run.end
        store.forget(self._cursor)
        self._blocks.append(_make_block(streaming, run, self._armed_at))

    def _cut_record(self, plan: AcquisitionPlan, streaming: Streaming) -> None:
        """Look for the trigger, then wait for the end of its record and cut it."""
        store = streaming.capture.store
        if self._trigger is None:
            self._trigger = self._find_trigger(plan, streaming)
        if self._trigger is None:
            return
        first = self._trigger - plan.pre_trigger_points
        if store.end < first + plan.points:
            return
        runs = store.find_runs(first, first + plan.points)
        pieces = [piece for run in runs for piece in _split(run, plan.block_size)]
        self._blocks.extend(
            _make_block(streaming, piece, first, last=piece is pieces[-1]) for piece in pieces
        )
        self._is_armed = False

    def _find_trigger(self, plan: AcquisitionPlan, streaming: Streaming) -> int | None:
        """Return the place where the hammer's size reaches the level; None: not yet."""
        store, scale = streaming.capture.store, streaming.scales[0]
        level = plan.trigger_level / abs(scale.scale)
        # The point before those that are searched tells whether the first one crosses the level.
        for run in store.find_runs(max(self._cursor, self._earliest) - 1, store.end):
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


def _make_block(
    streaming: Streaming, run: Run, origin: int, *, last: bool = False
) -> AcquiredBlock:
    """Return points as a block that counts from the place `origin`."""
    blocks = [
        scale.make_block(run.counts[:, column]) for column, scale in enumerate(streaming.scales)
    ]
    return AcquiredBlock(
        first_sample=run.place - origin,
        hammer=blocks[0],
        specimen=blocks[1] if len(blocks) > 1 else NOT_MEASURED,
        last=last,
        stamp=streaming.capture.find_stamp(run.place),
    )
