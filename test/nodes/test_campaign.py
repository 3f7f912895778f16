"""A campaign strikes until every sample has its hits, and stops with a reason when it cannot."""

import copy
import functools
import math

import pytest
from action_msgs.msg import GoalStatus
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import CampaignState
from impact_rig_msgs.srv import ConfirmSample, JoinCampaign

from impact_rig.configuration.rig_file import read_template
from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.setup import CONTROL_SAMPLE, PAPER_SETUP
from impact_rig.nodes import interfaces
from impact_rig.nodes.campaign import CampaignNode
from impact_rig.nodes.campaign_plan import plan_campaign
from impact_rig.nodes.identity import id_to_msg, make_id
from impact_rig.nodes.messages import setup_to_msg, stamp_to_msg

from .campaigns import begin, cancel, run, start_rig, wait_for_impact


@pytest.fixture
def start(harness):
    """Return a function that starts the rig's nodes and returns a client of the campaign."""
    return functools.partial(start_rig, harness)


def test_every_sample_gets_its_hits_and_its_numbers_and_rejected_ones_are_repeated(harness, start):
    names = ["steel small", CONTROL_SAMPLE]
    client = start(source='scheduled_faults = "2:overload, 3:missed_trigger"')
    handle, feedback = begin(harness, client, samples=names, impacts=3)
    answer = harness.wait(handle.get_result_async())
    assert answer.status == GoalStatus.STATUS_SUCCEEDED
    assert answer.result.success
    by_name = {item.name: item for item in answer.result.samples}
    assert {name: by_name[name].impacts_accepted for name in by_name} == dict.fromkeys(names, 3)
    rejected = [(hit.sample, hit.impact, hit.attempt) for hit in answer.result.rejected]
    assert rejected == [(name, impact, 1) for name in names for impact in (2, 3)]
    assert answer.result.rejected[0].reasons[0].reason == "overload"
    # Table 3, with three hits of 0.3 % scatter.
    assert by_name["steel small"].stiffness.value == pytest.approx(29.18e6, rel=0.05)
    assert answer.result.hammer.stiffness.value == pytest.approx(22.54e6, rel=0.02)
    steps = dict.fromkeys((item.sample, item.impact) for item in feedback.messages if item.impact)
    # Once for each strike, with the verdict on the one before.
    strikes = [item for item in feedback.messages if item.state == CampaignState.STRIKING]
    assert [item.last.record for item in strikes] == list(range(10))
    assert CampaignState.COUNTING not in {item.state for item in feedback.messages}
    # Of the hit that completes a sample the next sample's first feedback speaks.
    assert list(steps) == [
        (names[0], 1),
        (names[0], 2),
        (names[1], 1),
        (names[1], 2),
        (names[1], 3),
    ]


def test_gives_up_after_the_limit_and_keeps_what_there_is(harness, start):
    answer = run(
        harness,
        start(source='fault_probability = 1.0\nfaults = "weak_hit"'),
        samples=["steel small"],
        impacts=2,
        attempts_per_impact=3,
    )
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert "3 hits in a row were rejected" in answer.result.message
    assert "weak" in answer.result.message
    assert len(answer.result.rejected) == 3


@pytest.mark.parametrize("fault", ["dead_channel", "missed_trigger"])
def test_gives_up_soon_where_nothing_is_seen(harness, start, fault):
    answer = run(
        harness,
        start(source=f'fault_probability = 1.0\nfaults = "{fault}"'),
        samples=["steel small"],
        impacts=2,
        attempts_per_impact=50,
    )
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert "5 hits in a row showed nothing" in answer.result.message
    assert "see to sample, hammer, sensors and cables" in answer.result.message
    assert len(answer.result.rejected) == 5


IMPOSSIBLE = {
    "unknown sample 'tin'": {"samples": ["tin"], "impacts": 1},
    "impacts is 0": {"samples": ["steel small"], "impacts": 0},
    "asked for twice": {"samples": ["steel small", "steel small"], "impacts": 1},
    "release angle is -5.72958°: it must be": {
        "samples": [], "impacts": 1, "release_angles": [0.1, -0.1],
    },
}  # fmt: skip


@pytest.mark.parametrize("word", IMPOSSIBLE)
def test_an_impossible_goal_has_no_plan(word):
    with pytest.raises(ParameterError) as caught:
        plan_campaign(RunCampaign.Goal(**IMPOSSIBLE[word]), PAPER_SETUP, (), stamp_to_msg(0))
    assert word in str(caught.value)


def test_the_plan_has_what_the_goal_asks_for():
    goal = RunCampaign.Goal(samples=[CONTROL_SAMPLE], impacts=6)
    angles = [math.radians(5.0), math.radians(10.0)]
    setup = plan_campaign(goal, PAPER_SETUP, angles, stamp_to_msg(0))
    assert list(setup.plan.samples) == [f"{CONTROL_SAMPLE} 5°", f"{CONTROL_SAMPLE} 10°"]
    assert setup.plan.impacts == 6
    resumed = plan_campaign(RunCampaign.Goal(resumed=setup), PAPER_SETUP, (), stamp_to_msg(1))
    assert (resumed.campaign_id, resumed.plan) == (setup.campaign_id, setup.plan)


