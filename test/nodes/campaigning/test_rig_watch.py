"""What a campaign makes of what it hears of the recorder."""

from typing import Any

from impact_rig_msgs.msg import RecorderState

from impact_rig.nodes import interfaces
from impact_rig.nodes.campaigning.rig_watch import RigWatch
from impact_rig.nodes.rig_node import RigNode


class WatchingNode(RigNode):
    def __init__(self, **options: Any) -> None:
        super().__init__("watching", **options)
        self.watch = RigWatch(self)


def test_a_recording_ends_with_the_next_one_but_not_with_the_word_of_the_one_before(harness):
    node = harness.add(WatchingNode)
    recorder = harness.advertise(interfaces.RECORDER_STATE)

    def tell(uri: str) -> None:
        handled = node.messages_handled
        recorder.publish(RecorderState(recording=True, uri=uri))
        harness.wait_until(lambda: node.messages_handled > handled)
        harness.run(lambda: None)

    tell("first.mcap")
    assert not node.watch.find_end_of_recording("second.mcap")
    tell("second.mcap")
    assert not node.watch.find_end_of_recording("second.mcap")
    tell("third.mcap")
    end = node.watch.find_end_of_recording("second.mcap")
    assert end == "the recorder has begun another recording, third.mcap"


def test_a_recorder_that_stops_ends_its_recording(harness):
    node = harness.add(WatchingNode)
    recorder = harness.advertise(interfaces.RECORDER_STATE)
    recorder.publish(RecorderState(recording=False, uri="first.mcap", message="disk full"))
    harness.wait_until(lambda: node.messages_handled > 0)
    harness.run(lambda: None)
    end = node.watch.find_end_of_recording("first.mcap")
    assert end == "the recorder has stopped: disk full"
    assert not node.watch.find_end_of_recording("")
