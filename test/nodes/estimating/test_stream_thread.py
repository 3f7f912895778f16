"""The running stream is taken and cut in a thread of its own."""

import threading

import numpy as np
import pytest

from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.signals.record import ChannelBlock, HitLabel
from impact_rig.nodes import interfaces
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.messages import setup_to_msg, stamp_to_msg
from impact_rig.nodes.stream_messages import place_stream_block, stream_block_to_msg

RATE, SIZE = 1e6, 1000
STREAM = interfaces.make_stream_topic(400)


def make_block(number, *, impact=False, full_scale=2000.0):
    counts = np.zeros(SIZE, np.int32)
    if impact:
        counts[300:500] = 900
    channel = ChannelBlock(counts, 1.0, 0.0, full_scale)
    message = stream_block_to_msg(channel, channel, RATE)
    place_stream_block(
        message, number * SIZE, number * 1_000_000, HitLabel("steel small"), last=False
    )
    return message


def count_blocks(node):
    return node.diagnose().get("stream blocks", 0)


@pytest.fixture
def stream(harness):
    """Return a publisher of a stream that an estimator with a set-up listens to, and that node."""
    node = harness.add(EstimatorNode)
    harness.advertise(interfaces.SETUP).publish(setup_to_msg(PAPER_SETUP, stamp_to_msg(1)))
    publisher = harness.advertise(STREAM)
    harness.wait_until(lambda: publisher.get_subscription_count() == 1)
    # Until the set-up has come, what comes is not searched.
    numbers = iter(range(1_000_000))

    def has_begun():
        publisher.publish(make_block(next(numbers)))
        return count_blocks(node) > 0

    harness.wait_until(has_begun)
    last = next(numbers)
    publisher.publish(make_block(last))
    return publisher, node, last


def test_a_stream_is_cut_while_the_estimator_does_something_else(harness, stream):
    publisher, node, last = stream
    verdicts = harness.listen(interfaces.IMPACT)
    gate = threading.Event()
    busy = threading.Thread(target=lambda: harness.run(gate.wait))
    busy.start()
    try:
        before = count_blocks(node)
        for number in range(last + 1, last + 7):
            publisher.publish(make_block(number, impact=number == last + 2))
        harness.wait_until(lambda: count_blocks(node) >= before + 6)
        assert verdicts.messages == []
    finally:
        gate.set()
        busy.join()
    # What was cut meanwhile is judged as soon as there is time.
    (verdict,) = verdicts.wait_for_count(1)
    assert (verdict.sample, verdict.record) == ("steel small", 1)


def test_a_stream_that_cannot_be_searched_is_a_fault_of_the_estimator(harness, stream):
    publisher, node, last = stream
    publisher.publish(make_block(last + 1, full_scale=0.0))
    harness.wait_until(lambda: "does not say the hammer's full scale" in node.fault)
    assert node.fault.startswith("acceleration/stream: ")


def test_the_thread_ends_with_its_node_and_may_be_told_so_twice(stream):
    _, node, _ = stream
    node._stream.stop()
    node._stream.stop()
    assert not node._stream._thread.is_alive()
