"""Another node of the rig, as the hammer sees it: alive, silent, or gone."""

from typing import Any

from impact_rig_msgs.msg import RecorderState

from impact_rig.nodes import interfaces
from impact_rig.nodes.rig_member import RigMember
from impact_rig.nodes.rig_node import RigNode


class ListeningNode(RigNode):
    def __init__(self, **options: Any) -> None:
        super().__init__("listening", **options)
        self.recorder = RigMember(self, "recorder", interfaces.RECORDER_STATE)


def test_a_replay_of_its_states_does_not_keep_it_alive(harness):
    recorder, topic = harness.add(ListeningNode).recorder, interfaces.RECORDER_STATE
    assert not recorder.describe_loss()
    publisher = harness.advertise(topic)
    publisher.publish(RecorderState(recording=True, uri="a.mcap"))
    harness.wait_until(lambda: recorder.state is not None)
    assert not recorder.is_gone
    replay = harness.peer.create_publisher(topic.type, topic.name, topic.qos)
    replay.publish(RecorderState(recording=True, uri="b.mcap"))
    harness.peer.destroy_publisher(publisher)
    harness.wait_until(lambda: recorder.is_gone)
    assert recorder.state.uri == "a.mcap"
