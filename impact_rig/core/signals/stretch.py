"""A stretch of the stream without a gap, kept as long as a hit may still need it."""

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.signals.record import Block, RawArray


class Stretch:
    """Blocks that follow each other without a gap; points are counted since arming.

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
        self._chunks: deque[tuple[int, RawArray, RawArray]] = deque()

    def append(self, block: Block) -> None:
        """Take the block that follows."""
        self._chunks.append((self.stop, block.hammer.output, block.specimen.output))
        self.stop += block.hammer.output.size

    def read(self, first: int, last: int) -> tuple[RawArray, RawArray]:
        """Return hammer and sample from point `first` up to `last`, as far as they are there.

        At least one such point must be there, and none of them forgotten.
        """
        hammers: list[NDArray[Any]] = []
        specimens: list[NDArray[Any]] = []
        for start, hammer, specimen in reversed(self._chunks):
            if start + hammer.size <= first:
                break
            window = slice(max(first - start, 0), max(last - start, 0))
            hammers.append(hammer[window])
            specimens.append(specimen[window])
        return np.concatenate(hammers[::-1]), np.concatenate(specimens[::-1])

    def forget(self, index: int) -> None:
        """Forget whole blocks that lie before the point `index`."""
        while self._chunks and self._chunks[0][0] + self._chunks[0][1].size <= index:
            self._chunks.popleft()
