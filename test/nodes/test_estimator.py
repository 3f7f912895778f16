"""The estimator node says what the core says, bit for bit, hit by hit."""

import math

import pytest
from impact_rig_msgs.msg import RecorderState, RecordStored
from impact_rig_msgs.srv import GetResults

from impact_rig.core.session import Session
from impact_rig.core.setup.paper import CONTROL_SAMPLE, PAPER_SETUP
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.rig import DigitizerSettings, VirtualRig, VirtualRigSettings
from impact_rig.nodes import interfaces
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.messages import block_to_msg, setup_to_msg, stamp_to_msg
from impact_rig.nodes.recorder import RecorderNode
from impact_rig.results.campaign import results_from_session

from ..recordings.damaged import find_chunks

SETUP = setup_to_msg(PAPER_SETUP, stamp_to_msg(7))
URI = "/somewhere/session.mcap"


def make_blocks(sample, count, first_record=1, stamp=0):
    rig = VirtualRig(PAPER_SETUP, VirtualRigSettings())
    return [
        block
        for i in range(count)
        for block in rig.strike(HitLabel(sample, record=first_record + i, impact=i + 1)).split(
            1000, stamp
        )
    ]


def feed(harness, publisher, blocks):
    harness.wait_until(lambda: publisher.get_subscription_count() >= 1)
    for block in blocks:
        publisher.publish(block_to_msg(block))


@pytest.fixture
def estimator(harness):
    """Return an estimator that knows the set-up, a publisher of blocks, and the verdicts."""
    node = harness.add(EstimatorNode)
    impacts = harness.listen(interfaces.IMPACT)
    harness.advertise(interfaces.SETUP).publish(SETUP)
    return node, harness.advertise(interfaces.ACCELERATION), impacts


def test_estimates_equal_the_core_bit_for_bit(harness, estimator):
    _, publisher, impacts = estimator
    estimates = harness.listen(interfaces.ESTIMATE)
    blocks = make_blocks("steel small", 2) + make_blocks(CONTROL_SAMPLE, 2, first_record=3)

    feed(harness, publisher, blocks)

    impacts.wait_for_count(4)
    estimates.wait(
        lambda got: any(
            message.name == CONTROL_SAMPLE and message.impacts_accepted == 2 for message in got
        )
    )
    session = Session(PAPER_SETUP)
    for block in blocks:
        session.feed(block)
    expected = {
        item.name: item for item in results_from_session(session.estimate_all(), {}).samples
    }
    answer = harness.call(GetResults, interfaces.GET_RESULTS)
    assert answer.setup_stamp == SETUP.header.stamp
    assert [item.name for item in answer.samples] == [CONTROL_SAMPLE, "steel small"]
    for item in answer.samples:
        assert item.stiffness.value == expected[item.name].stiffness.value
        assert item.damping_coefficient.value == expected[item.name].damping_coefficient.value
        assert item.mse_sample_percent == expected[item.name].mse_sample_percent


@pytest.fixture
def recording(harness, tmp_path):
    """Return the recording of a campaign of three hits, their blocks, the recorder's last word."""
    path = tmp_path / "session.mcap"
    recorder = harness.add(RecorderNode, output=str(path), required_topics="")
    stored = harness.listen(interfaces.RECORD_STORED)
    harness.advertise(interfaces.SETUP).publish(SETUP)
    blocks = make_blocks("steel small", 3, stamp=10**9)
    publisher = harness.advertise(interfaces.ACCELERATION)
    for number in (1, 2, 3):  # each into a chunk of its own
        feed(harness, publisher, [block for block in blocks if block.label.record == number])
        told = stored.wait_for_count(number)
    harness.close(recorder)
    state = RecorderState(recording=True, uri=str(path))
    harness.advertise(interfaces.RECORDER_STATE).publish(state)
    return path, blocks, told[-1]


def wait_for_accepted(harness, records):
    """Wait until the hits of these records count, and no others."""

    def count():
        hits = harness.call(GetResults, interfaces.GET_RESULTS).accepted
        return [hit.record for hit in hits]

    harness.wait_until(lambda: count() == records)


def test_a_record_that_is_read_from_the_disk_while_it_is_on_its_way_counts_once(
    harness, recording
):
    _, blocks, told = recording
    impacts = harness.listen(interfaces.IMPACT)
    harness.add(EstimatorNode)
    wait_for_accepted(harness, [1, 2, 3])
    publisher = harness.advertise(interfaces.ACCELERATION)
    feed(harness, publisher, [block for block in blocks if block.label.record == 3])
    harness.advertise(interfaces.RECORD_STORED).publish(told)
    assert impacts.wait_for_count(1)[0].record == 3
    wait_for_accepted(harness, [1, 2, 3])