def test_every_angle_of_a_manual_holder_is_asked_for(harness, start, tmp_path):
    rig_file = tmp_path / "rig.toml"
    rig_file.write_text(read_template() + '[holder]\ndriver = "manual"\n', "utf-8")
    client = start(hammer={"rig_file": str(rig_file)}, source='plant = "contact"')
    goal = {
        "samples": [CONTROL_SAMPLE],
        "impacts": 1,
        "release_angles": [math.radians(5.0), math.radians(10.0)],
    }
    refused = run(harness, client, **goal)
    assert "the holder (operator) cannot set a release angle" in refused.result.message

    handle, feedback = begin(harness, client, **goal, confirm_samples=True)
    for angle in ("5°", "10°"):
        sample = f"{CONTROL_SAMPLE} {angle}"
        asked = (sample, CampaignState.WAITING_FOR_SAMPLE)
        newest = feedback.wait(
            lambda got, asked=asked: (
                got[-1:] and (got[-1].sample, got[-1].state) == asked and got[-1].message
            )
        )[-1]
        assert newest.message == f"set the release angle of the hammer to {angle}"
        wrong = harness.call(
            ConfirmSample, interfaces.CONFIRM_SAMPLE, ConfirmSample.Request(sample="brass large")
        )
        assert f"waiting for '{sample}'" in wrong.message
        request = ConfirmSample.Request(sample=sample)
        assert harness.call(ConfirmSample, interfaces.CONFIRM_SAMPLE, request).success
    answer = harness.wait(handle.get_result_async())
    assert answer.result.success, answer.result.message
    assert [item.name for item in answer.result.samples] == [
        f"{CONTROL_SAMPLE} 5°",
        f"{CONTROL_SAMPLE} 10°",
    ]


def test_no_node_of_a_running_campaign_joins_another(harness):
    client = start_rig(harness)
    handle, feedback = begin(harness, client, samples=["steel small"], impacts=100_000)
    feedback.wait(lambda got: got[-1].impact >= 1)
    foreign = JoinCampaign.Request(setup=setup_to_msg(PAPER_SETUP, stamp_to_msg(1)))
    foreign.setup.campaign_id = id_to_msg(make_id())
    for _ in range(3):
        for name in ("recorder", "accelerometer", "estimator", "hammer"):
            for announced in (False, True):
                foreign.announced = announced
                answer = harness.call(JoinCampaign, interfaces.make_join_name(name), foreign)
                assert answer.message == f"the {name} node takes part in a campaign that goes on"
    before = feedback.messages[-1].impact
    feedback.wait(lambda got: got[-1].impact > before)
    assert not any(item.message for item in feedback.messages if item.impact)
    assert cancel(harness, handle).result.accepted
    # It is over: another may begin.
    assert harness.call(JoinCampaign, interfaces.make_join_name("recorder"), foreign).success


def test_who_comes_late_knows_all_of_a_campaign(harness):
    client = start_rig(harness)
    states = harness.listen(interfaces.CAMPAIGN_STATE)
    assert states.wait_for_count(1)[0].state == CampaignState.ENDED  # none has begun
    result = run(harness, client, samples=["brass small", "steel small"], impacts=2)
    assert result.result.success
    late = harness.listen(interfaces.CAMPAIGN_STATE).wait(lambda got: got[-1].last.record == 4)
    state = late[-1]
    assert state.campaign_id == result.result.setup.campaign_id
    assert state.state == CampaignState.COMPLETE
    assert [(item.sample, item.accepted, item.rejected) for item in state.counts] == [
        ("brass small", 2, 0), ("steel small", 2, 0),
    ]  # fmt: skip
    assert (state.impacts, state.mounted, state.last.accepted) == (2, "steel small", True)
    # Struck in the order that was asked for, returned in the order of the set.
    assert [item.name for item in result.result.samples] == ["steel small", "brass small"]


def test_who_resumes_a_campaign_that_runs_takes_it_over(harness):
    """The client of a node that stood still has gone, and the node runs it still."""
    client = start_rig(harness)
    first, feedback = begin(harness, client, samples=["steel small"], impacts=40)
    wait_for_impact(harness, feedback, 1)
    setup = harness.run(lambda: copy.deepcopy(find_campaign(harness).setup))
    other = run(harness, client, samples=["steel small"], impacts=3).result
    assert other.message.startswith("another campaign is running")
    setup.plan.impacts = 45
    resumed = run(harness, client, resumed=setup).result
    assert harness.wait(first.get_result_async()).result.message == (
        "another client goes on with it"
    )
    assert resumed.success
    assert [hit.impact for hit in resumed.accepted] == list(range(1, 46))


def find_campaign(harness):
    node = harness.find(CampaignNode)
    return node._campaign
