"""Publishes recorded messages at their pace, in a thread of its own."""

import itertools
import threading
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.duration import Duration

from impact_rig.core.errors import RigError
from impact_rig.nodes.replaying.replay_pace import Pace
from impact_rig.nodes.replaying.replay_plan import Cue, ReplayPlan
from impact_rig.nodes.replaying.replay_window import CountedWindow, Window

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
