"""When and how the virtual digitizer delivers: a record for each trigger, or a running stream."""

import threading
import time
from collections import deque
from dataclasses import replace
from zlib import crc32

import numpy as np

from impact_rig.core.given.records import NO_SPEED, Block, ChannelBlock
from impact_rig.devices.virtual.choices import Fault
from impact_rig.devices.virtual.rig import (
    CountArray,
    VirtualHit,
    VirtualRigSettings,
    make_channel,
)

MOST_NOISE_BLOCKS = 50
"""Different blocks of noise, drawn once and used in turn: drawing is slower than the stream. No
chunk of a recording holds one twice."""
MOST_NOISE_POINTS = 2_500_000  # per channel, where blocks are long: 20 MB in all
SHORTEST_TURN = 5e-3  # [s], between two looks at the clock: each costs as much as a block


class StreamingDigitizer:
    """Delivers noise without end, and the hits that are laid into it.

    What is not read before its buffer is full is lost, the oldest first. `lay_hit` may come from
    another thread than the others.

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
        self._is_armed = False
        self._start, self._start_stamp = 0.0, 0
        self._next = 0  # block to be read
        self._hits: list[tuple[int, VirtualHit]] = []  # with the points where they begin
        self.noise = self._draw_noise()

    def _draw_noise(self) -> list[tuple[ChannelBlock, ...]]:
        """Return blocks without a hit, hammer and sample."""
        digitizer, rest = self._settings.digitizer, np.zeros(self._block_size)
        seeds = np.random.SeedSequence((self._settings.seed, crc32(b"stream")))
        generator = np.random.default_rng(seeds)

        scales = digitizer.hammer_full_scale, digitizer.specimen_full_scale
        fitting = max(MOST_NOISE_POINTS // self._block_size, 2)
        return [
            tuple(make_channel(rest, scale, digitizer, generator) for scale in scales)
            for _ in range(min(fitting, MOST_NOISE_BLOCKS))
        ]

    def arm(self) -> None:
        """Begin the stream."""
        with self._lock:
            self._is_armed, self._next, self._hits = True, 0, []
            self._start_stamp, self._start = time.time_ns(), time.monotonic()

    def disarm(self) -> None:
        """End it."""
        with self._lock:
            self._is_armed = False

    def lay_hit(self, hit: VirtualHit, contact: float) -> None:
        """Let a hit's contact be seen at a time of the monotonic clock [s]."""
        digitizer = self._settings.digitizer
        with self._lock:
            if self._is_armed and Fault.MISSED_TRIGGER not in hit.faults:
                begin = contact - self._start - digitizer.pre_trigger
                unsent = self._next * self._block_size
                point = max(round(begin * digitizer.sampling_rate), unsent)
                self._hits.append((point, hit))

    def read(self, timeout: float) -> Block | None:
        """Return the next block; None: there is none within so many seconds."""
        deadline = time.monotonic() + timeout
        while (block := self._take()) is None:
            now = time.monotonic()
            if now >= deadline:
                return None
            due = self._start + (self._next + 1) * self._period
            time.sleep(min(max(due - now, SHORTEST_TURN), deadline - now))
        return block

    def _take(self) -> Block | None:
        """Return the next block that is complete and not lost."""
        with self._lock:
            complete = int((time.monotonic() - self._start) / self._period) * self._is_armed
            self._next = max(self._next, complete - self._depth)
            while self._next < complete:
                self._next += 1
                if block := self.make_block(self._next - 1):
                    return block
            return None

    def make_block(self, number: int) -> Block | None:
        """Return a block, in rising order; None: the middle one of a hit with this fault."""
        size, first = self._block_size, number * self._block_size
        self._hits = [item for item in self._hits if item[0] + item[1].hammer.output.size > first]
        hammer, specimen = self.noise[number % len(self.noise)]
        speed = NO_SPEED
        for point, hit in self._hits:
            middle = point + hit.hammer.output.size // 2
            if Fault.LOST_BLOCK in hit.faults and first <= middle < first + size:
                return None
            contact = point + round(self._settings.digitizer.pre_trigger * hit.sampling_rate)
            if first <= contact < first + size:
                speed = hit.speed
            hammer = _lay_into(hammer, hit.hammer, point - first)
            specimen = _lay_into(specimen, hit.specimen, point - first)
        return Block(
            first_sample=first,
            sampling_rate=self._settings.digitizer.sampling_rate,
            hammer=hammer,
            specimen=specimen,
            stamp=self._start_stamp + round(number * self._period * 1e9),
            origin=self._settings.origin,
            impact_speed=speed,
        )


def _lay_into(noise: ChannelBlock, record: ChannelBlock, point: int) -> ChannelBlock:
    """Return a block of noise with a record, from a point on, in place of it."""
    low, high = max(point, 0), min(point + record.output.size, noise.output.size)
    if low >= high:
        return noise
    counts: CountArray = np.array(noise.output, dtype=np.int32)
    counts[low:high] = record.output[low - point : high - point]
    return replace(noise, output=counts)


class TriggeredDigitizer:
    """Delivers the record of a hit when the hammer strikes.

    `lay_hit` may come from another thread than the others.

    Parameters
    ----------
    block_size : int
        Points per block.
    """

    def __init__(self, block_size: int) -> None:
        self._block_size = block_size
        self._changed = threading.Condition()
        self._is_armed = False
        self._blocks: deque[Block] = deque()
        self._due = 0.0  # contact, by the monotonic clock [s]

    def arm(self) -> None:
        """Wait for one hit."""
        with self._changed:
            self._blocks.clear()
            self._is_armed = True

    def disarm(self) -> None:
        """Forget the hit."""
        with self._changed:
            self._blocks.clear()
            self._is_armed = False

    def lay_hit(self, hit: VirtualHit, contact: float) -> None:
        """Let a hit trigger at a time of the monotonic clock [s], unless its trigger is missed."""
        stamp = time.time_ns() + round((contact - time.monotonic()) * 1e9)
        with self._changed:
            if self._is_armed and Fault.MISSED_TRIGGER not in hit.faults:
                self._is_armed = False
                self._blocks.extend(hit.split(self._block_size, stamp))
                self._due = contact
                self._changed.notify()

    def read(self, timeout: float) -> Block | None:
        """Return the next block; None: it has not come within so many seconds."""
        deadline = time.monotonic() + timeout
        with self._changed:
            while True:
                now = time.monotonic()
                if self._blocks and now >= self._due:
                    return self._blocks.popleft()
                until = min(deadline, self._due) if self._blocks else deadline
                if now >= until:
                    return None
                self._changed.wait(until - now)
