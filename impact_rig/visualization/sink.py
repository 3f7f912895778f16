"""Where the view goes: a file, a viewer elsewhere, a viewer of our own.

Logging into Rerun waits without limit for a viewer that does not take its data, and then a file
logged to at the same time gets nothing either. So each destination has a recording stream and a
thread of its own and a queue of bounded length: whoever hands work over never waits.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Hashable
from typing import TYPE_CHECKING

from impact_rig.visualization.log import ViewLog

if TYPE_CHECKING:
    import rerun as rr

Work = Callable[[ViewLog], None]
Notice = Callable[[str], None]

QUEUE_LENGTH = 256
"""Views that may wait for a destination [-], our choice: some seconds of a fast campaign, about
20 MB of traces. What comes on top is dropped."""
FLUSH_TIMEOUT = 3.0
"""How long a viewer may take to accept what it was sent [s], our choice: a viewer that draws
slowly still reads its socket at once."""
CLOSE_TIMEOUT = 5.0
"""How long the end may take [s], below what process managers grant."""


class Destination:
    """One place where the view goes.

    Parameters
    ----------
    name : str
        For people: the file, or the viewer's address.
    stream : rerun.RecordingStream
        Logging goes there, from a thread of this object alone; closed by `close`.
    refresh_period : float
        Least time between two versions of what is replaced as a whole [s].
    notify : callable
        Told in one sentence, once, when the destination is lost; called from another thread.
    """

    def __init__(
        self, name: str, stream: rr.RecordingStream, refresh_period: float, notify: Notice
    ) -> None:
        self.name = name
        self._stream = stream
        self._log = ViewLog(stream)
        self._period = refresh_period
        self._notify = notify
        self._queue: deque[Work] = deque()
        self._latest: dict[Hashable, Work] = {}
        self._next_refresh = time.monotonic()
        self._condition = threading.Condition()
        self._is_closing = False
        self._is_lost = False
        self.dropped = 0
        # A daemon: a viewer that never takes its data must not keep the process from ending.
        self._thread = threading.Thread(target=self._run, name=f"view to {name}", daemon=True)
        self._thread.start()

    @property
    def is_lost(self) -> bool:
        """Whether the destination took its data no longer; then everything is dropped."""
        return self._is_lost

    def put(self, work: Work) -> None:
        """Queue something to be logged, or drop it if the destination is too far behind."""
        with self._condition:
            if self._is_lost or self._is_closing or len(self._queue) >= QUEUE_LENGTH:
                self.dropped += 1
                return
            self._queue.append(work)
            self._condition.notify()

    def put_latest(self, key: Hashable, work: Work) -> None:
        """Keep something to be logged with the next refresh, in place of what `key` had."""
        with self._condition:
            if self._is_lost or self._is_closing:
                self.dropped += 1
                return
            self._latest[key] = work
            self._condition.notify()

    def close(self, timeout: float = CLOSE_TIMEOUT) -> None:
        """Log what is queued, close the stream, and give up after `timeout` seconds.

        A file is complete and readable afterwards. Safe to call twice.
        """
        with self._condition:
            self._is_closing = True
            self._condition.notify()
        if not self._is_lost:
            self._thread.join(timeout)
        if self._thread.is_alive():
            self._lose(f"{self.name} took its data too slowly and was given up")

    def _run(self) -> None:
        try:
            is_last = False
            while not is_last:
                batch, is_last = self._take()
                for work in batch:
                    work(self._log)
                self._stream.flush(timeout_sec=FLUSH_TIMEOUT)
        except RuntimeError as error:
            self._lose(f"{self.name} takes no more data, the rig goes on without it: {error}")
        finally:
            # A file becomes complete by this; with a viewer that is stuck it never returns.
            self._stream.disconnect()

    def _take(self) -> tuple[list[Work], bool]:
        """Wait for work; return it, and whether it is the last."""
        with self._condition:
            while not (self._queue or self._is_closing or self._is_refresh_due()):
                pause = self._next_refresh - time.monotonic() if self._latest else None
                self._condition.wait(pause)
            batch = list(self._queue)
            self._queue.clear()
            if self._is_closing or self._is_refresh_due():
                batch += self._latest.values()
                self._latest.clear()
                self._next_refresh = time.monotonic() + self._period
            return batch, self._is_closing

    def _is_refresh_due(self) -> bool:
        return bool(self._latest) and time.monotonic() >= self._next_refresh

    def _lose(self, why: str) -> None:
        with self._condition:
            if self._is_lost:
                return
            self._is_lost = True
            self.dropped += len(self._queue) + len(self._latest)
            self._queue.clear()
            self._latest.clear()
        self._notify(why)
