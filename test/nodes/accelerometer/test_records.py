"""The accelerometers read the source of a rig file and publish records, one arming at a time."""

import numpy as np
import pytest
from impact_rig_msgs.msg import AcquisitionState, HammerState
from impact_rig_msgs.srv import Arm, JoinCampaign
from std_srvs.srv import Trigger

from impact_rig.core.given.records import MEASURED, Origin
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.nodes import interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.identity import id_to_msg, make_id
from impact_rig.nodes.messages import setup_to_msg, stamp_to_msg
from impact_rig.recordings.messages import block_from_msg

from .desk_rig import SAMPLE, SOURCE, arm, make_record, wait_for_release, wait_for_state


def test_a_record_is_streamed_as_the_device_gave_it_in_blocks(
    harness, desk, rig, blocks, states, release
):
    rig()
    answer = arm(harness)
    assert answer.success, answer.message
    release(answer.record, latest_contact=60.0)
    record = make_record(overloaded=True)
    desk.deliver(record)
    got = [block_from_msg(item) for item in blocks.wait(lambda got: got and got[-1].last)]
    assert [block.first_sample for block in got] == list(range(0, 5000, 1000))
    for channel in ("hammer", "specimen"):
        counts = np.concatenate([getattr(block, channel).output for block in got])
        np.testing.assert_array_equal(counts, getattr(record, channel).output)
    # The device does not say in which part of the record: every piece says it.
    assert {block.hammer.overloaded for block in got} == {True}
    assert {block.specimen.overloaded for block in got} == {False}
    assert got[1].stamp - got[0].stamp == pytest.approx(1000 / 2.5e6 * 1e9, abs=1)
    state = wait_for_state(states, AcquisitionState.IDLE, "record complete")
    assert (state.source, state.hammerless) == ("desk digitizer 7", False)
    # A driver that does not say where its numbers come from has measured them.
    assert {block.origin for block in got} == {Origin(MEASURED, "desk digitizer 7")}
    harness.change_state("accelerometer", "deactivate")
    wait_for_state(states, AcquisitionState.IDLE, "node inactive")
    assert len(blocks.messages) == 5  # a record that is complete has one end


def test_a_hit_without_a_release_is_published_and_reported(
    harness, desk, rig, blocks, states, release
):
    rig()
    record = arm(harness).record
    release(record + 7)  # of another record
    desk.deliver(make_record())
    got = blocks.wait(lambda got: got and got[-1].last)
    assert {block.record for block in got} == {record}
    state = wait_for_state(states, AcquisitionState.IDLE, "before it was released")
    assert state.record == record
    assert arm(harness).record == record + 1


def test_what_does_not_come_in_time_is_said_by_an_empty_block_and_the_device_is_disarmed(
    harness, desk, rig, blocks, states, release
):
    rig()
    release(arm(harness).record)
    (block,) = blocks.wait_for_count(1)
    assert (block.triggered, block.last, len(block.hammer.counts)) == (False, True, 0)
    wait_for_state(states, AcquisitionState.IDLE, "no impact came in time")
    assert desk.calls == ["configure", "arm", "disarm"]


@pytest.fixture
def disarm(harness):
    """Return a function that publishes whether the swinging hammer is armed."""
    publisher = harness.advertise(interfaces.HAMMER_STATE)

    def run(*, armed):
        publisher.publish(HammerState(state=HammerState.SWINGING, armed=armed))

    return run


def test_a_hammer_that_is_disarmed_on_its_way_ends_the_record_at_once(
    harness, desk, rig, blocks, states, release, disarm
):
    node = rig()
    release(arm(harness).record, latest_contact=60.0)
    wait_for_release(harness, node)
    disarm(armed=True)
    disarm(armed=False)
    (block,) = blocks.wait_for_count(1)
    told = (block.triggered, block.disarmed, block.last, len(block.hammer.counts))
    assert told == (False, True, True, 0)
    wait_for_state(states, AcquisitionState.IDLE, "disarmed before the contact")
    assert desk.calls == ["configure", "arm", "disarm"]


def test_a_release_is_heard_after_the_disarming_that_followed_it(
    harness, rig, blocks, release, disarm
):
    node = rig()
    disarm(armed=False)
    harness.wait_until(lambda: not node._hammer.armed)
    release(arm(harness).record, latest_contact=60.0)
    (block,) = blocks.wait_for_count(1)
    assert block.disarmed


