"""A campaign pauses while something is lost or stopped, says why, and goes on with its hits."""

import pytest
from action_msgs.msg import GoalStatus
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import (
    AcquisitionState,
    HammerState,
    Impact,
    RecorderState,
    RecordStored,
)
from impact_rig_msgs.srv import Arm, Release
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from impact_rig.core.errors import DeviceError
from impact_rig.devices.virtual.drivers import VirtualSource
from impact_rig.nodes import interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.campaign import CampaignNode
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.recorder import RecorderNode

from .campaigns import begin, make_client, start_rig

RUNNING, PAUSED = RunCampaign.Feedback.RUNNING, RunCampaign.Feedback.PAUSED
WAITING_FOR_HAMMER = RunCampaign.Feedback.WAITING_FOR_HAMMER
MANY = 100_000
"""Impacts that no test waits for."""
FOR_GOOD = {"reconnect_period": 0.0}
"""A lost device stays away until the test brings it back."""


def strike_on(harness, **parameters):
    """Start a rig and a campaign without end; return handle and feedback after the first hit."""
    client = start_rig(harness, **parameters)
    handle, feedback = begin(harness, client, samples=["steel small"], impacts=MANY)
    feedback.wait(lambda got: got[-1].impact >= 1)
    return handle, feedback


def wait_for_phase(feedback, phase, word=""):
    """Wait until the campaign says that it is in a phase; return its message."""
    got = feedback.wait(
        lambda got: got[-1:] and got[-1].phase == phase and word in got[-1].message
    )
    return got[-1].message


def wait_for_more_hits(feedback):
    """Wait until the campaign has gone on."""
    before = feedback.messages[-1].impact
    feedback.wait(lambda got: got[-1].phase == RUNNING and got[-1].impact > before)


def wait_for_word_that_it_goes_on(feedback, seen):
    """Wait for it behind the messages seen, though the next pause may have been told since."""
    feedback.wait(lambda got: any(item.phase == RUNNING for item in got[seen:]))


def cancel(harness, handle):
    harness.wait(handle.cancel_goal_async())
    return harness.wait(handle.get_result_async())


def check_that_no_hit_is_double_or_missing(result):
    hits = [*result.accepted, *result.rejected]
    assert len({hit.record for hit in hits}) == len(hits)
    # One that was under way may have been accepted when the campaign was cancelled.
    assert [hit.impact for hit in result.accepted] == list(range(1, len(result.accepted) + 1))


def test_a_hammer_that_a_person_disarms_is_armed_by_a_person(harness):
    handle, feedback = strike_on(harness)
    harness.call(Trigger, interfaces.DISARM_HAMMER)
    message = wait_for_phase(feedback, PAUSED, "to go on")
    assert "disarmed by the operator" in message
    assert "hammer/arm" in message
    harness.call(Trigger, interfaces.ARM_HAMMER)
    wait_for_more_hits(feedback)
    result = cancel(harness, handle).result
    check_that_no_hit_is_double_or_missing(result)
    assert not result.rejected


def find_node(harness, kind):
    (node,) = (node for node in harness.nodes if isinstance(node, kind))
    return node


def lose(harness, kind):
    """Let a node's device fail, as its driver would say it."""
    node = find_node(harness, kind)
    harness.run(lambda: node.lose_device(DeviceError("its cable was pulled")))


def bring_back(harness, kind):
    """Configure and activate a node again, as it does itself where it may."""
    harness.run(find_node(harness, kind).autostart)


@pytest.mark.parametrize(
    ("kind", "word"),
    [
        (HammerNode, "the hammer's device is lost: its cable was pulled"),
        (AccelerometerNode, "the accelerometer's device is lost: its cable was pulled"),
    ],
)
def test_a_device_that_was_lost_and_is_back_is_used_again(harness, kind, word):
    handle, feedback = strike_on(harness, hammer=FOR_GOOD, **FOR_GOOD)
    lose(harness, kind)
    wait_for_phase(feedback, PAUSED, word)
    bring_back(harness, kind)
    wait_for_more_hits(feedback)
    lose(harness, kind)
    wait_for_phase(feedback, PAUSED, word)
    answer = cancel(harness, handle)
    assert answer.status == GoalStatus.STATUS_CANCELED
    check_that_no_hit_is_double_or_missing(answer.result)


