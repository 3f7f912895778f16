"""A campaign strikes until every sample has its hits, and stops with a reason when it cannot."""

import functools
import math

import pytest
from action_msgs.msg import GoalStatus
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import RecorderState
from impact_rig_msgs.srv import ConfirmSample

from impact_rig.configuration.rig_file import read_template
from impact_rig.core.setup.paper import CONTROL_SAMPLE
from impact_rig.nodes import interfaces

from .campaigns import begin, run, start_rig


@pytest.fixture
def start(harness):
    """Return a function that starts the rig's nodes and returns a client of the campaign."""
    return functools.partial(start_rig, harness)


def test_every_sample_gets_its_hits_and_its_numbers(harness, start):
    names = ["steel small", CONTROL_SAMPLE]
    handle, feedback = begin(harness, start(), samples=names, impacts=3)
    answer = harness.wait(handle.get_result_async())
    assert answer.status == GoalStatus.STATUS_SUCCEEDED
    assert answer.result.success
    by_name = {item.name: item for item in answer.result.samples}
    assert {name: by_name[name].impacts_accepted for name in by_name} == dict.fromkeys(names, 3)
    # Table 3, with three hits of 0.3 % scatter.
    assert by_name["steel small"].stiffness.value == pytest.approx(29.18e6, rel=0.05)
    assert answer.result.hammer.stiffness.value == pytest.approx(22.54e6, rel=0.02)
    steps = [(item.sample, item.impact) for item in feedback.messages if item.impact]
    assert steps == [(name, i) for name in names for i in (1, 2, 3)]


def test_works_in_a_namespace(harness, start):
    answer = run(harness, start(namespace="/rig7"), samples=[CONTROL_SAMPLE], impacts=1)
    assert answer.result.success, answer.result.message


def test_a_rejected_hit_is_repeated_and_reported(harness, start):
    answer = run(
        harness,
        start(source='scheduled_faults = "2:overload, 3:missed_trigger"'),
        samples=["brass large"],
        impacts=3,
    )
    assert answer.result.success
    assert answer.result.samples[0].impacts_accepted == 3
    assert [(hit.impact, hit.attempt) for hit in answer.result.rejected] == [(2, 1), (3, 1)]
    assert answer.result.rejected[0].reasons[0].startswith("overload")


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


def test_the_most_consistent_of_more_hits_are_kept(harness, start):
    setups = harness.listen(interfaces.SETUP)
    answer = run(harness, start(), samples=[CONTROL_SAMPLE], impacts=6, keep_hits=4)
    assert answer.result.success
    (estimate,) = answer.result.samples
    assert (estimate.impacts_accepted, estimate.impacts_rejected) == (4, 2)
    reasons = [reason for hit in answer.result.rejected for reason in hit.reasons]
    assert reasons == ["surplus: not among the 4 most consistent of 6"] * 2
    # Recorded with the set-up, so that the analysis of the recording keeps the same ones.
    assert setups.messages[-1].analysis.keep_hits == 4


IMPOSSIBLE = {
    "unknown sample 'tin'": {"samples": ["tin"], "impacts": 1},
    "impacts is 0": {"samples": ["steel small"], "impacts": 0},
    "asked for twice": {"samples": ["steel small", "steel small"], "impacts": 1},
    "release angle is -5.72958°: it must be": {"release_angles": [0.1, -0.1], "impacts": 1},
    "keep_hits is 4 of 3 impacts": {"samples": [], "impacts": 3, "keep_hits": 4},
}


def test_an_impossible_goal_is_refused_by_name(harness, start):
    client = start()
    for word, goal in IMPOSSIBLE.items():
        answer = run(harness, client, **goal)
        assert answer.status == GoalStatus.STATUS_ABORTED
        assert word in answer.result.message


