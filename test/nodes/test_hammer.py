"""The hammer goes only when the hit can be recorded, and says why otherwise."""

import pytest
from impact_rig_msgs.msg import AcquisitionState, HammerState, RecorderState, RecordStored
from impact_rig_msgs.srv import Release
from std_srvs.srv import Trigger

from impact_rig.nodes import interfaces
from impact_rig.nodes.hammer import HammerNode

HIT = {"record": 4, "sample": "steel small", "impact": 2, "attempt": 1}


@pytest.fixture
def states(harness):
    """Return publishers of what the hammer must hear from accelerometers and recorder."""
    return harness.advertise(interfaces.ACQUISITION_STATE), harness.advertise(
        interfaces.RECORDER_STATE
    )


def make_ready(harness, states, *, record=4, recording=True, arm=True):
    acquisition, recorder = states
    acquisition.publish(
        AcquisitionState(state=AcquisitionState.ARMED, record=record, sample="steel small")
    )
    recorder.publish(RecorderState(recording=recording, uri="a.mcap", message="disk full"))
    if arm:
        assert harness.call(Trigger, interfaces.ARM_HAMMER).success


def ask(harness, **changes):
    return harness.call(Release, interfaces.RELEASE_HAMMER, Release.Request(**{**HIT, **changes}))


def release(harness, **changes):
    """Ask again while the hammer has not heard of the rest of the rig."""
    return harness.ask(Release, interfaces.RELEASE_HAMMER, Release.Request(**{**HIT, **changes}))


def test_goes_when_armed_held_recorded_and_the_accelerometers_are_armed_for_this_hit(
    harness, states
):
    harness.add(HammerNode, swing_time=0.01)
    releases = harness.listen(interfaces.RELEASE)
    hammer_states = harness.listen(interfaces.HAMMER_STATE)
    make_ready(harness, states)

    answer = release(harness)

    assert answer.success, answer.message
    assert answer.recording == "a.mcap"
    (command,) = releases.wait_for_count(1)
    assert (command.record, command.sample, command.impact, command.swing_time) == (
        4, "steel small", 2, 0.01,
    )  # fmt: skip
    seen = hammer_states.wait(lambda messages: messages[-1].message == "back in the holder")
    assert [item.state for item in seen][-2:] == [HammerState.SWINGING, HammerState.HELD]


@pytest.mark.parametrize(
    ("ready", "word"),
    [
        ({"arm": False}, "not armed: call hammer/arm"),
        ({"record": 3}, "armed for record 3"),
        ({"recording": False}, "disk full"),
    ],
)
def test_refuses_with_the_reason(harness, states, ready, word):
    harness.add(HammerNode, swing_time=0.01)
    releases = harness.listen(interfaces.RELEASE)
    make_ready(harness, states, **ready)

    answers = harness.ask_until(word, lambda: ask(harness))
    assert not any(answer.success for answer in answers)
    assert not releases.messages


def test_says_not_yet_while_the_accelerometers_are_silent(harness):
    harness.add(HammerNode)
    assert harness.call(Trigger, interfaces.ARM_HAMMER).success
    answer = ask(harness)
    assert not answer.success
    assert answer.message.startswith(interfaces.NOT_YET)
    assert "accelerometers are not armed" in answer.message


def test_says_not_yet_while_a_recorder_looks_for_its_topics(harness, states):
    harness.add(HammerNode, swing_time=0.01)
    acquisition, recorder = states
    acquisition.publish(
        AcquisitionState(state=AcquisitionState.ARMED, record=4, sample="steel small")
    )
    recorder.publish(RecorderState(waiting=True, uri="a.mcap", message="waiting for topics"))
    assert harness.call(Trigger, interfaces.ARM_HAMMER).success
    answers = harness.ask_until("waiting for topics", lambda: ask(harness))
    assert all(answer.message.startswith(interfaces.NOT_YET) for answer in answers)
    recorder.publish(RecorderState(recording=True, uri="a.mcap"))
    assert release(harness).success


@pytest.fixture
def struck(harness, states):
    """Return a hammer that has struck record 4 and is back, and a recorder's word on records."""
    harness.add(HammerNode, swing_time=0.01)
    hammer_states = harness.listen(interfaces.HAMMER_STATE)
    stored = harness.advertise(interfaces.RECORD_STORED)
    make_ready(harness, states)
    assert release(harness).success
    hammer_states.wait(lambda messages: messages[-1].message == "back in the holder")
    make_ready(harness, states, record=5, arm=False)
    return stored


def test_does_not_go_again_before_the_record_is_stored(harness, states, struck):
    struck.publish(RecordStored(record=3, complete=True))
    struck.publish(RecordStored(record=4, complete=False))
    word = "has not said that record 4 is stored"
    answers = harness.ask_until(word, lambda: ask(harness, record=5))
    assert all(answer.message.startswith(interfaces.NOT_YET) for answer in answers)
    struck.publish(RecordStored(record=4, complete=True))
    assert release(harness, record=5).success


def test_a_record_that_a_new_recording_cannot_store_any_more_is_not_waited_for(
    harness, states, struck
):
    _, recorder = states
    recorder.publish(RecorderState(recording=True, uri="b.mcap"))
    answer = release(harness, record=5)
    assert answer.success, answer.message
    assert answer.recording == "b.mcap"