@pytest.mark.parametrize(
    ("kind", "name", "is_short"),
    [(EstimatorNode, "estimator", False), (AccelerometerNode, "accelerometer", True)],
)
def test_a_node_that_was_deactivated_and_is_active_again_is_used_again(
    harness, monkeypatch, kind, name, is_short
):
    # Within one process a state is there at once.
    monkeypatch.setattr("impact_rig.nodes.campaign_hits.STATE_TIMEOUT", 0.5)
    handle, feedback = strike_on(harness)
    node = find_node(harness, kind)
    harness.run(node.trigger_deactivate)
    if not is_short:
        wait_for_phase(feedback, PAUSED, f"the {name} node is not active: activate it")
    harness.run(node.trigger_activate)
    wait_for_more_hits(feedback)
    check_that_no_hit_is_double_or_missing(cancel(harness, handle).result)


def test_a_hammer_node_that_was_deactivated_is_activated_and_armed_by_a_person(harness):
    handle, feedback = strike_on(harness)
    node = find_node(harness, HammerNode)
    harness.run(node.trigger_deactivate)
    wait_for_phase(
        feedback,
        PAUSED,
        "the hammer node is not active: to go on, activate the hammer node, then call hammer/arm",
    )
    harness.run(node.trigger_activate)
    # It may have swung, and be back since.
    message = wait_for_phase(feedback, PAUSED, "is not armed (")
    assert "disarmed when the hammer node was deactivated)" in message
    harness.call(Trigger, interfaces.ARM_HAMMER)
    wait_for_more_hits(feedback)
    cancel(harness, handle)


def test_a_hit_that_a_loss_has_spoiled_is_struck_again_and_not_held_against_the_rig(
    harness, monkeypatch
):
    def fail(*_):
        raise DeviceError("its cable was pulled")

    client = start_rig(harness, hammer={"swing_time": 0.2}, reconnect_period=0.1)
    releases, states = map(harness.listen, (interfaces.RELEASE, interfaces.ACQUISITION_STATE))
    handle, feedback = begin(
        harness, client, samples=["steel small"], impacts=2, attempts_per_impact=1
    )
    releases.wait_for_count(1)
    with monkeypatch.context() as patch:
        patch.setattr(VirtualSource, "read", fail)
        states.wait(lambda got: "its cable was pulled" in {state.message for state in got})
    result = harness.wait(handle.get_result_async()).result
    assert result.success, result.message
    # It has a verdict, and only one: that nothing came.
    assert [(hit.record, hit.impact, hit.attempt) for hit in result.rejected] == [(1, 1, 1)]
    assert [(hit.impact, hit.attempt) for hit in result.accepted] == [(1, 2), (2, 1)]
    assert any(item.phase == PAUSED for item in feedback.messages)


def test_an_emergency_stop_is_ended_by_a_person_only(harness):
    handle, feedback = strike_on(harness)
    harness.call(Trigger, interfaces.EMERGENCY_STOP)
    message = wait_for_phase(feedback, PAUSED, "emergency stop:")
    assert "hammer/reset" in message
    heard = harness.listen(interfaces.HAMMER_STATE)
    harness.call(Trigger, interfaces.RESET_HAMMER)
    # Reset, but not armed: the campaign must not take that for the operator's enable.
    wait_for_phase(feedback, PAUSED, "emergency stop ended")
    assert not [state for state in heard.messages if state.armed]
    harness.call(Trigger, interfaces.ARM_HAMMER)
    wait_for_more_hits(feedback)
    check_that_no_hit_is_double_or_missing(cancel(harness, handle).result)


