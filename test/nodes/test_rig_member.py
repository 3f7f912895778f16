"""Another node of the rig, as the hammer sees it: alive, silent, or gone."""

from typing import Any

import pytest
from impact_rig_msgs.msg import RecorderState

from impact_rig.nodes import interfaces
from impact_rig.nodes.rig_member import RigMember
from impact_rig.nodes.rig_node import RigNode


class ListeningNode(RigNode):
    def __init__(self, **options: Any) -> None:
        super().__init__("listening", **options)
        self.recorder = RigMember(self, "recorder", interfaces.RECORDER_STATE)


@pytest.fixture
def recorder(harness):
    return harness.add(ListeningNode).recorder


@pytest.fixture
def publisher(harness, recorder):
    """Return a recorder's publisher, which has published."""
    made = harness.advertise(interfaces.RECORDER_STATE)
    made.publish(RecorderState(recording=True, uri="a.mcap"))
    harness.wait_until(lambda: recorder.state is not None)
    return made


def test_a_node_that_was_never_there_is_not_lost(recorder):
    assert not recorder.describe_loss()


def test_a_node_that_was_there_and_has_ended_is_gone(harness, recorder, publisher):
    assert not recorder.is_gone
    harness.peer.destroy_publisher(publisher)
    harness.wait_until(lambda: recorder.is_gone)
    assert recorder.describe_loss() == (
        "the recorder node has gone: start it again, or see to the network between you"
    )


def test_a_replay_of_its_states_does_not_keep_it_alive(harness, recorder, publisher):
    topic = interfaces.RECORDER_STATE
    replay = harness.peer.create_publisher(topic.type, topic.name, topic.qos)
    replay.publish(RecorderState(recording=True, uri="b.mcap"))
    harness.peer.destroy_publisher(publisher)
    harness.wait_until(lambda: recorder.is_gone)
    assert recorder.state.uri == "a.mcap"
