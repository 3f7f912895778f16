"""Publishes recorded messages at their pace, in a thread of its own, as the subscribers follow."""

import itertools
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.duration import Duration

from impact_rig.core.errors import RigError
from impact_rig.nodes.replayer_recording import Cue, ReplayPlan
from impact_rig.recordings.messages import NANOSECONDS


class Pace:
    """The clock of a replay, which one thread waits for and others set.

    Parameters
    ----------
    rate : float
        Of the original speed [-]; 0: nothing is waited for.
    is_paused : bool
        Whether it begins with a pause.
    """

    def __init__(self, rate: float, *, is_paused: bool = False) -> None:
        self._changed = threading.Condition()
        self._rate = rate
        self._is_paused = is_paused
        self._is_stepping = False
        self._is_stopped = False
        self._position = 0
        self._since = time.monotonic()

    @property
    def is_paused(self) -> bool:
        """Whether nothing is due; not while a step is made."""
        return self._is_paused and not self._is_stepping

    @property
    def is_stopped(self) -> bool:
        """Whether nothing will be due any more."""
        return self._is_stopped

    @property
    def is_free(self) -> bool:
        """Whether everything is due at once: a rate of 0, or a step."""
        return self._rate == 0.0 or self._is_stepping

    def jump(self, position: int) -> None:
        """Let the recorded moment `position` [ns] be now."""
        with self._changed:
            self._anchor(position)

    def set_rate(self, rate: float) -> None:
        """Go on at another speed from here."""
        with self._changed:
            self._anchor(self._compute_position())
            self._rate = rate
            self._changed.notify_all()

    def pause(self) -> None:
        """Stand still."""
        with self._changed:
            self._anchor(self._compute_position())
            self._is_paused = True
            self._is_stepping = False

    def resume(self) -> None:
        """Go on from where it stands."""
        with self._changed:
            self._anchor(self._position if self._is_paused else self._compute_position())
            self._is_paused = self._is_stepping = False
            self._changed.notify_all()

    def step(self) -> None:
        """Let everything be due until `end_step`."""
        with self._changed:
            self._is_paused = self._is_stepping = True
            self._changed.notify_all()

    def end_step(self) -> bool:
        """Stand still again, if a step was being made; return whether it was."""
        with self._changed:
            was_stepping, self._is_stepping = self._is_stepping, False
        return was_stepping

    def stop(self) -> None:
        """Let nothing be due any more, and wake who waits."""
        with self._changed:
            self._is_stopped = True
            self._changed.notify_all()

    def wait_for(self, position: int, tick: Callable[[int], None], period: float) -> bool:
        """Wait until a recorded moment is due.

        Parameters
        ----------
        position : int
            The moment [ns]; afterwards it is now.
        tick : callable
            Called with the moment that is now [ns], while waiting.
        period : float
            How often [s].

        Returns
        -------
        bool
            False: it will never be due, the replay is stopped.
        """
        with self._changed:
            while not self._is_stopped:
                left = self._compute_time_left(position)
                if left is not None and left <= 0.0:
                    # A late one does not make the next ones early, nor the other way round.
                    if self.is_free:
                        self._anchor(position)
                    return True
                tick(min(self._compute_position(), position))
                self._changed.wait(period if left is None else min(left, period))
        return False

    def _compute_time_left(self, position: int) -> float | None:
        """Return how long it takes until a moment is due [s]; None: until somebody says so."""
        if self.is_paused:
            return None
        if self.is_free:
            return 0.0
        return (position - self._compute_position()) / NANOSECONDS / self._rate

    def _compute_position(self) -> int:
        if self._is_paused or self._rate == 0.0:
            return self._position
        elapsed = time.monotonic() - self._since
        return self._position + round(elapsed * self._rate * NANOSECONDS)

    def _anchor(self, position: int) -> None:
        self._position = position
        self._since = time.monotonic()


WINDOW = 100
"""Blocks that may be under way and not yet taken [-]: half of what the estimator's queue holds."""
JUDGEMENT_TIMEOUT = 5.0
"""How long an estimator may be silent before its verdicts are no longer waited for [s], our
choice: a hundred times what it needs."""
SETTLING_TIME = 0.2
"""How long after its verdict what is left of a record may take to be read from the queue [s], our
choice: blocks that need no evaluation take a tenth of it."""
LOOK_PERIOD = 0.1
"""How soon a wait notices that it is to end [s]."""
COUNT_PERIOD = 0.002
"""How often a count that tells of no change is looked at [s], our choice: a block's evaluation
takes as long."""


