"""An act belongs to the state that a person saw: what is too old does nothing."""

from dataclasses import replace
from itertools import pairwise

import pytest
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import HammerState
from impact_rig_msgs.srv import Act, ConfirmSample

from impact_rig.nodes import interfaces
from impact_rig.nodes.acts import BEAT, REACTION, NumberedState, fill_act
from impact_rig.nodes.campaign_state import tell
from impact_rig.nodes.hammer import HammerNode
from impact_rig.status.states import HammerStatus, Step, Task

from .campaigns import begin, run, start_rig

NOW = 5_000_000_000  # [ns]
LATE = -1.0  # [s]


@pytest.mark.parametrize(("late", "is_done"), [(0, True), (1, False)])
def test_an_act_is_done_up_to_its_deadline_and_not_after(late, is_done):
    seen = HammerStatus(stamp=NOW)
    state = NumberedState(lambda: NOW + round(REACTION * 1e9) + late, lambda **_: None)
    refusal = state.refuse(fill_act(Act.Request(), seen, ""))
    assert (refusal is None) == is_done
    assert state.refuse(Act.Request()) is None  # which states no deadline


def test_an_act_from_another_state_than_the_newest_is_refused():
    sent = []
    state = NumberedState(lambda: NOW, lambda **fields: sent.append(fields))
    state.publish(armed=False)
    seen = HammerStatus(stamp=NOW, number=state.number)
    act = fill_act(Act.Request(), seen, "Anna")
    assert (act.by, state.refuse(act)) == ("Anna", None)
    for fields in ({}, {"armed": False}):  # it says so again
        state.publish(**fields)
        assert state.refuse(act) is None
    state.publish(armed=True)
    assert "changed" in state.refuse(act)
    assert [fields["number"] for fields in sent] == [1, 1, 1, 2]
    act = fill_act(Act.Request(), replace(seen, number=state.number), "Anna")
    assert state.refuse(act) is None
    state.renew()  # the node stood still
    assert "changed" in state.refuse(act)


def test_what_a_campaign_tells_is_its_task_and_not_that_it_looks_if_it_can_go_on():
    state = NumberedState(lambda: NOW, lambda **_: None, tell)
    paused = {"task": Task.ARM, "message": "not armed", "sample": "steel"}
    first = state.count({"state": Step.PAUSED, **paused})
    assert state.count({"state": Step.JOINING}) == first
    assert state.count({"state": Step.COUNTING}) == first
    for change in (
        {"message": "the recorder has gone"},
        {"task": Task.MOUNT},
        {"sample": "brass"},
        {"state": Step.STRIKING},
        {"state": Step.ENDED},
    ):
        before = state.number
        assert state.count(change) == before + 1


def read(topic, collector):
    """Return the newest state that was published."""
    return topic.convert(collector.wait_for_count(1)[-1])


def test_a_hammer_says_twice_a_second_that_it_is_there(harness):
    harness.add(HammerNode)
    states = harness.listen(interfaces.HAMMER_STATE).wait_for_count(4)
    stamps = [interfaces.HAMMER_STATE.convert(item).stamp for item in states[-3:]]
    assert all(0 < later - sooner <= BEAT * 1e9 for sooner, later in pairwise(stamps))
    assert len({item.number for item in states[-3:]}) == 1


@pytest.mark.parametrize(("within", "other"), [(LATE, 0), (REACTION, 1)])
def test_what_may_lead_to_a_swing_is_refused_late_and_what_prevents_one_never(
    harness, within, other
):
    harness.add(HammerNode)
    states = harness.listen(interfaces.HAMMER_STATE)

    def ask(service):
        state = read(interfaces.HAMMER_STATE, states)
        seen = replace(state, number=state.number + other)
        return harness.call(Act, service, fill_act(Act.Request(), seen, "Anna", within))

    for service in (interfaces.ARM_HAMMER, interfaces.CONFIRM_HELD):
        assert ask(service).message.startswith("not done")
    assert not states.messages[-1].armed
    for service in (interfaces.DISARM_HAMMER, interfaces.EMERGENCY_STOP):
        assert ask(service).success
    (stopped,) = states.wait(lambda got: got[-1].stopped_by)[-1:]
    assert (stopped.stopped_by, stopped.message) == ("Anna", "emergency stop by Anna")
    assert stopped.stopped_at.sec
    # A reset that was asked for before this stop does not end it.
    assert ask(interfaces.RESET_HAMMER).message.startswith("not done")
    assert states.messages[-1].disarmed_by == HammerState.EMERGENCY_STOP


def test_a_campaign_begins_goes_on_and_takes_a_sample_by_what_was_seen_now_alone(harness):
    client = start_rig(harness)
    states = harness.listen(interfaces.CAMPAIGN_STATE)
    topic = interfaces.CAMPAIGN_STATE

    def fill(request, within=REACTION):
        return fill_act(request, read(topic, states), "Anna", within)

    goal = fill(RunCampaign.Goal(samples=["steel small"], impacts=1), LATE)
    fields = {name: getattr(goal, name) for name in ("samples", "impacts", "deadline", "seen")}
    late = run(harness, client, **fields).result
    assert not late.success
    assert late.message.startswith("not done")
    assert not late.setup.samples  # none has begun

    releases = harness.listen(interfaces.RELEASE)
    handle, _ = begin(harness, client, samples=["steel small"], impacts=1, confirm_samples=True)
    states.wait(lambda got: got[-1].task == Task.MOUNT)
    confirm = ConfirmSample.Request(sample="steel small")
    answer = harness.call(ConfirmSample, interfaces.CONFIRM_SAMPLE, fill(confirm, LATE))
    assert answer.message.startswith("not done")
    harness.call(Act, interfaces.PAUSE_CAMPAIGN)
    states.wait(lambda got: got[-1].task == Task.RESUME)
    answer = harness.call(ConfirmSample, interfaces.CONFIRM_SAMPLE, fill(confirm, LATE))
    assert answer.message.startswith("not done")
    answer = harness.call(Act, interfaces.RESUME_CAMPAIGN, fill(Act.Request(), LATE))
    assert answer.message.startswith("not done")
    assert not releases.messages
    assert harness.call(Act, interfaces.RESUME_CAMPAIGN, fill(Act.Request())).success
    states.wait(lambda got: got[-1].task == Task.MOUNT)
    answer = harness.call(ConfirmSample, interfaces.CONFIRM_SAMPLE, fill(confirm))
    assert answer.success, answer.message
    assert harness.wait(handle.get_result_async()).result.success
