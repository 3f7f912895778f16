"""When and how the virtual digitizer delivers: a record for each trigger, or a running stream."""

import threading
import time
from collections import deque
from dataclasses import dataclass, replace
from zlib import crc32

import numpy as np

from impact_rig.core.records import Block, ChannelBlock, RawArray
from impact_rig.devices.virtual.choices import Fault
from impact_rig.devices.virtual.rig import (
    CountArray,
    DigitizerSettings,
    VirtualHit,
    VirtualRigSettings,
    compute_scale,
    digitize,
)

MOST_NOISE_BLOCKS = 50
"""Different blocks of noise, drawn once and used in turn: drawing is slower than the stream. No
chunk of a recording holds one twice."""
MOST_NOISE_POINTS = 2_500_000  # per channel, where blocks are long: 20 MB in all
FEWEST_NOISE_BLOCKS = 2


@dataclass(frozen=True)
class _LaidHit:
    """A hit's record in the stream, from a point on."""

    point: int
    hit: VirtualHit

    @property
    def stop(self) -> int:
        return self.point + self.hit.hammer.output.size


class VirtualStream:
    """The digitizer's endless stream of blocks: noise, and the hits laid into it.

    Blocks are counted from 0 and may be asked for in rising order only: a hit is forgotten when
    the stream has passed it.

    Parameters
    ----------
    settings : DigitizerSettings
        The acquisition chain; `drift`, which belongs to a record, is left out between hits.
    block_size : int
        Points per block.
    seed : int
        Of the noise.
    """

    def __init__(self, settings: DigitizerSettings, block_size: int, seed: int) -> None:
        self.block_size = block_size
        self._settings = replace(settings, drift=0.0)
        fitting = max(MOST_NOISE_POINTS // block_size, FEWEST_NOISE_BLOCKS)
        generator = np.random.default_rng(np.random.SeedSequence((seed, crc32(b"stream"))))
        self.noise = tuple(
            tuple(
                self._draw_noise(full_scale, generator)
                for full_scale in (settings.hammer_full_scale, settings.specimen_full_scale)
            )
            for _ in range(min(fitting, MOST_NOISE_BLOCKS))
        )
        """Blocks without a hit, hammer and sample: block `n` of the stream is `n` modulo their
        number."""
        self._hits: list[_LaidHit] = []

    def _draw_noise(self, full_scale: float, generator: np.random.Generator) -> ChannelBlock:
        rest = np.zeros(self.block_size)
        counts = digitize(rest, full_scale, self._settings, generator)
        counts.setflags(write=False)
        return ChannelBlock(
            counts, compute_scale(full_scale, self._settings.bits), 0.0, full_scale
        )

    def lay(self, hit: VirtualHit, point: int) -> None:
        """Let the record of a hit begin at a point of the stream; one without a trigger has none.

        Parameters
        ----------
        hit : VirtualHit
            As the virtual rig struck it.
        point : int
            Where its record begins, not before what has been handed out.
        """
        if Fault.MISSED_TRIGGER not in hit.faults:
            self._hits.append(_LaidHit(point, hit))

    def has_hit(self, number: int) -> bool:
        """Return whether a block holds a part of a hit; forget hits that lie before it."""
        if not self._hits:
            return False
        first = number * self.block_size
        self._hits = [laid for laid in self._hits if laid.stop > first]
        return any(laid.point < first + self.block_size for laid in self._hits)

    def is_lost(self, number: int) -> bool:
        """Return whether a block is lost: the middle one of a hit with this fault."""
        return any(
            Fault.LOST_BLOCK in laid.hit.faults
            and (laid.point + laid.stop) // 2 // self.block_size == number
            for laid in self._hits
        )

    def read(self, number: int) -> tuple[ChannelBlock, ChannelBlock]:
        """Return hammer and sample of a block, with the hits in it."""
        hammer, specimen = self.noise[number % len(self.noise)]
        if not self.has_hit(number):
            return hammer, specimen
        first = number * self.block_size
        return (
            _lay_into(hammer, [(laid.point - first, laid.hit.hammer) for laid in self._hits]),
            _lay_into(specimen, [(laid.point - first, laid.hit.specimen) for laid in self._hits]),
        )


def _lay_into(noise: ChannelBlock, records: list[tuple[int, ChannelBlock]]) -> ChannelBlock:
    """Return a block of noise with records, each from its own point on, in place of it."""
    counts: CountArray = np.array(noise.output, dtype=np.int32)
    for point, record in records:
        low, high = max(point, 0), min(point + record.output.size, counts.size)
        if low < high:
            part: RawArray = record.output[low - point : high - point]
            counts[low:high] = part
    counts.setflags(write=False)
    return replace(noise, output=counts)


SHORTEST_TURN = 5e-3  # [s], between two looks at the clock: each costs as much as a block


class StreamingDigitizer:
    """Delivers noise, and the hits that are laid into it.

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
        self._stream: VirtualStream | None = None
        self._start, self._start_stamp = 0.0, 0
        self._next = 0  # block to be read

    def arm(self) -> None:
        """Begin the stream."""
        stream = VirtualStream(self._settings.digitizer, self._block_size, self._settings.seed)
        with self._lock:
            self._stream, self._next = stream, 0
            self._start_stamp, self._start = time.time_ns(), time.monotonic()

    def disarm(self) -> None:
        """End it."""
        with self._lock:
            self._stream = None

    def lay_hit(self, hit: VirtualHit, contact: float) -> None:
        """Let a hit's contact be seen at a time of the monotonic clock [s]."""
        digitizer = self._settings.digitizer
        with self._lock:
            if self._stream is not None:
                begin = contact - self._start - digitizer.pre_trigger
                unsent = self._next * self._block_size
                self._stream.lay(hit, max(round(begin * digitizer.sampling_rate), unsent))

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
            stream = self._stream
            complete = int((time.monotonic() - self._start) / self._period)
            self._next = max(self._next, complete - self._depth)
            while stream is not None and self._next < complete:
                number, self._next = self._next, self._next + 1
                if not (stream.has_hit(number) and stream.is_lost(number)):
                    return self._read(stream, number)
            return None

    def _read(self, stream: VirtualStream, number: int) -> Block:
        hammer, specimen = stream.read(number)
        return Block(
            first_sample=number * self._block_size,
            sampling_rate=self._settings.digitizer.sampling_rate,
            hammer=hammer,
            specimen=specimen,
            stamp=self._start_stamp + round(number * self._period * 1e9),
            origin=self._settings.origin,
        )


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