def test_of_a_damaged_recording_every_record_before_the_damage_counts(harness, recording):
    path, *_ = recording
    chunks = {raw.topic: chunk for chunk in find_chunks(path) for raw in chunk.messages}
    content = bytearray(path.read_bytes())
    content[chunks["/acceleration"].data_start] ^= 1  # the last one with blocks: of record 3
    path.write_bytes(content)
    harness.add(EstimatorNode)
    wait_for_accepted(harness, [1, 2])


def test_all_that_is_found_names_the_set_up_it_was_found_under(harness):
    harness.add(EstimatorNode)
    topics = (
        interfaces.IMPACT, interfaces.ESTIMATE, interfaces.HAMMER_ESTIMATE, interfaces.COMPARISON
    )  # fmt: skip
    told = [harness.listen(topic) for topic in topics]
    setups = harness.advertise(interfaces.SETUP)
    publisher = harness.advertise(interfaces.ACCELERATION)
    for number in (1, 2):
        setup = setup_to_msg(PAPER_SETUP, stamp_to_msg(number))
        setups.publish(setup)
        harness.wait_until(
            lambda setup=setup: (
                harness.call(GetResults, interfaces.GET_RESULTS).setup_stamp == setup.header.stamp
            )
        )
        feed(harness, publisher, make_blocks(CONTROL_SAMPLE, 1, first_record=number))
        for collector in told:
            collector.wait(
                lambda got, stamp=setup.header.stamp: got[-1:] and got[-1].setup_stamp == stamp
            )
        results = harness.call(GetResults, interfaces.GET_RESULTS)
        for found in (results.hammer, *results.samples, *results.accepted):
            assert found.setup_stamp == setup.header.stamp


def test_the_numbers_come_first_and_once_more_with_what_stands_beside_them(harness, estimator):
    estimates = harness.listen(interfaces.ESTIMATE)
    feed(harness, estimator[1], make_blocks(CONTROL_SAMPLE, 1))
    numbers, checked = estimates.wait_for_count(2)
    for name in ("contact_time", "stiffness", "damping_coefficient"):
        assert repr(getattr(numbers, name)) == repr(getattr(checked, name))
    assert math.isnan(numbers.mse_sample_percent)
    assert checked.mse_sample_percent > 0
    assert (numbers.pulse_shape.fits, bool(checked.pulse_shape.fits)) == ([], True)


def test_what_the_control_sample_changes_follows_once_and_behind_its_hits(harness, estimator):
    _, publisher, impacts = estimator
    estimates = harness.listen(interfaces.ESTIMATE)
    others = ("steel small", "brass small", "bronze small")
    blocks = [
        block
        for number, sample in enumerate(others, start=1)
        for block in make_blocks(sample, 1, first_record=number)
    ]
    feed(harness, publisher, blocks)
    estimates.wait_for_count(2 * len(others))
    # Faster than from hit to hit on any rig: none of the hits waits for another sample.
    feed(harness, publisher, make_blocks(CONTROL_SAMPLE, 4, first_record=4))
    found = estimates.wait(
        lambda got: len(got) > 12 and sorted(item.name for item in got[-3:]) == sorted(others)
    )
    assert len(impacts.messages) == len(others) + 4
    # Numbers of each hit, and what stands beside them once or more; then the others.
    assert {item.name for item in found[6:-3]} == {CONTROL_SAMPLE}
    assert 4 + 1 <= len(found[6:-3]) <= 4 + 4
    # Of each the newest state: all four hits on the control sample make it.
    answer = harness.call(GetResults, interfaces.GET_RESULTS)
    final = {item.name: item.stiffness.value for item in answer.samples}
    assert {item.name: item.stiffness.value for item in found[-3:]} == {
        name: final[name] for name in others
    }


def test_blocks_that_come_before_the_set_up_wait_for_it(harness):
    harness.add(EstimatorNode)
    impacts = harness.listen(interfaces.IMPACT)
    feed(harness, harness.advertise(interfaces.ACCELERATION), make_blocks("steel small", 1))
    harness.advertise(interfaces.SETUP).publish(SETUP)
    (impact,) = impacts.wait_for_count(1)
    assert impact.accepted


def test_a_verdict_comes_even_if_its_hit_cannot_be_averaged_with_the_others(harness, estimator):
    node, publisher, impacts = estimator
    feed(harness, publisher, make_blocks(CONTROL_SAMPLE, 1))
    slower = VirtualRigSettings(digitizer=DigitizerSettings(sampling_rate=1.25e6))
    hit = VirtualRig(PAPER_SETUP, slower).strike(HitLabel(CONTROL_SAMPLE, record=2, impact=2))
    feed(harness, publisher, hit.split(1000, 0))
    verdicts = impacts.wait_for_count(2)
    assert [verdict.accepted for verdict in verdicts] == [True, True]
    harness.wait_until(lambda: "cannot be averaged" in node.fault)


