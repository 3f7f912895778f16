"""The virtual digitizer without a trigger: it delivers block after block as the clock says."""

import math
import threading
import time
from collections import deque

from impact_rig.devices.acceleration_source import AcquiredBlock
from impact_rig.devices.virtual.block_clock import BlockClock
from impact_rig.devices.virtual.rig import VirtualHit, VirtualRigSettings
from impact_rig.devices.virtual.stream import VirtualStream

SHORTEST_TURN = 5e-3
"""Least time from one look at the clock to the next [s], our choice: of shorter blocks several are
fetched at a time, since each look costs as much as handing a block on."""


class StreamingDigitizer:
    """Delivers noise, and the hits that are laid into it.

    `lay` may come from another thread than the others.

    Parameters
    ----------
    settings : VirtualRigSettings
        Digitizer and seed are used.
    block_size : int
        Points per block.
    depth : int
        Blocks that its buffer holds.
    """

    def __init__(self, settings: VirtualRigSettings, block_size: int, depth: int) -> None:
        self._settings = settings
        self._block_size = block_size
        self._depth = depth
        self._period = block_size / settings.digitizer.sampling_rate
        self._lock = threading.Lock()
        self._stream: VirtualStream | None = None
        self._clock = BlockClock(self._period, depth, time.monotonic())
        self._start_stamp = 0
        self._fetched: deque[int] = deque()
        self._next_look = 0.0

    def arm(self) -> None:
        """Begin the stream."""
        stream = VirtualStream(self._settings.digitizer, self._block_size, self._settings.seed)
        with self._lock:
            self._stream = stream
            self._fetched.clear()
            self._start_stamp, now = time.time_ns(), time.monotonic()
            self._clock = BlockClock(self._period, self._depth, now)
            self._next_look = now

    def disarm(self) -> None:
        """End it."""
        with self._lock:
            self._stream = None
            self._fetched.clear()

    def lay(self, hit: VirtualHit, contact: float) -> None:
        """Let a hit's contact be seen at a time of the monotonic clock [s]."""
        digitizer = self._settings.digitizer
        with self._lock:
            if self._stream is None:
                return
            begin = contact - self._clock.find_time(0) - digitizer.pre_trigger
            unsent = self._clock.next_block * self._block_size
            self._stream.lay(hit, max(round(begin * digitizer.sampling_rate), unsent))

    def read(self, timeout: float) -> AcquiredBlock | None:
        """Return the next block; None: there is none within so many seconds."""
        deadline = time.monotonic() + timeout
        while True:
            block = self._take()
            if block is not None:
                return block
            now = time.monotonic()
            if now >= deadline:
                return None
            time.sleep(max(min(self._find_next_look(), deadline) - now, 0.0))

    def _find_next_look(self) -> float:
        """Return when a block may be there [s]."""
        if self._stream is None:
            return math.inf
        return max(self._next_look, self._clock.find_time(self._clock.next_block + 1))

    def _take(self) -> AcquiredBlock | None:
        """Return the next block that has been fetched, or is due."""
        with self._lock:
            if self._stream is None:
                return None
            now = time.monotonic()
            if not self._fetched and now >= self._next_look:
                self._fetched.extend(self._clock.fetch(now))
                self._next_look = now + SHORTEST_TURN
            while self._fetched:
                number = self._fetched.popleft()
                if not (self._stream.has_hit(number) and self._stream.is_lost(number)):
                    return self._read(self._stream, number)
            return None

    def _read(self, stream: VirtualStream, number: int) -> AcquiredBlock:
        hammer, specimen = stream.read(number)
        return AcquiredBlock(
            first_sample=number * self._block_size,
            hammer=hammer,
            specimen=specimen,
            stamp=self._start_stamp + round(number * self._period * 1e9),
        )
