"""Where the view goes: each place is fed by a thread of its own.

Logging into Rerun waits without limit for a viewer that does not take its data, and then a file
logged to at the same time gets nothing either. So each destination has a recording stream and a
thread of its own and a queue of bounded length: whoever hands work over never waits.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from impact_rig.core.errors import ParameterError, RigError
from impact_rig.present.rerun.addresses import (
    LOOPBACK,
    check_listen_address,
    check_viewer_address,
)
from impact_rig.present.rerun.view_log import ViewLog

if TYPE_CHECKING:
    import rerun as rr

Work = Callable[[ViewLog], None]
SizedWork = tuple[Work, int]
"""Something to be logged, and about how much it is [byte]."""
Notice = Callable[[str], None]

QUEUE_LENGTH = 512
"""Views that may wait for a destination [-], our choice: some seconds of a fast campaign. What
comes on top is dropped."""
QUEUE_SIZE = 64 * 2**20
"""The same in bytes, our choice: 400 records as the paper has them."""
FLUSH_SIZE = 2**20
"""After how much it is seen to that a viewer has taken it [byte], our choice: within
`FLUSH_TIMEOUT` a slow network passes so much on."""
FLUSH_TIMEOUT = 3.0
"""How long a viewer may take to accept what it was sent [s], our choice: a viewer that draws
slowly still reads its socket at once."""
CLOSE_TIMEOUT = 5.0
"""How long the end may take [s], below what process managers grant."""


@dataclass(frozen=True)
class DestinationPlan:
    """Where the view is to go: any of these, or several at once.

    Attributes
    ----------
    output : str
        Path of an .rrd file to be written, replaced if it exists; empty: none.
    connect : str
        Address of a viewer elsewhere, ``rerun+http://HOST:9876/proxy``; empty: none. It may come
        late, close and come back.
    spawn : bool
        Open a viewer on this host. It may be closed and opened again.
    web : bool
        Serve a web page with a viewer.
    listen : str
        IP address that relay and web page listen on.
    relay_port, web_port : int
        Of these; 0: any free one.

    Raises
    ------
    ParameterError
        If nothing was asked for, or an address is none.
    """

    output: str = ""
    connect: str = ""
    spawn: bool = False
    web: bool = False
    listen: str = LOOPBACK
    relay_port: int = 0
    web_port: int = 0

    def __post_init__(self) -> None:
        """Check what was asked for."""
        if not (self.output or self.connect or self.spawn or self.web):
            raise ParameterError(
                "nothing shows the view: set output to the path of an .rrd file, connect to the"
                " address of a viewer, or spawn or web to true"
            )
        if self.connect:
            check_viewer_address(self.connect)
        check_listen_address(self.listen)


class StreamDestination:
    """A destination that is one recording stream: once lost, it stays lost.

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
    backlog : sequence of SizedWork
        Logged before everything else.
    """

    def __init__(
        self,
        name: str,
        stream: rr.RecordingStream,
        refresh_period: float,
        notify: Notice,
        backlog: Sequence[SizedWork] = (),
    ) -> None:
        self.name = name
        self._stream = stream
        self._log = ViewLog(stream)
        self._period = refresh_period
        self._notify = notify
        self._queue: deque[SizedWork] = deque(backlog)
        self._size = 0
        self._latest: dict[Hashable, Work] = {}
        self._next_refresh = time.monotonic()
        self._condition = threading.Condition()
        self._is_closing = False
        self._is_lost = False
        self._dropped = 0
        self._last_notice = ""
        # A daemon: a viewer that never takes its data must not keep the process from ending.
        self._thread = threading.Thread(target=self._run, name=f"view to {name}", daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """How many views it misses [-]: it was too far behind, or lost."""
        return self._dropped

    @property
    def is_lost(self) -> bool:
        """Whether the destination took its data no longer; then everything is dropped."""
        return self._is_lost

    def begin(self, work: Work) -> None:
        """Queue what a campaign begins with, after the newest of the campaign before it."""
        with self._condition:
            if self._is_lost or self._is_closing:
                self._dropped += 1
                return
            self._queue.extend((last, 0) for last in (*self._latest.values(), work))
            self._latest.clear()
            self._condition.notify()

    def put(self, work: Work, size: int = 0, *, key: Hashable = None) -> None:
        """Queue something to be logged, or drop it if the destination is too far behind.

        Parameters
        ----------
        work : callable
            Logs it.
        size : int
            About how much it is [byte].
        key : hashable, optional
            It waits for the next refresh, in place of what the key had.
        """
        with self._condition:
            is_full = len(self._queue) >= QUEUE_LENGTH or self._size + size > QUEUE_SIZE
            if self._is_lost or self._is_closing or (is_full and key is None):
                self._dropped += 1
                return
            if key is None:
                self._queue.append((work, size))
                self._size += size
            else:
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

    def wait_for_end(self) -> None:
        """Wait until the stream is closed: by `close`, or after it was lost."""
        self._thread.join()

    def _run(self) -> None:
        try:
            is_last = False
            while not is_last:
                batch, is_last = self._take()
                self._write(batch)
        except RuntimeError as error:
            self._lose(f"{self.name} takes no more data, the rig goes on without it: {error}")
        finally:
            if not self._is_closing:
                self._lose(f"{self.name} shows nothing any more: something cannot be drawn")
            # A file becomes complete by this; with a viewer that is stuck it never returns.
            self._stream.disconnect()

    def _take(self) -> tuple[list[SizedWork], bool]:
        """Wait for work; return it, and whether it is the last."""
        with self._condition:
            while not (self._queue or self._is_closing or self._is_refresh_due()):
                pause = self._next_refresh - time.monotonic() if self._latest else None
                self._condition.wait(pause)
            batch = list(self._queue)
            self._queue.clear()
            self._size = 0
            if self._is_closing or self._is_refresh_due():
                batch += [(work, 0) for work in self._latest.values()]
                self._latest.clear()
                self._next_refresh = time.monotonic() + self._period
            return batch, self._is_closing

    def _write(self, batch: Sequence[SizedWork]) -> None:
        unflushed = 0
        for work, size in batch:
            try:
                work(self._log)
            except RigError as error:
                self._leave_out(f"{self.name}: a view is left out: {error}")
            unflushed += size
            if unflushed >= FLUSH_SIZE:
                self._flush()
                unflushed = 0
        self._flush()

    def _flush(self) -> None:
        """See to it that everything logged was taken; RuntimeError: it was not."""
        self._stream.flush(timeout_sec=FLUSH_TIMEOUT)

    def _leave_out(self, why: str) -> None:
        """Say why something is not shown, unless that was said last."""
        self._dropped += 1
        if why != self._last_notice:
            self._last_notice = why
            self._notify(why)

    def _is_refresh_due(self) -> bool:
        return bool(self._latest) and time.monotonic() >= self._next_refresh

    def _lose(self, why: str) -> None:
        with self._condition:
            if self._is_lost:
                return
            self._is_lost = True
            self._dropped += len(self._queue) + len(self._latest)
            self._queue.clear()
            self._latest.clear()
        self._notify(why)