def test_a_hammer_that_is_disarmed_after_the_contact_takes_no_hit_away(
    harness, desk, rig, blocks, states, release, disarm
):
    node = rig(trigger_timeout=60.0)
    release(arm(harness).record, latest_contact=60.0)
    wait_for_release(harness, node)
    first, *rest = make_record().split(1000)
    desk.deliver(first)
    blocks.wait_for_count(1)
    disarm(armed=False)
    harness.wait_until(lambda: not node._hammer.armed)
    for block in rest:
        desk.deliver(block)
    got = blocks.wait(lambda got: got[-1].last)
    assert (len(got), any(block.disarmed for block in got)) == (5, False)


def test_an_arming_without_a_release_waits_until_it_is_disarmed(harness, desk, rig, blocks):
    rig()
    assert arm(harness).success
    harness.wait_until(lambda: desk.reads > 2)
    assert harness.call(Trigger, interfaces.DISARM_ACCELEROMETER).success
    harness.wait_until(lambda: "disarm" in desk.calls)
    assert arm(harness).record == 2
    assert blocks.messages == []


def test_a_record_that_stalls_gets_one_verdict_for_its_gap(
    harness, desk, rig, blocks, states, release
):
    impacts = harness.listen(interfaces.IMPACT)
    harness.add(EstimatorNode)
    rig(subscribers=2)
    record = arm(harness).record
    release(record, latest_contact=60.0)
    desk.deliver(make_record().cut(0, 700))
    wait_for_state(states, AcquisitionState.IDLE, "the record breaks off")
    (verdict,) = impacts.wait_for_count(1)
    assert verdict.record == record
    assert verdict.reasons[0].reason == "gap"
    assert "4550 points missing at point 700" in verdict.reasons[0].explanation
    # The next one is whole.
    release(arm(harness).record, latest_contact=60.0)
    desk.deliver(make_record())
    assert [item.record for item in impacts.wait_for_count(2)] == [record, record + 1]


@pytest.mark.parametrize("is_released", [False, True])
def test_a_record_that_is_called_off_is_ended(harness, desk, rig, blocks, release, is_released):
    node = rig(trigger_timeout=60.0)
    record = arm(harness).record
    if is_released:
        release(record, latest_contact=60.0)
        wait_for_release(harness, node)
    desk.deliver(make_record().cut(0, 700))
    blocks.wait_for_count(1)
    assert harness.call(Trigger, interfaces.DISARM_ACCELEROMETER).success
    got = blocks.wait(lambda got: got[-1].last)
    # Behind the missing points, so that the estimator sees a gap.
    assert got[-1].first_sample == 5250
    assert len(got[-1].hammer.counts) == 0


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("serial = 7", "serial = 70", ("rig.toml: line ", "a whole number between 1 and 9")),
        ('"desk"', '"unpaid"', ("'desk_digitizer_license'", "desk-digitizer")),
    ],
)
def test_a_wrong_key_of_a_driver_and_its_missing_library_are_named(rig, old, new, words):
    node = rig(SOURCE.replace(old, new))
    assert not node.is_configured
    assert all(word in node.fault for word in words)


def test_refuses_an_unknown_sample_by_name_and_to_arm_twice_until_disarmed(harness, rig):
    rig(source="")
    answer = arm(harness, sample="tin")
    assert not answer.success
    assert "unknown sample 'tin'" in answer.message
    assert "'steel small'" in answer.message
    # The same request again is the same arming.
    assert arm(harness).record == arm(harness).record == 1
    assert "already armed" in arm(harness, impact=2).message
    assert harness.call(Trigger, interfaces.DISARM_ACCELEROMETER).success
    assert arm(harness).success


@pytest.mark.parametrize(
    ("parameters", "told"),
    [
        ({}, "'estimator' does not listen"),
        (
            {"mode": "continuous", "stream_block_size": 50_000},
            "no node finds impacts in /acceleration/stream",
        ),
    ],
)
def test_in_a_campaign_says_not_yet_until_those_who_must_not_miss_a_block_are_connected(
    harness, blocks, parameters, told
):
    harness.add(AccelerometerNode, **parameters)
    setup = setup_to_msg(PAPER_SETUP, stamp_to_msg(1))
    setup.campaign_id = id_to_msg(make_id())
    join = JoinCampaign.Request(setup=setup)
    assert harness.call(JoinCampaign, interfaces.make_join_name("accelerometer"), join).success
    request = Arm.Request(campaign_id=setup.campaign_id, sample=SAMPLE, impact=1, attempt=1)
    answers = []

    def ask():
        answers.append(harness.call(Arm, interfaces.ARM_ACCELEROMETER, request))
        return told in answers[-1].message

    harness.wait_until(ask)
    assert answers[-1].later
    assert not answers[-1].success
