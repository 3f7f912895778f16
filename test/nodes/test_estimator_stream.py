"""The estimator cuts records out of a running stream."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from impact_rig_msgs.msg import StreamBlock

from impact_rig.core.given.records import Block, ChannelBlock, HitLabel
from impact_rig.core.given.setup import PAPER_SETUP, AnalysisSettings
from impact_rig.nodes import interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.identity import Identity, make_id
from impact_rig.nodes.messages import setup_to_msg, stamp_to_msg
from impact_rig.recordings.messages import fill_block

RATE, SIZE = 1e6, 1000
IDENTITY = Identity(make_id(), make_id())


def make_block(number, *, full_scale=2000.0, impact=False, record=4):
    counts = np.zeros(SIZE, np.int32)
    if impact:
        counts[300:500] = 900
    channel = ChannelBlock(counts, 1.0, 0.0, full_scale)
    message = StreamBlock()
    label = HitLabel("steel small", record=record)
    block = Block(number * SIZE, RATE, channel, channel, label, stamp=number * 1_000_000)
    fill_block(IDENTITY.fill(message), block)
    return message


def count_blocks(node):
    return node.diagnose().get("stream blocks", 0)


@pytest.fixture
def stream(harness):
    """Return publishers of set-ups and of a stream, the estimator that has both, and a number."""
    node = harness.add(EstimatorNode)
    setup = setup_to_msg(PAPER_SETUP, stamp_to_msg(1))
    IDENTITY.fill(setup)
    setups = harness.advertise(interfaces.SETUP)
    setups.publish(setup)
    publisher = harness.advertise(interfaces.STREAM)
    harness.wait_until(lambda: publisher.get_subscription_count() == 1)
    # Until the set-up has come, what comes is not searched.
    numbers = iter(range(1_000_000))

    def has_begun():
        publisher.publish(make_block(next(numbers)))
        return count_blocks(node) > 0

    harness.wait_until(has_begun)
    last = next(numbers)
    publisher.publish(make_block(last))
    return setups, publisher, node, last


def test_a_stream_that_cannot_be_searched_is_a_fault_of_the_estimator(harness, stream):
    _, publisher, node, last = stream
    publisher.publish(make_block(last + 1, full_scale=0.0))
    harness.wait_until(lambda: "does not say the hammer's full scale" in (node.fault or ""))
    assert node.fault.startswith("acceleration/stream: ")


def test_other_settings_go_on_with_the_stream_from_where_it_is(harness, stream):
    setups, publisher, node, last = stream
    hits = harness.listen(interfaces.ACCELERATION)
    settings = AnalysisSettings(record_duration=1e-3)
    setup = setup_to_msg(replace(PAPER_SETUP, analysis=settings), stamp_to_msg(2))
    setups.publish(setup)
    numbers = itertools.count(last + 7)

    def is_found():
        # Each arming of five blocks has its hit: this listener may miss the first.
        number = next(numbers)
        publisher.publish(make_block(number, impact=number % 5 == 2, record=5 + number // 5))
        return any(len(hit.hammer.counts) == 1200 for hit in hits.messages)

    harness.wait_until(is_found)
    assert node.describe_warning() is None


def test_a_stream_beside_accelerometers_that_publish_their_hits_is_somebody_else_s(harness):
    harness.add(AccelerometerNode)
    node = harness.add(EstimatorNode)
    publisher = harness.advertise(interfaces.STREAM)
    harness.wait_until(publisher.get_subscription_count)
    publisher.publish(make_block(0))
    harness.wait_until(lambda: node.intake.handled)
    assert node.count_publishers(interfaces.ACCELERATION.name) == 1
