"""The newest points of a stream, by their places in it, with the gaps between them."""

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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

    def find_runs(self, start: int, stop: int) -> list[Run]:
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
