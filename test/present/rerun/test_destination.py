"""A destination shows everything in order, or drops it and says so; nobody waits for it."""

import threading

from impact_rig.core.errors import ParameterError
from impact_rig.present.rerun.destination import QUEUE_LENGTH, QUEUE_SIZE, StreamDestination

from .onlookers import PATIENCE, fail, wait_until


class StubbornStream:
    """A recording stream whose first flush waits until it is let go."""

    def __init__(self):
        self.reached = threading.Event()
        self.let_go = threading.Event()

    def flush(self, *, timeout_sec):
        self.reached.set()
        assert self.let_go.wait(PATIENCE)

    def disconnect(self):
        pass


def open_stuck(period=0.0):
    """Return a destination that hangs at its first view, and its stream."""
    stream = StubbornStream()
    destination = StreamDestination("slow", stream, period, fail)
    destination.put(lambda _: None)
    assert stream.reached.wait(PATIENCE)
    return destination, stream


def test_a_destination_that_is_behind_drops_views_and_counts_them():
    (destination, stream), done = open_stuck(), []
    for i in range(QUEUE_LENGTH + 5):
        destination.put(lambda _, i=i: done.append(i))
    stream.let_go.set()
    destination.close()

    assert done == list(range(QUEUE_LENGTH))
    assert destination.dropped == 5


def test_what_is_replaced_before_it_is_shown_is_not_shown_and_the_last_one_always_is():
    stream, done = StubbornStream(), []
    stream.let_go.set()
    destination = StreamDestination("file", stream, 3600.0, fail)
    destination.put(lambda _: done.append("first"), key="table")
    wait_until(lambda: done)
    for text in ("second", "third"):
        destination.put(lambda _, text=text: done.append(text), key="table")
    destination.put(lambda _: done.append("other"), key="other")
    destination.close()

    assert done == ["first", "third", "other"]
    destination.close()


def test_large_views_are_dropped_before_they_take_the_memory():
    (destination, stream), done = open_stuck(), []
    for i in range(3):
        destination.put(lambda _, i=i: done.append(i), QUEUE_SIZE // 2)
    stream.let_go.set()
    destination.close()

    assert (done, destination.dropped) == ([0, 1], 1)


def test_a_campaign_begins_after_the_last_word_on_the_one_before():
    (destination, stream), done = open_stuck(3600.0), []
    destination.put(lambda _: done.append("old table"), key="table")
    destination.begin(lambda _: done.append("set-up"))
    destination.put(lambda _: done.append("new table"), key="table")
    stream.let_go.set()
    destination.close()

    assert done == ["old table", "set-up", "new table"]


def test_a_view_that_cannot_be_drawn_is_told_once_and_the_others_are_shown():
    def refuse(_):
        raise ParameterError("the trace has no scale")

    stream, done, notices = StubbornStream(), [], []
    stream.let_go.set()
    destination = StreamDestination("file", stream, 0.0, notices.append)
    for work in (refuse, refuse, lambda _: done.append("drawn")):
        destination.put(work)
    destination.close()

    assert notices == ["file: a view is left out: the trace has no scale"]
    assert (done, destination.dropped, destination.is_lost) == (["drawn"], 2, False)
