"""How many blocks may be under way to those who listen to a replay."""

import threading
import time
from collections import deque
from collections.abc import Callable
from itertools import groupby

WINDOW = 100
"""Blocks that may be under way and not yet judged [-]: half of what the subscribers' queues
hold."""
JUDGEMENT_TIMEOUT = 5.0
"""How long an estimator may be silent before its verdicts are no longer waited for [s], our
choice: a hundred times what it needs."""
SETTLING_TIME = 0.2
"""How long after its verdict what is left of a record may take to be read from the queue [s], our
choice: a window of blocks that need no evaluation takes a tenth of it."""
LOOK_PERIOD = 0.1
"""How soon a wait notices that it is to end [s]."""
COUNT_PERIOD = 0.002
"""How often a count that tells of no change is looked at [s], our choice: a block's evaluation
takes as long."""


class Window:
    """Keeps the blocks under way few enough for the subscribers' queues, wherever those are.

    The middleware tells what has arrived in a queue, but not what was taken out of it: only a
    verdict proves that the estimator has seen a record's blocks. Where nobody judges, arrival
    must do.

    Parameters
    ----------
    has_judge : callable
        Returns whether an estimator is there.
    wait_for_delivery : callable
        Returns when all that was published has arrived.
    is_stopped : callable
        Returns whether the replay is to end.
    """

    def __init__(
        self,
        has_judge: Callable[[], bool],
        wait_for_delivery: Callable[[], None],
        is_stopped: Callable[[], bool],
    ) -> None:
        self._has_judge = has_judge
        self._wait_for_delivery = wait_for_delivery
        self._is_stopped = is_stopped
        self._is_judged = True
        self._pending: deque[int] = deque()
        self._unjudged: list[int] = []
        self._last_judged: int | None = None
        self._last_verdict = time.monotonic()
        self._changed = threading.Condition()

    def add(self, record: int, *, is_last: bool, is_free: bool) -> None:
        """Note that a block of a record is on its way.

        Parameters
        ----------
        record : int
            Whose block it is.
        is_last : bool
            Whether it ends the record.
        is_free : bool
            Whether it may wait here until it may be sent; else it has its time to keep.
        """
        if is_free:
            self._wait(lambda: len(self._pending) < WINDOW)
        with self._changed:
            if is_free:
                self._pending.append(record)
            # The verdict may come before the record's end.
            if is_last and record != self._last_judged:
                self._unjudged.append(record)

    def note_verdict(self, record: int) -> None:
        """Note that a record was judged, and with it all that was sent before it."""
        with self._changed:
            self._last_verdict, self._last_judged = time.monotonic(), record
            runs = [(number, len(list(blocks))) for number, blocks in groupby(self._pending)]
            numbers = [number for number, _ in runs]
            if record in numbers:
                for _ in range(sum(count for _, count in runs[: numbers.index(record) + 1])):
                    self._pending.popleft()
            if record in self._unjudged:
                del self._unjudged[: self._unjudged.index(record) + 1]
            self._changed.notify_all()

    def begin_campaign(self) -> None:
        """Wait until a set-up may be sent: it begins the estimates afresh."""
        self.drain()

    def drain(self) -> None:
        """Wait until every record that was sent whole is judged and read."""
        if (self._pending or self._unjudged) and self._has_judge():
            self._wait(lambda: not self._unjudged)
            with self._changed:
                self._changed.wait_for(self._is_stopped, SETTLING_TIME)
        self._forget()
        self._last_judged = None
        self._is_judged = True

    def _forget(self) -> None:
        with self._changed:
            self._pending.clear()
            self._unjudged.clear()

    def _wait(self, is_done: Callable[[], bool]) -> None:
        """Wait for verdicts, or where nobody gives any, for arrival."""
        begin = time.monotonic()
        while not is_done() and not self._is_stopped():
            silent = time.monotonic() - max(begin, self._last_verdict)
            self._is_judged = self._is_judged and silent < JUDGEMENT_TIMEOUT
            with self._changed:
                if self._is_judged and self._has_judge():
                    self._changed.wait_for(is_done, LOOK_PERIOD)
                    continue
            self._wait_for_delivery()
            self._forget()


class CountedWindow:
    """The same for an estimator in this process, which can be asked what it has taken.

    Parameters
    ----------
    count_taken : callable
        Returns how many set-ups and blocks the estimator has taken so far [-].
    is_stopped : callable
        Returns whether the replay is to end.
    """

    def __init__(self, count_taken: Callable[[], int], is_stopped: Callable[[], bool]) -> None:
        self._count_taken = count_taken
        self._is_stopped = is_stopped
        self._sent = count_taken()

    def add(self, record: int, *, is_last: bool, is_free: bool) -> None:
        """Wait until a block may be sent, and note that it is on its way."""
        self._wait_for(self._sent + 1 - WINDOW)
        self._sent += 1

    def note_verdict(self, record: int) -> None:
        """Take a verdict, which tells nothing new."""

    def begin_campaign(self) -> None:
        """Wait until a set-up may be sent, and note that it is on its way."""
        self.drain()
        self._sent += 1

    def drain(self) -> None:
        """Wait until the estimator has taken everything."""
        self._wait_for(self._sent)

    def _wait_for(self, count: int) -> None:
        while self._count_taken() < count and not self._is_stopped():
            time.sleep(COUNT_PERIOD)
