"""Segments of a stream without a gap, and the gaps between them.

Gaps are found and named, and nothing is put in their place.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.signals.record import Block, RawArray


class _Chunk(NamedTuple):
    """What one block brought: points from `start` up to `stop`."""

    start: int
    stop: int
    hammer: RawArray
    specimen: RawArray
    stamp: int
    overloads: tuple[bool, bool]


class Segment:
    """Blocks that follow each other without a gap.

    Parameters
    ----------
    block : Block
        The first one, not yet appended: rate, calibration and time of the segment are its.
    search_from : int
        What lies before this point belongs to a hit already.

    Attributes
    ----------
    block : Block
        The first one.
    start, stop : int
        First point of the segment, and the one behind its last.
    searched : int
        Where the search for the next pulse goes on.
    """

    def __init__(self, block: Block, search_from: int) -> None:
        self.block = block
        self.start = self.stop = block.first_sample
        self.searched = max(search_from, self.start)
        self._chunks: deque[_Chunk] = deque()

    def append(self, block: Block) -> None:
        """Take the block that follows."""
        stop = self.stop + block.hammer.output.size
        self._chunks.append(
            _Chunk(
                self.stop,
                stop,
                block.hammer.output,
                block.specimen.output,
                block.stamp,
                (block.hammer.overloaded, block.specimen.overloaded),
            )
        )
        self.stop = stop

    def read(self, first: int, last: int) -> tuple[RawArray, RawArray]:
        """Return hammer and sample from point `first` up to `last`, as far as they are there.

        At least one such point must be there, and none of them forgotten.
        """
        hammers: list[NDArray[Any]] = []
        specimens: list[NDArray[Any]] = []
        for chunk in reversed(self._chunks):
            if chunk.stop <= first:
                break
            window = slice(max(first - chunk.start, 0), max(last - chunk.start, 0))
            hammers.append(chunk.hammer[window])
            specimens.append(chunk.specimen[window])
        if len(hammers) == 1:
            return hammers[0], specimens[0]
        return np.concatenate(hammers[::-1]), np.concatenate(specimens[::-1])

    def read_hammer(self, first: int, last: int) -> Iterator[tuple[int, RawArray]]:
        """Yield what the hammer's blocks hold from point `first` up to `last`, and where."""
        # What has not been read yet lies at the end, most often in the last block.
        chunks = self._chunks
        index = len(chunks)
        while index and chunks[index - 1].stop > first:
            index -= 1
        for number in range(index, len(chunks)):
            chunk = chunks[number]
            if chunk.start >= last:
                break
            begin = max(first, chunk.start)
            yield begin, chunk.hammer[begin - chunk.start : last - chunk.start]

    def get_overloads(self, first: int, last: int) -> tuple[bool, bool]:
        """Return whether the device called hammer and sample overloaded from `first` to `last`."""
        hammers, specimens = [False], [False]
        for chunk in reversed(self._chunks):
            if chunk.stop <= first:
                break
            if chunk.start < last:
                hammers.append(chunk.overloads[0])
                specimens.append(chunk.overloads[1])
        return any(hammers), any(specimens)

    def get_time(self, point: int) -> int:
        """Return when a point was taken, by its own block, nanoseconds since the epoch."""
        for chunk in reversed(self._chunks):
            if chunk.start <= point:
                delay = (point - chunk.start) / self.block.sampling_rate
                return chunk.stamp + round(delay * 1e9)
        return self.block.stamp

    def forget(self, index: int) -> None:
        """Forget whole blocks that lie before the point `index`."""
        while self._chunks and self._chunks[0].stop <= index:
            self._chunks.popleft()


@dataclass(frozen=True)
class Gap:
    """A place where the stream does not go on as it should.

    Attributes
    ----------
    low, high : int
        First point that is concerned, and the one behind the last; equal where nothing is
        missing and something else has changed.
    description : str
        In words.
    is_backward : bool
        Points are repeated, or the stream has begun anew.
    """

    low: int
    high: int
    description: str
    is_backward: bool = False


class Continuity:
    """Holds each block of a stream against the one before it.

    Parameters
    ----------
    expected : int or None
        First point of the first block; None: whatever it is.

    Attributes
    ----------
    previous : Block or None
        The last block that came.
    expected : int or None
        First point of the next one.
    """

    def __init__(self, expected: int | None) -> None:
        self.previous: Block | None = None
        self.expected = expected

    def follow(self, block: Block) -> Gap | None:
        """Take the next block; return what lies between it and the one before, if it is bad."""
        previous, expected, start = self.previous, self.expected, block.first_sample
        self.previous = block
        self.expected = start + block.hammer.output.size
        if expected is None:
            return None
        if start > expected:
            what = f"{start - expected} points missing at point {expected}"
            return Gap(expected, start, what)
        if start < expected:
            what = f"{expected - start} points repeated at point {start}"
            return Gap(start, expected, what, is_backward=True)
        if previous is not None and not _is_alike(previous, block):
            what = f"sampling rate, channels or calibration changed at point {start}"
            return Gap(start, start, what)
        return None


def _is_alike(block: Block, other: Block) -> bool:
    """Whether two blocks may be joined: equal rate, channels and calibration."""
    # A block without points does not show whether the sample is measured.
    shows_channels = block.hammer.output.size > 0 and other.hammer.output.size > 0
    return (
        block.sampling_rate == other.sampling_rate
        and (block.has_specimen == other.has_specimen or not shows_channels)
        and block.hammer.has_calibration_of(other.hammer)
        and block.specimen.has_calibration_of(other.specimen)
    )
