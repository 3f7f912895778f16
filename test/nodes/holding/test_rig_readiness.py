"""When the next hit may be released, by what the recorder has said of the one before."""

from typing import Any

import pytest
from impact_rig_msgs.msg import AcquisitionState, RecorderState, RecordStored
from impact_rig_msgs.srv import Release

from impact_rig.nodes import interfaces
from impact_rig.nodes.holding.rig_readiness import RigReadiness
from impact_rig.nodes.rig_node import RigNode

SAMPLE = "steel small"


class ReadyNode(RigNode):
    def __init__(self, **options: Any) -> None:
        super().__init__("ready", **options)
        self.declare("require_recorder", True, "as the hammer's")
        self.rig = RigReadiness(self, self._take_acquisition, lambda: None)

    def _take_acquisition(self, message: AcquisitionState) -> None:
        self.rig.take_acquisition(message)

    def find_obstacle(self, record: int) -> str:
        return self.rig.find_obstacle(Release.Request(record=record, sample=SAMPLE))


@pytest.fixture
def rig(harness):
    """Return the node, and functions that arm for a record and say that one is stored."""
    node = harness.add(ReadyNode)
    recorder = harness.advertise(interfaces.RECORDER_STATE)
    accelerometers = harness.advertise(interfaces.ACQUISITION_STATE)
    stored = harness.advertise(interfaces.RECORD_STORED)
    recorder.publish(RecorderState(recording=True, uri="a.mcap"))
    harness.wait_until(lambda: node.rig.recording == "a.mcap")
    harness.wait_until(lambda: stored.get_subscription_count() == 1)

    def arm(record: int) -> None:
        accelerometers.publish(
            AcquisitionState(state=AcquisitionState.ARMED, record=record, sample=SAMPLE)
        )
        harness.wait_until(lambda: "armed" not in node.find_obstacle(record))

    def store(record: int) -> None:
        stored.publish(RecordStored(record=record, complete=True))
        assert stored.wait_for_all_acked()

    return node, arm, store


def test_the_next_hit_waits_until_the_one_before_is_stored(rig):
    node, arm, store = rig
    arm(1)
    assert not node.find_obstacle(1)
    node.rig.note_release(1)
    arm(2)
    assert "has not said that record 1 is stored" in node.find_obstacle(2)
    store(1)
    assert not node.find_obstacle(2)


def test_a_record_may_be_stored_before_its_release_is_noted(rig):
    node, arm, store = rig
    arm(1)
    assert not node.find_obstacle(1)
    store(1)
    node.rig.note_release(1)
    arm(2)
    assert not node.find_obstacle(2)


def test_the_word_on_an_earlier_record_of_the_same_number_does_not_count(rig):
    node, arm, store = rig
    store(1)
    arm(1)
    assert not node.find_obstacle(1)
    node.rig.note_release(1)
    arm(2)
    assert "record 1 is stored" in node.find_obstacle(2)
