"""A campaign pauses while something is missing, says why, and goes on with its hits."""

import signal

import pytest
from action_msgs.msg import GoalStatus
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import CampaignState, HammerState
from impact_rig_msgs.srv import Act, GetResults, JoinCampaign

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.given.errors import DeviceError
from impact_rig.devices.virtual.drivers import VirtualHolder
from impact_rig.nodes import interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.campaign import CampaignNode
from impact_rig.nodes.campaign_client import CampaignClient
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.intake import Received
from impact_rig.nodes.ledger import Ledger
from impact_rig.status.states import Step

from .campaigns import Onlooker, RealHolder, arm, begin, cancel, start_rig, wait_for_impact

STRIKING, PAUSED = CampaignState.STRIKING, CampaignState.PAUSED
START_PATIENCE = 60.0
MANY = 100_000
"""Impacts that no test waits for."""
JOIN_ESTIMATOR = interfaces.make_join_name("estimator")
FOR_GOOD = {"reconnect_period": 0.0}
"""A lost device stays away until the test brings it back."""
SOON = {"verdict_timeout": 1.0}


def strike_on(harness, **parameters):
    """Start a rig and a campaign without end; return handle and feedback after the first hit."""
    client = start_rig(harness, **{"campaign": SOON, **parameters})
    handle, feedback = begin(harness, client, samples=["steel small"], impacts=MANY)
    wait_for_impact(harness, feedback, 1)
    return handle, feedback


def wait_for_state(feedback, state, word=""):
    """Wait until the campaign says that it is in a state; return its message."""
    seen = len(feedback.messages)
    got = feedback.wait(
        lambda got: any(item.state == state and word in item.message for item in got[seen:])
    )
    return next(
        item.message for item in got[seen:] if item.state == state and word in item.message
    )


def wait_for_more_hits(harness, feedback):
    wait_for_impact(harness, feedback, feedback.messages[-1].impact + 1)


def check_that_no_hit_is_double_or_missing(result):
    hits = [*result.accepted, *result.rejected]
    assert len({hit.record for hit in hits}) == len(hits)
    assert [hit.impact for hit in result.accepted] == list(range(1, len(result.accepted) + 1))


def test_whatever_disarms_the_hammer_a_person_arms_it(harness):
    handle, feedback = strike_on(harness)
    for service in (interfaces.DISARM_HAMMER, interfaces.EMERGENCY_STOP):
        harness.call(Act, service)
        assert "then arm" in wait_for_state(feedback, PAUSED, "is not armed")
        heard = harness.listen(interfaces.HAMMER_STATE)
        harness.call(Act, interfaces.RESET_HAMMER)
        wait_for_state(feedback, PAUSED, "is not armed")
        assert not [state for state in heard.messages if state.armed]
        arm(harness)
        wait_for_more_hits(harness, feedback)
    check_that_no_hit_is_double_or_missing(cancel(harness, handle).result)


def test_where_nobody_is_there_a_pause_that_a_person_would_end_is_an_end(harness):
    start_rig(harness, campaign=SOON)
    states = harness.listen(interfaces.CAMPAIGN_STATE)

    def disarm(rig):
        if rig.campaign.progress.accepted == 1 and not calls:
            calls.append(harness.peer.create_client(Act, interfaces.DISARM_HAMMER))
            calls[0].call_async(Act.Request())

    calls = []
    goal = RunCampaign.Goal(samples=["steel small"], impacts=MANY)
    with CampaignClient() as client:
        client.wait_for_rig(START_PATIENCE)
        outcome = client.run(goal, Onlooker(disarm), longest_pause=1.0)
    assert not outcome.success
    assert outcome.message.startswith("no person ended this pause: the hammer is not armed")
    told = states.wait(lambda got: got[-1].state == CampaignState.ENDED)[-1].message
    assert told.startswith("cancelled in a pause: the hammer is not armed")
    assert [hit.impact for hit in outcome.results.hits if hit.accepted][:1] == [1]


