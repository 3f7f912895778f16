"""What of a campaign is kept for a viewer that comes late, or again."""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable

from impact_rig.visualization.destinations.destination import (
    QUEUE_LENGTH,
    QUEUE_SIZE,
    SizedWork,
    Work,
)


class History:
    """The set-up, the newest version of what is replaced as a whole, and the last hits.

    Bounded like the queue of a destination, so that all of it passes through one.

    Attributes
    ----------
    forgotten : int
        How much of the campaign was too old to be kept [-].
    """

    def __init__(self) -> None:
        self._first: Work | None = None
        self._events: deque[SizedWork] = deque()
        self._size = 0
        self._latest: dict[Hashable, Work] = {}
        self.forgotten = 0

    def begin(self, work: Work) -> None:
        """Keep what a campaign begins with, and nothing of those before it."""
        self._first = work
        self._events.clear()
        self._latest.clear()
        self._size = 0
        self.forgotten = 0

    def put(self, work: Work, size: int) -> None:
        """Keep something of `size` bytes, in place of the oldest if there is too much."""
        self._events.append((work, size))
        self._size += size
        while self._events and (len(self._events) > QUEUE_LENGTH or self._size > QUEUE_SIZE):
            self._size -= self._events.popleft()[1]
            self.forgotten += 1

    def put_latest(self, key: Hashable, work: Work) -> None:
        """Keep something in place of what `key` had."""
        self._latest[key] = work

    def list_works(self) -> list[SizedWork]:
        """Return all that is kept, in the order in which it is to be logged."""
        first = [] if self._first is None else [(self._first, 0)]
        return [*first, *self._events, *((work, 0) for work in self._latest.values())]
