"""What the accelerometer node publishes of what its source delivers; flow and loss counted."""

import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from impact_rig.core.signals.record import ChannelBlock, HitLabel
from impact_rig.devices.acceleration_source import AcquiredBlock

NANO = 1e-9
NOTHING = ChannelBlock(np.empty(0, np.int32), scale=1.0, offset=0.0, full_scale=0.0)
"""Of a channel of which nothing is known yet."""


@dataclass
class Flow:
    """What has been published, counted.

    Attributes
    ----------
    blocks, points : int
        Published, points per channel.
    missing_points : int
        That the source has lost on their way, per channel.
    overloads : int
        Blocks in which the source says that a channel was driven beyond its range.
    delay : float
        From the last point of the newest block to its being published [s], as far as the source
        knows when it was taken.
    """

    blocks: int = 0
    points: int = 0
    missing_points: int = 0
    overloads: int = 0
    delay: float = 0.0


class BlockOutput(ABC):
    """Publishes a source's blocks, cut to size, as messages with the label of their arming.

    Called in one thread at a time; the flow may be read in any.

    Parameters
    ----------
    publisher : Publisher
        Of the messages.
    sampling_rate : float
        [Hz]
    block_size : int
        Points per message, at most.
    """

    def __init__(self, publisher: Any, sampling_rate: float, block_size: int) -> None:
        self.flow = Flow()
        self._publisher = publisher
        self._sampling_rate = sampling_rate
        self._block_size = block_size
        self._next_sample = 0
        self._newest: AcquiredBlock | None = None
        self._told = (time.monotonic(), 0)
        self._told_loss = 0

    @abstractmethod
    def begin(self, label: HitLabel) -> None:
        """Let what follows belong to an arming."""

    @abstractmethod
    def end(self, *, is_awaited: bool) -> bool:
        """End the arming under way, and its record; do nothing if there is none.

        Parameters
        ----------
        is_awaited : bool
            The hammer has been let go: a verdict must come, even if nothing has come so far.

        Returns
        -------
        bool
            Whether something was published that a verdict follows.
        """

    @abstractmethod
    def make_message(self, block: AcquiredBlock) -> Any:
        """Return the message of a block of the arming under way."""

    @abstractmethod
    def finish(self) -> None:
        """Say that the source will deliver no more; no arming is under way."""

    def restart(self) -> None:
        """Expect points to count from 0 again."""
        self._next_sample = 0

    def publish(self, block: AcquiredBlock) -> None:
        """Publish a block, in pieces if it is too long."""
        flow, size = self.flow, block.hammer.output.size
        for piece in split_block(block, self._block_size, self._sampling_rate):
            self._publisher.publish(self.make_message(piece))
            flow.blocks += 1
        flow.points += size
        flow.missing_points += max(block.first_sample - self._next_sample, 0)
        flow.overloads += block.hammer.overloaded or block.specimen.overloaded
        if block.stamp:
            age = NANO * (time.time_ns() - block.stamp)
            flow.delay = max(age - size / self._sampling_rate, 0.0)
        self._next_sample = block.first_sample + size
        self._newest = block

    def publish_end(self, first_sample: int) -> None:
        """Publish an empty last block of the arming under way."""
        self._publisher.publish(self.make_message(make_empty_block(self._newest, first_sample)))

    def find_warning(self) -> str:
        """Return what has been lost since this was asked last; empty: nothing."""
        lost = self.flow.missing_points - self._told_loss
        self._told_loss += lost
        if not lost:
            return ""
        return f"{lost} points of the source were lost: this computer does not hold its rate"

    def describe(self) -> dict[str, Any]:
        """Return the flow, the rate since this was asked last, by names for the diagnostics."""
        flow, now = self.flow, time.monotonic()
        (before, points), self._told = self._told, (now, flow.points)
        return {
            "blocks sent": flow.blocks,
            "points lost": flow.missing_points,
            "points per second": round((flow.points - points) / max(now - before, NANO)),
            "delay [s]": round(flow.delay, 4),
            "overloads": flow.overloads,
        }

    def find_stamp(self, block: AcquiredBlock) -> int:
        """Return when a block's first point was taken, nanoseconds since the epoch."""
        if block.stamp:
            return block.stamp
        return time.time_ns() - round(block.hammer.output.size / self._sampling_rate / NANO)


def split_block(block: AcquiredBlock, size: int, sampling_rate: float) -> Iterator[AcquiredBlock]:
    """Yield a block in pieces of `size` points at most; as it is if it is no longer.

    Parameters
    ----------
    block : AcquiredBlock
        To split; the device's word on overloads goes with every piece.
    size : int
        Points.
    sampling_rate : float
        For the pieces' time [Hz].
    """
    count = block.hammer.output.size
    if count <= size:
        yield block
        return
    for start in range(0, count, size):
        stop = min(start + size, count)
        yield AcquiredBlock(
            first_sample=block.first_sample + start,
            hammer=_cut(block.hammer, start, stop),
            specimen=_cut(block.specimen, start, stop),
            last=block.last and stop == count,
            stamp=block.stamp + round(start / sampling_rate / NANO) if block.stamp else 0,
        )


def make_empty_block(like: AcquiredBlock | None, first_sample: int) -> AcquiredBlock:
    """Return a last block without points, calibrated as another."""
    hammer, specimen = (like.hammer, like.specimen) if like else (NOTHING, NOTHING)
    return AcquiredBlock(
        first_sample=first_sample,
        hammer=_cut(hammer, 0, 0),
        specimen=_cut(specimen, 0, 0),
        last=True,
    )


def _cut(channel: ChannelBlock, start: int, stop: int) -> ChannelBlock:
    return replace(channel, output=channel.output[start:stop])