def test_where_nobody_is_there_a_silent_estimator_ends_it_while_its_process_lives(
    harness, start_process
):
    estimator = start_process("estimator")
    harness.add(AccelerometerNode, trigger_timeout=0.2)
    harness.add(HammerNode, swing_time=0.001)
    harness.record()
    campaign = harness.add(CampaignNode, **SOON)
    campaign.silence, campaign.answer_timeout = 1.0, 2.0
    harness.wait_until(harness.peer.create_client(JoinCampaign, JOIN_ESTIMATOR).service_is_ready)

    def stop(rig):
        if rig.campaign.progress.accepted >= 1:
            estimator.process.send_signal(signal.SIGSTOP)

    goal = RunCampaign.Goal(samples=["steel small"], impacts=MANY)
    with CampaignClient() as client:
        client.wait_for_rig(START_PATIENCE)
        with pytest.raises(DeviceError, match=r"^no person ended this pause: estimator/"):
            client.run(goal, Onlooker(stop), longest_pause=1.0)
        still = harness.peer.create_client(GetResults, interfaces.GET_RESULTS)
        harness.wait_until(still.service_is_ready)


@pytest.mark.parametrize("holder", [VirtualHolder, RealHolder])
def test_where_nobody_is_there_an_estimator_that_was_only_late_ends_it_at_a_real_hammer_alone(
    harness, start_process, holder
):
    estimator = start_process("estimator")
    harness.add(AccelerometerNode, trigger_timeout=0.2)
    hammer = harness.add(HammerNode, swing_time=0.001, lead_time=0.0)._hammer
    harness.run(lambda: hammer.take(holder(TomlTable({})), confirm_return=False))
    harness.record()
    harness.add(CampaignNode, **SOON).answer_timeout = 1.0
    harness.wait_until(harness.peer.create_client(JoinCampaign, JOIN_ESTIMATOR).service_is_ready)
    reasons = []

    def be_late(rig):
        if rig.campaign.progress.accepted == 1 and not reasons:
            estimator.process.send_signal(signal.SIGSTOP)
        if rig.campaign.state is Step.PAUSED and not reasons:
            reasons.append(rig.campaign.message)
            estimator.process.send_signal(signal.SIGCONT)

    goal = RunCampaign.Goal(samples=["steel small"], impacts=3)
    with CampaignClient() as client:
        client.wait_for_rig(START_PATIENCE)
        outcome = client.run(
            goal, Onlooker(be_late), longest_pause=20.0 if holder.hammerless else 3.0
        )
    assert reasons
    assert outcome.success is holder.hammerless, outcome.message
    assert outcome.success or "make sure that it can strike no one" in outcome.message


def test_a_device_that_was_lost_and_is_back_is_used_again_once_a_person_has_armed(harness):
    handle, feedback = strike_on(harness, hammer=FOR_GOOD, **FOR_GOOD)
    for kind in (HammerNode, AccelerometerNode):
        node = harness.find(kind)
        harness.run(lambda node=node: node.lose_device(DeviceError("its cable was pulled")))
        wait_for_state(feedback, PAUSED, "its cable was pulled")
        harness.run(node.autostart)
        wait_for_state(feedback, PAUSED, "is not armed")
        arm(harness)
        wait_for_more_hits(harness, feedback)
    check_that_no_hit_is_double_or_missing(cancel(harness, handle).result)


def test_a_node_that_was_deactivated_and_is_active_again_is_used_again(harness):
    handle, feedback = strike_on(harness)
    harness.find(CampaignNode).answer_timeout = 1.0
    for kind in (EstimatorNode, AccelerometerNode, HammerNode):
        node = harness.find(kind)
        harness.run(node.trigger_deactivate)
        wait_for_state(feedback, PAUSED, f"the {node.get_name()} node is not active")
        harness.run(node.trigger_activate)
        arm(harness)
        wait_for_more_hits(harness, feedback)
    # Of an estimator, too: what it had judged before is in the recording.
    check_that_no_hit_is_double_or_missing(cancel(harness, handle).result)


