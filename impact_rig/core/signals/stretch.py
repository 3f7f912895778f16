"""A stretch of the stream without a gap, kept as long as a hit may still need it."""

from collections import deque
from collections.abc import Iterator
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


class Stretch:
    """Blocks that follow each other without a gap.

    Parameters
    ----------
    block : Block
        The first one, not yet appended: rate, calibration and time of the stretch are its.
    search_from : int
        What lies before this point belongs to a hit already.

    Attributes
    ----------
    block : Block
        The first one.
    start, stop : int
        First point of the stretch, and the one behind its last.
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

    def find_overloads(self, first: int, last: int) -> tuple[bool, bool]:
        """Return whether the device called hammer and sample overloaded from `first` to `last`."""
        hammers, specimens = [False], [False]
        for chunk in reversed(self._chunks):
            if chunk.stop <= first:
                break
            if chunk.start < last:
                hammers.append(chunk.overloads[0])
                specimens.append(chunk.overloads[1])
        return any(hammers), any(specimens)

    def find_time(self, point: int) -> int:
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
