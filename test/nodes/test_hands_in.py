"""Nobody is struck: hands in, hammer disarmed; notice before it goes; a person ends a stop."""

from dataclasses import replace

import pytest
from impact_rig_msgs.msg import CampaignState, HammerState, Overrule
from impact_rig_msgs.srv import Act, ConfirmSample, OverruleHit

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.nodes import interfaces
from impact_rig.nodes.campaign import CampaignNode
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.intake import Received
from impact_rig.recordings.fields import stamp_from_msg
from impact_rig.status.states import HammerPlace

from .campaigns import RealHolder, begin, cancel, run, start_rig

FIRST, SECOND = "steel small", "brass small"
NOTICE = 0.4  # [s]


class Followed:
    """A campaign under way, with what campaign, hammer and releases say of it."""

    def __init__(self, harness, *, samples=(FIRST,), impacts=1, confirm=False, **parameters):
        self.client = start_rig(harness, **parameters)
        self.harness = harness
        self.states = harness.listen(interfaces.CAMPAIGN_STATE)
        self.hammer = harness.listen(interfaces.HAMMER_STATE)
        self.releases = harness.listen(interfaces.RELEASE)
        self.goal = {"samples": samples, "impacts": impacts, "confirm_samples": confirm}

    def begin(self):
        self.handle, self.feedback = begin(self.harness, self.client, **self.goal)
        return self

    def wait_for(self, task, sample=FIRST, word=""):
        """Wait until a task of a person is asked for; return the state."""
        return self.states.wait(
            lambda got: (
                (got[-1].task, got[-1].sample) == (task, sample) and word in got[-1].message
            )
        )[-1]

    def wait_for_hammer(self, condition):
        return self.hammer.wait(lambda got: condition(got[-1]))[-1]

    def ask(self, service):
        answer = self.harness.call(Act, service)
        assert answer.success, answer.message

    def confirm(self, sample):
        request = ConfirmSample.Request(sample=sample)
        return self.harness.call(ConfirmSample, interfaces.CONFIRM_SAMPLE, request)

    def finish(self):
        result = self.harness.wait(self.handle.get_result_async()).result
        assert result.success, result.message
        return result


def test_while_a_sample_is_mounted_the_hammer_is_disarmed_and_mounted_arms_it(harness):
    rig = Followed(harness, samples=[FIRST, SECOND], confirm=True).begin()
    rig.wait_for(CampaignState.MOUNT)
    assert not any(state.armed for state in rig.hammer.messages)
    assert rig.confirm(FIRST).success
    rig.wait_for(CampaignState.MOUNT, SECOND)
    state, why = rig.wait_for_hammer(lambda it: not it.armed), f"while {SECOND} is mounted"
    assert (state.disarmed_by, state.message) == (HammerState.CAMPAIGN, why)
    # A person who arms it now has forgotten the hands: the campaign takes that back.
    rig.ask(interfaces.ARM_HAMMER)
    rig.wait_for_hammer(lambda it: not it.armed and it.message == why)
    assert len(rig.releases.messages) == 1
    assert rig.confirm(SECOND).success
    rig.finish()


def test_while_the_hammer_is_put_back_it_is_disarmed_and_back_arms_it(harness):
    rig = Followed(harness, impacts=2, hammer={"confirm_return": True}).begin()
    rig.wait_for(CampaignState.PUT_BACK)
    state = rig.wait_for_hammer(lambda it: not it.armed)
    assert (state.state, state.message) == (HammerState.AWAY, "while the hammer is put back")
    assert len(rig.releases.messages) == 1
    rig.ask(interfaces.CONFIRM_HELD)
    rig.finish()


def test_a_hammer_that_was_started_again_is_not_one_that_a_person_has_put_back(harness):
    rig = Followed(harness, impacts=2, hammer={"confirm_return": True}).begin()
    rig.wait_for(CampaignState.PUT_BACK)
    rig.wait_for_hammer(lambda it: not it.armed)
    before, campaign = len(rig.hammer.messages), harness.find(CampaignNode)
    # The first that such a hammer says, while it is not yet missed: held, and no higher number.
    held = {"state": HammerPlace.HELD, "message": "held, not armed"}

    def is_told():
        away = interfaces.HAMMER_STATE.convert(rig.hammer.messages[-1])
        harness.run(lambda: campaign._on_hammer_state(Received(replace(away, **held), None)))
        harness.run(campaign.wake_waiters)
        return any(state.task == CampaignState.ARM for state in rig.states.messages)

    harness.wait_until(is_told)
    assert not any(state.armed for state in rig.hammer.messages[before:])
    assert len(rig.releases.messages) == 1