def wait_for_cause(harness, campaign, cause):
    """Wait until the campaign knows what disarmed the hammer."""
    harness.wait_until(lambda: campaign._hammer.disarmed_by == cause)


def resume(harness):
    return harness.call(Act, interfaces.RESUME_CAMPAIGN)


def test_a_person_pauses_a_campaign_and_resumes_it(harness):
    handle, feedback = strike_on(harness)
    assert "no campaign is paused" in resume(harness).message
    states = harness.listen(interfaces.HAMMER_STATE)
    answer = harness.call(Act, interfaces.PAUSE_CAMPAIGN)
    assert answer.success, answer.message
    states.wait(lambda got: not got[-1].armed)
    wait_for_state(feedback, PAUSED, "paused by an operator")
    latched = harness.listen(interfaces.CAMPAIGN_STATE)
    (state,) = latched.wait(lambda got: got[-1].state == PAUSED)[-1:]
    assert (state.task, state.sample) == (CampaignState.RESUME, "steel small")

    harness.call(Act, interfaces.EMERGENCY_STOP)
    campaign = harness.find(CampaignNode)
    wait_for_cause(harness, campaign, HammerState.EMERGENCY_STOP)
    assert "emergency stop lasts" in resume(harness).message
    harness.call(Act, interfaces.RESET_HAMMER)
    wait_for_cause(harness, campaign, HammerState.PERSON)
    refusal = resume(harness)
    assert (refusal.success, refusal.message[:20]) == (False, "arm the hammer first")
    arm(harness)  # the pause takes that enable back
    wait_for_cause(harness, campaign, HammerState.CAMPAIGN)
    assert resume(harness).success
    wait_for_more_hits(harness, feedback)
    # Right after a pause, whose disarming is still on its way.
    assert harness.call(Act, interfaces.PAUSE_CAMPAIGN).success
    assert resume(harness).success
    wait_for_more_hits(harness, feedback)
    check_that_no_hit_is_double_or_missing(cancel(harness, handle).result)


def test_a_pause_that_takes_too_long_ends_the_campaign_with_its_reason(harness):
    handle, _ = strike_on(harness, campaign={"pause_timeout": 0.3})
    harness.call(Act, interfaces.DISARM_HAMMER)
    answer = harness.wait(handle.get_result_async())
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert answer.result.message.startswith("the pause took longer than 0.3 s: the hammer is not")
    assert answer.result.accepted


def test_hits_without_a_verdict_end_it_and_none_is_counted(harness, monkeypatch):
    for callback in ("_on_block", "_on_stored"):
        monkeypatch.setattr(EstimatorNode, callback, lambda *_: None)
    client = start_rig(harness, campaign={"verdict_timeout": 0.1})
    releases = harness.listen(interfaces.RELEASE)
    handle, feedback = begin(
        harness, client, samples=["steel small"], impacts=2, attempts_per_impact=3
    )
    result = harness.wait(handle.get_result_async()).result
    assert result.message == (
        "steel small: 3 hits in a row were rejected or got no verdict, the last one: no verdict on"
        " record 3 came within 0.1 s"
    )
    assert [message.record for message in releases.messages] == [1, 2, 3]
    assert not result.accepted
    assert any("no verdict on record 1" in item.message for item in feedback.messages)


def test_a_record_that_is_not_stored_is_waited_for(harness, monkeypatch):
    held = []
    handle, feedback = strike_on(harness, campaign={"verdict_timeout": 0.2})
    with monkeypatch.context() as patch:
        patch.setattr(Ledger, "add_stored", lambda _, message: held.append(message) or ())
        wait_for_state(feedback, PAUSED, "the recorder has not stored record")
    estimator = harness.find(EstimatorNode)
    harness.run(lambda: [estimator._on_stored(Received(message, message)) for message in held])
    wait_for_more_hits(harness, feedback)
    check_that_no_hit_is_double_or_missing(cancel(harness, handle).result)
