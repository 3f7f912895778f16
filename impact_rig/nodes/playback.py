"""Publishes recorded messages at their pace, in a thread of its own."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from rclpy.duration import Duration

from impact_rig.core.errors import RigError
from impact_rig.recording.mcap_file import RawMessage

WINDOW = 100
"""Blocks that may be under way and not yet judged, where the rate is free [-]: half of what the
subscribers' queues hold."""
JUDGEMENT_TIMEOUT = 5.0
"""How long an estimator may be silent before its verdicts are no longer waited for [s], our
choice: a hundred times what it needs."""
STOP_PERIOD = 0.1
"""How soon a wait inside the middleware notices that it is to end [s]."""
DELIVERY_TIMEOUT = 10.0
"""How long the last messages may take to reach every subscriber [s]: a few heartbeats of the
middleware, which come every 3 s."""


class Window:
    """Keeps the blocks under way few enough for the subscribers' queues.

    The middleware tells what has arrived in a queue, but not what was taken out of it: only a
    verdict proves that the estimator has seen a record's blocks. Where nobody judges, arrival
    must do.

    Parameters
    ----------
    has_judge : callable
        Returns whether an estimator is there.
    """

    def __init__(self, has_judge: Callable[[], bool]) -> None:
        self._has_judge = has_judge
        self._is_judged = True
        self._pending: deque[int] = deque()
        self._changed = threading.Condition()

    def add(self, record: int) -> None:
        """Note that a block of a record is on its way."""
        with self._changed:
            self._pending.append(record)

    def note_verdict(self, record: int) -> None:
        """Note that a record was judged, and with it all before it."""
        with self._changed:
            while self._pending and self._pending[0] <= record:
                self._pending.popleft()
            self._changed.notify_all()

    def wait(self, wait_for_delivery: Callable[[], None], stop: threading.Event) -> None:
        """Return when another block may be sent, or `stop` is set."""
        deadline = time.monotonic() + JUDGEMENT_TIMEOUT
        while len(self._pending) >= WINDOW and not stop.is_set():
            self._is_judged = self._is_judged and time.monotonic() < deadline
            with self._changed:
                if self._is_judged and self._has_judge():
                    self._changed.wait_for(lambda: len(self._pending) < WINDOW, STOP_PERIOD)
                    continue
            wait_for_delivery()
            with self._changed:
                self._pending.clear()


class Playback:
    """One run through a recording.

    Parameters
    ----------
    messages : iterable of RawMessage
        In the order in which they are published.
    publishers : mapping
        Publisher by channel number.
    rate : float
        Of the original speed [-]; 0: as fast as the subscribers take it.
    window : Window
        Keeps blocks under way few where the rate is 0.
    find_record : callable
        Returns the record that a message is a block of; None: it is no block.
    finished : callable
        Called from the thread at the end, unless the playback was stopped.

    Attributes
    ----------
    published : int
        Messages so far [-].
    recorded_time : float
        How far into the recording, by its own clock [s].
    problem : str
        What ended the playback before its time; empty: nothing.
    """

    def __init__(
        self,
        messages: Iterable[RawMessage],
        publishers: Mapping[int, Any],
        rate: float,
        window: Window,
        find_record: Callable[[RawMessage], int | None],
        finished: Callable[[], None],
    ) -> None:
        self._messages = messages
        self._publishers = publishers
        self._rate = rate
        self._find_record = find_record
        self._finished = finished
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="playback", daemon=True)
        self._window = window
        self.published = 0
        self.recorded_time = 0.0
        self.problem = ""

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End, and return when nothing is published any more; safe to call twice."""
        self._stop.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join()

    def _run(self) -> None:
        try:
            self._publish_all()
        except RigError as error:
            self.problem = str(error)
        self._wait_for_delivery()
        if not self._stop.is_set():
            self._finished()

    def _publish_all(self) -> None:
        first_time: int | None = None
        begin = time.monotonic()
        for message in self._messages:
            if first_time is None:
                first_time = message.log_time
            self.recorded_time = (message.log_time - first_time) * 1e-9
            if self._rate > 0:
                self._stop.wait(begin + self.recorded_time / self._rate - time.monotonic())
            else:
                self._keep_window(message)
            if self._stop.is_set():
                return
            self._publishers[message.channel.id].publish(message.data)
            self.published += 1

    def _keep_window(self, message: RawMessage) -> None:
        record = self._find_record(message)
        if record is not None:
            self._window.wait(self._wait_for_delivery, self._stop)
            self._window.add(record)

    def _wait_for_delivery(self) -> None:
        """Return when all that was published has arrived, or nobody waits for it any more."""
        deadline = time.monotonic() + DELIVERY_TIMEOUT
        for publisher in set(self._publishers.values()):
            while not self._stop.is_set() and time.monotonic() < deadline:
                if publisher.wait_for_all_acked(Duration(seconds=STOP_PERIOD)):
                    break