def test_a_block_that_cannot_be_meant_is_named_and_the_next_ones_are_judged(harness, estimator):
    node, publisher, impacts = estimator
    bad = block_to_msg(make_blocks("steel small", 1)[0])
    bad.sampling_rate = -1.0
    harness.wait_until(lambda: publisher.get_subscription_count() >= 1)
    publisher.publish(bad)

    feed(harness, publisher, make_blocks("steel small", 1, first_record=2))

    assert impacts.wait_for_count(1)[-1].accepted
    assert "sampling rate is -1.0 Hz" in node.fault


def tell_stored(publisher, blocks):
    """Say that a record is stored, as a recorder does."""
    last = block_to_msg(blocks[-1])
    message = RecordStored(record=last.record, blocks=len(blocks))
    message.header.stamp = last.header.stamp
    publisher.publish(message)


@pytest.fixture
def recorded(harness, estimator):
    """Return an estimator, publishers of blocks and of a recorder's words, and the verdicts."""
    node, blocks, impacts = estimator
    states = harness.advertise(interfaces.RECORDER_STATE)
    states.publish(RecorderState(recording=True, uri=URI))
    stored = harness.advertise(interfaces.RECORD_STORED)
    harness.wait_until(lambda: states.get_subscription_count() > 0)
    assert states.wait_for_all_acked()
    return node, blocks, states, stored, impacts


def find_waiting(node):
    return node.diagnose()["waiting for"]


def feed_what_waits(harness, node, publisher, blocks):
    """Publish blocks, and return when all of them wait."""
    feed(harness, publisher, blocks)
    harness.wait_until(lambda: len(node._gate._waiting) == len(blocks))


def test_a_hit_is_judged_when_the_recorder_has_stored_it(harness, recorded):
    node, publisher, _, stored, impacts = recorded
    blocks = make_blocks("steel small", 1)
    feed(harness, publisher, blocks)
    harness.wait_until(lambda: "record 1 is stored" in find_waiting(node))
    assert not impacts.messages
    tell_stored(stored, blocks)
    assert impacts.wait_for_count(1)[0].accepted
    assert not find_waiting(node)


def test_a_hit_that_waits_when_the_recorder_stops_does_not_count(harness, recorded):
    node, publisher, states, _, impacts = recorded
    feed_what_waits(harness, node, publisher, make_blocks("steel small", 1))
    states.publish(RecorderState(recording=False, uri=URI, message="the disk is full"))
    harness.wait_until(lambda: not find_waiting(node))
    # Nobody records any more, so nobody is waited for.
    feed(harness, publisher, make_blocks("steel small", 1, first_record=2))
    assert [verdict.record for verdict in impacts.wait_for_count(1)] == [2]
    (sample,) = harness.call(GetResults, interfaces.GET_RESULTS).samples
    assert (sample.impacts_accepted, sample.impacts_rejected) == (1, 0)


def test_a_hit_that_waits_is_not_taken_for_one_of_the_next_recording(harness, recorded):
    node, publisher, states, stored, impacts = recorded
    # A block that came after the other recording had begun would belong to that.
    feed_what_waits(harness, node, publisher, make_blocks("steel small", 1))
    states.publish(RecorderState(recording=True, uri="/somewhere/else.mcap"))
    harness.wait_until(lambda: not find_waiting(node))
    blocks = make_blocks("steel small", 1, first_record=2)
    feed(harness, publisher, blocks)
    tell_stored(stored, blocks)
    assert [verdict.record for verdict in impacts.wait_for_count(1)] == [2]


def test_a_recorder_that_is_there_and_has_said_nothing_is_waited_for(harness):
    node = harness.add(EstimatorNode)
    states = harness.advertise(interfaces.RECORDER_STATE)
    harness.wait_until(lambda: states.get_subscription_count() > 0)
    harness.advertise(interfaces.SETUP).publish(SETUP)
    feed(harness, harness.advertise(interfaces.ACCELERATION), make_blocks("steel small", 1))
    harness.wait_until(lambda: "record 1 is stored" in find_waiting(node))


def test_a_record_that_began_before_anybody_listened_is_no_hit(harness):
    """As when a player begins before the estimator has found it."""
    harness.advertise(interfaces.SETUP).publish(SETUP)
    publisher = harness.advertise(interfaces.ACCELERATION)
    blocks = make_blocks("steel small", 3)
    for block in blocks[:2]:
        publisher.publish(block_to_msg(block))
    harness.add(EstimatorNode)
    impacts = harness.listen(interfaces.IMPACT)
    # Of the third record the first block is lost: that is a hit, which is rejected.
    feed(harness, publisher, [*blocks[2:10], *blocks[11:]])
    heard = impacts.wait_for_count(2)
    assert [(hit.record, hit.accepted) for hit in heard] == [(2, True), (3, False)]
    assert "gap" in heard[1].reasons[0]
