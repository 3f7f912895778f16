"""The thread that owns a source, without ROS around it."""

import contextlib
import queue

import numpy as np
import pytest

from impact_rig.core.records import Block, ChannelBlock, HitLabel
from impact_rig.nodes import accelerometer_source
from impact_rig.nodes.accelerometer_source import COMPLETE, Arming, SourceThread

PATIENCE = 30.0
RATE = 1e6
CHANNEL = ChannelBlock(np.zeros(10, np.int32), 1.0, 0.0, 100.0)


class TwoBlockSource:
    """Each arming brings a record of two blocks at once."""

    def __init__(self):
        self.blocks = []

    def arm(self):
        self.blocks = [
            Block(0, RATE, CHANNEL, CHANNEL),
            Block(10, RATE, CHANNEL, CHANNEL, last=True),
        ]

    def read(self, timeout):
        return self.blocks.pop(0) if self.blocks else None

    def disarm(self):
        self.blocks = []

    def check(self):
        pass


class NotingOutput:
    """Notes, for each block, whether the arming was known to be read when it was published."""

    def __init__(self, arming):
        self.arming = arming
        self.noted = []

    def begin(self, label):
        pass

    def publish(self, block):
        self.noted.append((block.last, self.arming.is_read))

    def end(self, *, is_awaited):
        return False

    def finish(self):
        pass


@pytest.fixture
def arming():
    return Arming(HitLabel("steel small"))


@contextlib.contextmanager
def run_thread(source, output, events):
    """Run the thread of a source; what ends, and what fails, is an event."""
    thread = SourceThread(
        source,
        output,
        is_continuous=False,
        patience=PATIENCE,
        on_armed=lambda _: None,
        on_ended=lambda arming, why: events.put((arming.is_read, why)),
        on_failed=events.put,
    )
    thread.start()
    try:
        yield thread
    finally:
        assert thread.stop()


def test_an_arming_is_known_to_be_read_before_a_verdict_can_follow(arming):
    arming.release(PATIENCE)
    output, events = NotingOutput(arming), queue.SimpleQueue()
    with run_thread(TwoBlockSource(), output, events) as thread:
        thread.arm(arming)
        assert events.get(timeout=PATIENCE) == (True, COMPLETE)
    assert output.noted == [(False, False), (True, True)]


def test_an_arming_without_an_impact_is_read_when_its_time_is_over(arming):
    arming.release(0.0)
    source, events = TwoBlockSource(), queue.SimpleQueue()
    source.arm = lambda: None
    with run_thread(source, NotingOutput(arming), events) as thread:
        thread.arm(arming)
        assert events.get(timeout=PATIENCE)[0] is True


def test_a_source_is_asked_whether_it_is_there_only_while_nothing_is_armed(arming, monkeypatch):
    monkeypatch.setattr(accelerometer_source, "CHECK_PERIOD", 0.001)
    source, events = TwoBlockSource(), queue.SimpleQueue()
    source.check = lambda: events.put("asked")
    source.arm = lambda: events.put("armed")
    source.read = lambda timeout: events.put("read")
    source.disarm = lambda: events.put("disarmed")
    with run_thread(source, NotingOutput(arming), events) as thread:
        assert events.get(timeout=PATIENCE) == "asked"
        thread.arm(arming)
        wait_for(events, "armed")
        while_armed = {events.get(timeout=PATIENCE) for _ in range(50)}
        arming.release(0.0)
        wait_for(events, "disarmed")
        wait_for(events, "asked")
    assert while_armed == {"read"}


def wait_for(events, wanted):
    while events.get(timeout=PATIENCE) != wanted:
        pass