def test_a_loss_does_not_arm_a_hammer_that_a_person_has_disarmed(harness):
    handle, feedback = strike_on(harness, hammer=FOR_GOOD)
    harness.call(Trigger, interfaces.DISARM_HAMMER)
    wait_for_phase(feedback, PAUSED, "disarmed by the operator")
    heard = harness.listen(interfaces.HAMMER_STATE)
    lose(harness, HammerNode)
    wait_for_phase(feedback, PAUSED, "its cable was pulled")
    bring_back(harness, HammerNode)
    wait_for_phase(feedback, PAUSED, "hammer/arm")
    assert not [state for state in heard.messages if state.armed]
    cancel(harness, handle)


def test_a_hammer_that_is_put_back_by_hand_is_waited_for(harness):
    client = start_rig(harness, hammer={"confirm_return": True})
    handle, feedback = begin(harness, client, samples=["steel small"], impacts=2)
    assert "hammer/confirm_held" in wait_for_phase(feedback, WAITING_FOR_HAMMER)
    assert feedback.messages[-1].impact == 1
    harness.call(Trigger, interfaces.CONFIRM_HELD)
    assert harness.wait(handle.get_result_async()).result.success


def test_a_pause_that_takes_too_long_ends_the_campaign_with_its_reason(harness):
    handle, _ = strike_on(harness, campaign={"pause_timeout": 0.05})
    harness.call(Trigger, interfaces.DISARM_HAMMER)
    answer = harness.wait(handle.get_result_async())
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert answer.result.message.startswith("the pause took longer than 0.05 s: the hammer is not")
    assert answer.result.accepted


class StandIn:
    """Stands in for an accelerometer node that is lost after a release, and says no more of it."""

    def __init__(self, harness, records) -> None:
        self.armed = []
        self._records = iter(records)
        self._states = harness.advertise(interfaces.ACQUISITION_STATE)
        harness.peer.create_service(Arm, interfaces.ARM_ACCELEROMETER, self._arm)
        harness.peer.create_service(Trigger, interfaces.DISARM_ACCELEROMETER, self._disarm)
        topic = interfaces.RELEASE
        harness.peer.create_subscription(topic.type, topic.name, self._lose, topic.qos)
        self.come_back()

    def come_back(self) -> None:
        self._states.publish(AcquisitionState(state=AcquisitionState.IDLE))

    def _arm(self, request, response):
        self.armed.append((request.impact, request.attempt))
        response.success, response.record = True, next(self._records)
        self._states.publish(
            AcquisitionState(
                state=AcquisitionState.ARMED, record=response.record, sample=request.sample
            )
        )
        return response

    def _disarm(self, _, response):
        response.success = True
        return response

    def _lose(self, _) -> None:
        self._states.publish(AcquisitionState(state=AcquisitionState.FAULT, message="unplugged"))


def start_losing_rig(harness, records):
    """Start a rig with a stand-in; return that and a client of the campaign."""
    harness.add(HammerNode, swing_time=0.001, require_recorder=False)
    harness.add(EstimatorNode)
    harness.add(CampaignNode, verdict_timeout=0.1)
    return StandIn(harness, records), make_client(harness)


def test_a_hit_of_which_no_verdict_comes_is_struck_again_with_a_record_of_its_own(harness):
    accelerometers, client = start_losing_rig(harness, records=(1, 2, 3))
    handle, feedback = begin(
        harness, client, samples=["steel small"], impacts=2, attempts_per_impact=1
    )
    for _ in range(2):
        wait_for_phase(feedback, PAUSED, "unplugged")
        seen = len(feedback.messages)
        accelerometers.come_back()
        wait_for_word_that_it_goes_on(feedback, seen)
    wait_for_phase(feedback, PAUSED, "unplugged")
    assert accelerometers.armed == [(1, 1), (1, 2), (1, 3)]
    assert not cancel(harness, handle).result.rejected