def test_every_angle_of_a_manual_holder_is_asked_for(harness, start, tmp_path):
    rig_file = tmp_path / "rig.toml"
    rig_file.write_text(read_template() + '[holder]\ndriver = "manual"\n', "utf-8")
    client = start(hammer={"rig_file": str(rig_file)})
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
        asked = (sample, RunCampaign.Feedback.WAITING_FOR_SAMPLE)
        newest = feedback.wait(
            lambda got, asked=asked: got[-1:] and (got[-1].sample, got[-1].phase) == asked
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
    # The paper's contact is a spring: its time is the same from any angle.
    (found,) = answer.result.speed_exponents
    assert (found.sample, found.series) == (CONTROL_SAMPLE, 2)
    assert found.contact_time.value == pytest.approx(0.0, abs=0.02)
    assert found.peak_force.value == pytest.approx(1.0, abs=0.02)


def test_an_estimator_that_begins_anew_does_not_pass_for_one_that_knows_all_hits(harness, start):
    client = start()
    handle, feedback = begin(harness, client, samples=["steel small"], impacts=20)
    feedback.wait(lambda got: got[-1:] and got[-1].impact >= 2)
    # As one does that was killed and started again.
    campaign = next(node for node in harness.nodes if node.get_name() == "campaign")
    (setup,) = harness.listen(interfaces.SETUP).wait_for_count(1)
    campaign._setup.publish(setup)
    answer = harness.wait(handle.get_result_async())
    known = len(answer.result.accepted) + len(answer.result.rejected)
    assert not answer.result.success
    assert f"the estimator began anew and knows {known} hits of 20" in answer.result.message


def test_cancelling_ends_it_with_the_hammer_disarmed(harness, start):
    states = harness.listen(interfaces.HAMMER_STATE)
    handle, feedback = begin(harness, start(), impacts=1000)
    feedback.wait(lambda got: got[-1:] and got[-1].impact >= 2)

    harness.wait(handle.cancel_goal_async())
    answer = harness.wait(handle.get_result_async())

    assert answer.status == GoalStatus.STATUS_CANCELED
    assert "cancelled" in answer.result.message
    assert answer.result.samples[0].impacts_accepted >= 2
    states.wait(lambda got: not got[-1].armed)


@pytest.fixture
def recorder(harness):
    """Return a publisher of the states of a recorder that never stores anything."""
    return harness.advertise(interfaces.RECORDER_STATE)


def begin_recording(harness, states):
    """Say that everything is being recorded, as a recorder does, once everybody hears it."""
    listeners = {"hammer", "estimator", "campaign"}
    harness.wait_until(lambda: states.get_subscription_count() >= len(listeners))
    states.publish(RecorderState(recording=True, uri="a.mcap"))
    assert states.wait_for_all_acked()


def test_a_record_that_the_recorder_does_not_store_is_waited_for_as_long_as_a_pause_may_take(
    harness, start, recorder
):
    client = start(campaign={"verdict_timeout": 0.5, "pause_timeout": 0.5})
    begin_recording(harness, recorder)
    handle, feedback = begin(harness, client, samples=["steel small"], impacts=1)
    feedback.wait(lambda got: "has not stored record 1 yet: see to its disk" in got[-1].message)
    assert feedback.messages[-1].phase == RunCampaign.Feedback.PAUSED
    answer = harness.wait(handle.get_result_async())
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert "the recorder has not said that record 1 is stored" in answer.result.message
    assert not answer.result.samples


def test_a_recorder_that_stops_ends_the_campaign_at_once_with_its_reason(harness, start, recorder):
    releases = harness.listen(interfaces.RELEASE)
    client = start(campaign={"verdict_timeout": 3600.0})
    begin_recording(harness, recorder)
    handle, _ = begin(harness, client, samples=["steel small"], impacts=1)
    releases.wait_for_count(1)
    recorder.publish(RecorderState(uri="a.mcap", message="the disk is full"))
    answer = harness.wait(handle.get_result_async())
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert answer.result.message == "the recorder has stopped: the disk is full"