class Window:
    """Sends no record before the one before it is judged, as the rig itself does.

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
            self._wait()
        with self._changed:
            # The verdict may come before the record's end.
            if is_last and record != self._last_judged:
                self._unjudged.append(record)

    def note_verdict(self, record: int) -> None:
        """Note that a record was judged, and with it all that was sent before it."""
        with self._changed:
            self._last_verdict, self._last_judged = time.monotonic(), record
            if record in self._unjudged:
                del self._unjudged[: self._unjudged.index(record) + 1]
            self._changed.notify_all()

    def begin_campaign(self) -> None:
        """Wait until a set-up may be sent: it begins the estimates afresh."""
        self.drain()

    def drain(self) -> None:
        """Wait until every record that was sent whole is judged and read."""
        if self._unjudged and self._has_judge():
            self._wait()
            with self._changed:
                self._changed.wait_for(self._is_stopped, SETTLING_TIME)
        self._unjudged.clear()
        self._last_judged = None
        self._is_judged = True

    def _wait(self) -> None:
        begin = time.monotonic()
        while self._unjudged and not self._is_stopped():
            silent = time.monotonic() - max(begin, self._last_verdict)
            self._is_judged = self._is_judged and silent < JUDGEMENT_TIMEOUT
            if self._is_judged and self._has_judge():
                with self._changed:
                    self._changed.wait_for(lambda: not self._unjudged, LOOK_PERIOD)
            else:
                self._wait_for_delivery()
                self._unjudged.clear()


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


STOP_PERIOD = 0.1
"""How soon a wait inside the middleware notices that it is to end [s]."""


class Playback:
    """A replay: one or more passes through a recording.

    Parameters
    ----------
    plan : ReplayPlan
        What is published in one pass.
    publishers : mapping
        Publisher by channel number.
    pace : Pace
        When it is published.
    passes : int
        How often; 0: without end.
    make_window : callable
        Makes, of a function that waits for delivery, what keeps the blocks under way few.
    publish_clock : callable
        Called with the recorded moment that is now [ns], with each message and in between.
    clock_period : float
        How often in between [s].
    changed : callable
        Called from the thread when a step ends, and at the end.

    Attributes
    ----------
    window : Window or CountedWindow
        To be told of verdicts.
    published : int
        Messages so far [-].
    record : int
        Of the last block [-]; 0: there was none yet.
    position : int
        When the last message was recorded [ns]; 0: there was none yet.
    is_finished : bool
        Whether the thread is at its end.
    problem : str
        What ended the playback before its time; empty: nothing.
    """

    def __init__(
        self,
        plan: ReplayPlan,
        publishers: Mapping[int, Any],
        pace: Pace,
        passes: int,
        make_window: Callable[[Callable[[], None]], Window | CountedWindow],
        publish_clock: Callable[[int], None],
        clock_period: float,
        changed: Callable[[], None],
    ) -> None:
        self._plan = plan
        self._publishers = publishers
        self._pace = pace
        self._passes = passes
        self._publish_clock = publish_clock
        self._clock_period = clock_period
        self._changed = changed
        self._thread = threading.Thread(target=self._run, name="playback", daemon=True)
        self.window = make_window(self._wait_for_delivery)
        self.published = 0
        self.record = 0
        self.position = 0
        self.is_finished = False
        self.problem = ""

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End, and return when nothing is published any more; safe to call twice."""
        self._pace.stop()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join()

    def _run(self) -> None:
        try:
            for _ in range(self._passes) if self._passes else itertools.count():
                if not self._publish_pass():
                    break
        except RigError as error:
            self.problem = str(error)
        self._wait_for_delivery()
        self.window.drain()
        self.is_finished = True
        self._changed()

    def _publish_pass(self) -> bool:
        """Publish all once; return whether there was anything, and no stop."""
        published = self.published
        for cue in self._plan.read_cues():
            if cue.is_cut or self.published == published:
                self._pace.jump(cue.time)
            if not self._pace.wait_for(cue.time, self._publish_clock, self._clock_period):
                return False
            self._publish(cue)
        return self.published > published

    def _publish(self, cue: Cue) -> None:
        if cue.is_setup:
            self.window.begin_campaign()
            self._pace.jump(cue.time)
        elif cue.record is not None:
            self.window.add(cue.record, is_last=cue.is_last, is_free=self._pace.is_free)
        if self._pace.is_stopped:
            return
        self._publish_clock(cue.time)
        self._publishers[cue.channel].publish(cue.data)
        self.published += 1
        self.position = cue.time
        if cue.record is not None:
            self.record = cue.record
        if cue.is_last and self._pace.end_step():
            self._changed()

    def _wait_for_delivery(self) -> None:
        """Return when all that was published has arrived; who has died is not waited for."""
        for publisher in set(self._publishers.values()):
            while not self._pace.is_stopped:
                if publisher.wait_for_all_acked(Duration(seconds=STOP_PERIOD)):
                    break