def test_a_verdict_that_comes_late_is_none_on_the_next_sample(harness):
    accelerometers, client = start_losing_rig(harness, records=(1, 2, 3))
    estimator, campaign = find_node(harness, EstimatorNode), find_node(harness, CampaignNode)
    releases = harness.listen(interfaces.RELEASE)
    handle, feedback = begin(harness, client, samples=["steel small", "brass small"], impacts=1)
    wait_for_phase(feedback, PAUSED, "unplugged")
    # The second hit's verdict is waited for, and that on the first comes with it.
    campaign.set_parameters([Parameter("verdict_timeout", value=60.0)])
    accelerometers.come_back()
    releases.wait_for_count(2)
    for record in (1, 2):
        verdict = Impact(record=record, sample="steel small", impact=1, accepted=True)
        verdict.setup_stamp = estimator._setup_stamp
        estimator._impact.publish(verdict)
    feedback.wait(lambda got: got[-1].sample == "brass small")
    accelerometers.come_back()
    harness.wait_until(lambda: accelerometers.armed == [(1, 1), (1, 2), (1, 1)])
    cancel(harness, handle)


def test_an_enable_that_was_given_and_taken_unheard_is_a_pause(harness, monkeypatch):
    """As by a cable that was pulled and put back between arming and release."""
    states, asked = harness.advertise(interfaces.HAMMER_STATE), []

    def arm(_, response):
        if asked:
            states.publish(HammerState(armed=True))
        response.success = True
        return response

    def release(_, response):
        asked.append("release")
        response.success = len(asked) > 1
        if not response.success:
            monkeypatch.setattr("impact_rig.nodes.campaign_hits.STATE_TIMEOUT", 60.0)
            states.publish(HammerState(disarmed_by=HammerState.LOSS, message="cable pulled"))
        return response

    monkeypatch.setattr("impact_rig.nodes.campaign_hits.STATE_TIMEOUT", 0.1)
    harness.peer.create_service(Trigger, interfaces.ARM_HAMMER, arm)
    harness.peer.create_service(Release, interfaces.RELEASE_HAMMER, release)
    harness.add(EstimatorNode)
    harness.add(CampaignNode)
    StandIn(harness, records=(1, 2))
    handle, feedback = begin(harness, make_client(harness), samples=["steel small"], impacts=1)
    feedback.wait(lambda got: any("(cable pulled)" in item.message for item in got))
    harness.wait_until(lambda: len(asked) > 1)
    cancel(harness, handle)


def test_a_recorder_that_stops_in_a_pause_ends_the_campaign(harness):
    recorder = harness.advertise(interfaces.RECORDER_STATE)
    _, client = start_losing_rig(harness, records=(1,))
    harness.wait_until(lambda: recorder.get_subscription_count() >= 3)
    recorder.publish(RecorderState(recording=True, uri="a.mcap"))
    assert recorder.wait_for_all_acked()
    handle, feedback = begin(harness, client, samples=["steel small"], impacts=2)
    wait_for_phase(feedback, PAUSED, "unplugged")
    recorder.publish(RecorderState(uri="a.mcap", message="the disk is full"))
    result = harness.wait(handle.get_result_async()).result
    assert result.message == "the recorder has stopped: the disk is full"


def test_a_hit_without_a_verdict_is_struck_again_and_the_second_in_a_row_ends_it(
    harness, tmp_path
):
    client = start_rig(harness, campaign={"verdict_timeout": 1.5})
    harness.add(RecorderNode, output=str(tmp_path / "session.mcap"))
    forger = harness.peer.create_publisher(
        RecordStored, interfaces.RECORD_STORED.name, interfaces.RECORD_STORED.leased_qos
    )
    harness.wait_until(lambda: forger.get_subscription_count() >= 2)  # campaign and estimator
    for record in (2, *range(4, 20)):  # are never whole for the estimator
        forged = RecordStored(record=record, blocks=0, complete=True)
        forged.header.stamp.sec = 2_000_000_000
        forger.publish(forged)
    handle, feedback = begin(harness, client, samples=["steel small"], impacts=MANY)
    answer = harness.wait(handle.get_result_async())
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert answer.result.message.startswith("no verdict on record ")
    assert [hit.record for hit in answer.result.accepted] == [1, 3]
    paused = [message.message for message in feedback.messages if message.phase == PAUSED]
    assert "no verdict on record 2 came within 1.5 s" in paused
    assert answer.result.message not in paused