def test_a_verdict_while_a_sample_is_mounted_asks_once_for_the_one_that_is_needed_then(harness):
    rig = Followed(harness, samples=[FIRST, SECOND], confirm=True).begin()
    rig.wait_for(CampaignState.MOUNT)
    assert rig.confirm(FIRST).success
    rig.wait_for(CampaignState.MOUNT, SECOND)
    seen = len(rig.states.messages)
    reject = Overrule(record=1, verdict=Overrule.REJECT, reason="it was touched", who="Anna")
    reject.campaign_id = rig.states.messages[-1].campaign_id
    answer = harness.ask(
        OverruleHit, interfaces.OVERRULE_HIT, OverruleHit.Request(overrule=reject)
    )
    assert answer.success, answer.message
    # Hands are in: what is mounted now only the person knows.
    rig.wait_for(CampaignState.MOUNT, FIRST)
    asked = {(it.number, it.sample) for it in rig.states.messages[seen:] if it.task}
    assert [sample for _, sample in sorted(asked)] in ([SECOND, FIRST], [FIRST])
    assert f"waiting for {FIRST!r}" in rig.confirm(SECOND).message
    assert len(rig.releases.messages) == 1
    assert rig.confirm(FIRST).success
    rig.wait_for(CampaignState.MOUNT, SECOND)
    assert rig.confirm(SECOND).success
    assert len(rig.finish().accepted) == 2


@pytest.mark.parametrize("holds_back", [interfaces.PAUSE_CAMPAIGN, interfaces.EMERGENCY_STOP])
def test_notice_is_given_before_each_release_and_an_act_in_it_holds_the_hammer_back(
    harness, holds_back
):
    rig = Followed(harness, hammer={"lead_time": NOTICE}).begin()
    state = rig.wait_for(CampaignState.KEEP_AWAY)
    assert state.until.sec
    rig.ask(holds_back)
    rig.wait_for_hammer(lambda it: not it.armed)
    paused = rig.states.wait(lambda got: got[-1].state == CampaignState.PAUSED)[-1]
    assert paused.task in (CampaignState.RESUME, CampaignState.ARM)
    assert not rig.releases.messages
    if holds_back == interfaces.EMERGENCY_STOP:
        rig.ask(interfaces.RESET_HAMMER)
        rig.ask(interfaces.ARM_HAMMER)
    else:
        rig.ask(interfaces.RESUME_CAMPAIGN)
    state = rig.wait_for(CampaignState.KEEP_AWAY)
    result = rig.finish()
    (release,) = rig.releases.messages
    assert stamp_from_msg(release.header.stamp) >= stamp_from_msg(state.until)
    assert len(result.accepted) == 1


@pytest.mark.parametrize(("stated", "lead_time"), [(None, 3.0), (0.0, 0.0)])
def test_where_a_holder_lets_a_hammer_go_notice_is_three_seconds_unless_stated(
    harness, stated, lead_time
):
    states = harness.listen(interfaces.HAMMER_STATE)
    node = harness.add(HammerNode, **({} if stated is None else {"lead_time": stated}))
    assert states.wait_for_count(1)[0].lead_time == 0.0  # of the virtual rig
    harness.run(lambda: node._hammer.take(RealHolder(TomlTable({})), confirm_return=False))
    harness.run(node._hammer.arm)
    states.wait(lambda got: got[-1].armed and got[-1].lead_time == lead_time)


def test_after_a_stop_and_its_reset_neither_start_nor_mounted_arms_but_a_person_does(harness):
    rig = Followed(harness, confirm=True)
    rig.ask(interfaces.EMERGENCY_STOP)
    rig.ask(interfaces.RESET_HAMMER)
    rig.begin()
    rig.wait_for(CampaignState.MOUNT)
    assert rig.confirm(FIRST).success
    state = rig.wait_for(CampaignState.ARM, word="then arm")
    assert "emergency stop ended by an operator, not armed" in state.message
    assert not any(state.armed for state in rig.hammer.messages)
    assert not rig.releases.messages
    rig.ask(interfaces.ARM_HAMMER)
    rig.finish()
    # From now on a start arms, as before the stop.
    assert run(harness, rig.client, **{**rig.goal, "confirm_samples": False}).result.success
    # What a person has disarmed, a person arms, too.
    rig.ask(interfaces.DISARM_HAMMER)
    rig.goal["confirm_samples"] = False
    rig.begin()
    rig.wait_for(CampaignState.ARM, word="disarmed by an operator")
    assert not cancel(harness, rig.handle).result.success
