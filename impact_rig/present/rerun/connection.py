"""A viewer elsewhere: it may come late, close, and come back.

Such a viewer listens, and Rerun sends to it what is logged from then on, nothing again: what it
has missed is kept here. Rerun's own server keeps that for viewers that ask it, as the relay's do;
its command line can pass a relay on to a viewer that listens, but where none answers at that
moment it opens a window of its own, and a viewer elsewhere that is stuck would hold up the others.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Hashable
from typing import TYPE_CHECKING

from impact_rig.present.rerun.addresses import check_viewer_address, is_answering
from impact_rig.present.rerun.destination import (
    CLOSE_TIMEOUT,
    FLUSH_TIMEOUT,
    QUEUE_LENGTH,
    QUEUE_SIZE,
    Notice,
    SizedWork,
    StreamDestination,
    Work,
)

if TYPE_CHECKING:
    import rerun as rr

RETRY_PERIOD = 1.0
"""How often a viewer that is not there is looked for [s], our choice."""
LONGEST_PAUSE = 60.0
"""How long somebody is left alone who answers and is no viewer [s], our choice: the pause doubles
up to this."""


class History:
    """The set-up of a campaign, the last hits, and the newest of what is replaced as a whole.

    Bounded like the queue of a destination, so that all of it passes through one.

    Attributes
    ----------
    forgotten : int
        How much of the campaign was too old to be kept [-].
    """

    def __init__(self, *first: Work) -> None:
        self._first = first
        self._events: deque[SizedWork] = deque()
        self._size = 0
        self._latest: dict[Hashable, Work] = {}
        self.forgotten = 0

    def put(self, work: Work, size: int = 0, *, key: Hashable = None) -> None:
        """Keep something in place of what `key` had, or of the oldest if there is too much."""
        if key is not None:
            self._latest[key] = work
            return
        self._events.append((work, size))
        self._size += size
        while self._events and (len(self._events) > QUEUE_LENGTH or self._size > QUEUE_SIZE):
            self._size -= self._events.popleft()[1]
            self.forgotten += 1

    def list_works(self) -> list[SizedWork]:
        """Return all that is kept, in the order in which it is to be logged."""
        first, latest = (
            [(work, 0) for work in works] for works in (self._first, self._latest.values())
        )
        return [*first, *self._events, *latest]


class ViewerConnection:
    """A destination that is looked for until it is there, and again when it was lost.

    Whenever it is there anew it gets a new recording with everything that is kept of the campaign.
    A viewer that is stuck holds one thread, and is left alone until it has let go of it.

    Parameters
    ----------
    address : str
        As `check_viewer_address` takes it.
    make_stream : callable
        Returns a new recording stream that goes to the viewer.
    refresh_period : float
        Least time between two versions of what is replaced as a whole [s].
    announce, notify : callable
        Told in one sentence, once each time, that the viewer is there at last, and that it is
        not; called from another thread.
    """

    def __init__(
        self,
        address: str,
        make_stream: Callable[[], rr.RecordingStream],
        refresh_period: float,
        *,
        announce: Notice,
        notify: Notice,
    ) -> None:
        self.name = f"the viewer at {address}"
        self._address = address
        self._host, self._port = check_viewer_address(address)
        self._make_stream = make_stream
        self._period = refresh_period
        self._announce = announce
        self._notify = notify
        self._lock = threading.Lock()
        self._history = History()
        self._missed = 0
        self._link: StreamDestination | None = None
        self._is_missed = False
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._look_after, name=self.name, daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """How many views of the campaign it misses, or will when it is there again [-]."""
        with self._lock:
            link = self._get_link()
            return self._missed + link.dropped if link else self._history.forgotten

    @property
    def is_lost(self) -> bool:
        """Whether the viewer is not there now."""
        with self._lock:
            return self._get_link() is None

    def begin(self, work: Work) -> None:
        """Show what a campaign begins with, and forget those before it."""
        with self._lock:
            self._history = History(work)
            self._missed = 0
            if link := self._get_link():
                link.begin(work)

    def put(self, work: Work, size: int = 0, *, key: Hashable = None) -> None:
        """Show something, now or later, as `StreamDestination.put` takes it."""
        with self._lock:
            self._history.put(work, size, key=key)
            if link := self._get_link():
                link.put(work, size, key=key)

    def close(self, timeout: float = CLOSE_TIMEOUT) -> None:
        """Show what is queued if the viewer is there, and look for it no longer."""
        self._closing.set()
        with self._lock:
            link = self._get_link()
        if link:
            link.close(timeout)

    def _get_link(self) -> StreamDestination | None:
        return None if self._link is None or self._link.is_lost else self._link

    def _look_after(self) -> None:
        pause = RETRY_PERIOD
        while not self._closing.is_set():
            if not is_answering(self._host, self._port):
                self._notify_missing(
                    f"no viewer answers at {self._address}: start one there with"
                    f" rerun --port {self._port}; it is looked for until it is there"
                )
                pause = RETRY_PERIOD
            elif self._show():
                pause = RETRY_PERIOD
                continue
            else:
                pause = min(2.0 * pause, LONGEST_PAUSE)
            self._closing.wait(pause)

    def _show(self) -> bool:
        """Show everything until the viewer is lost; return whether it ever was one."""
        stream = self._make_stream()
        try:
            stream.flush(timeout_sec=FLUSH_TIMEOUT)
        except RuntimeError as error:
            self._notify_missing(
                f"{self.name} takes no data ({error}); it is asked again now and then"
            )
            stream.disconnect()
            return False
        if self._is_missed:
            self._is_missed = False
            self._announce(f"{self.name} is there and shows the campaign so far")
        with self._lock:
            self._missed = self._history.forgotten
            link = self._link = StreamDestination(
                self.name, stream, self._period, self._notify_lost, self._history.list_works()
            )
        if self._closing.is_set():
            link.close()
        link.wait_for_end()
        with self._lock:
            self._link = None
        return True

    def _notify_lost(self, why: str) -> None:
        if not self._closing.is_set():
            why = (
                f"{self.name} is gone or takes no data: the rig goes on without it, and shows it"
                " everything when it is back"
            )
        self._is_missed = True
        self._notify(why)

    def _notify_missing(self, why: str) -> None:
        """Say once that the viewer is not there."""
        if not self._is_missed:
            self._is_missed = True
            self._notify(why)
