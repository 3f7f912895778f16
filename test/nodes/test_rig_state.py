"""What a node makes of what it hears of the others: who is there, who is ready, and why not."""

from types import SimpleNamespace
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from impact_rig_msgs.msg import AcquisitionState, RecorderState, RecordStored

from impact_rig.nodes import interfaces
from impact_rig.nodes.rig_node import RigNode
from impact_rig.nodes.rig_state import ACCELEROMETER, RECORDER, RigState


class ListeningNode(RigNode):
    def __init__(self, **options: Any) -> None:
        super().__init__("listening", **options)
        self.rig = RigState(self, (ACCELEROMETER, RECORDER))


@pytest.fixture
def node(harness):
    # In a rig's namespace: another rig is none of its business.
    return harness.add(ListeningNode, namespace="rig1")


@pytest.fixture
def tell(harness, node):
    """Return a function that publishes on a topic, and waits until the node has heard it."""
    publishers = {}

    def publish(topic, message):
        if topic.name not in publishers:
            name = topic.name if topic.name.startswith("/") else f"/rig1/{topic.name}"
            made = harness.peer.create_publisher(topic.type, name, topic.leased_qos)
            publishers[topic.name] = made
            harness.wait_until(lambda: made.get_subscription_count() == 1)
        handled = node.messages_handled
        publishers[topic.name].publish(message)
        harness.wait_until(lambda: node.messages_handled > handled)
        harness.run(lambda: None)
        return publishers[topic.name]

    return publish


def record(uri, **fields):
    return RecorderState(recording=True, uri=uri, **fields)


def test_a_node_that_was_never_there_is_not_lost(node):
    assert not node.rig.describe_loss(ACCELEROMETER, RECORDER)
    assert not node.rig.describe_inactivity(ACCELEROMETER, RECORDER)
    assert not node.rig[RECORDER].has_left


def test_a_node_of_this_process_lives_though_it_gives_no_signs_until_it_ends(harness, node, tell):
    publisher = tell(interfaces.RECORDER_STATE, record("a.mcap"))
    recorder = node.rig[RECORDER]
    for alive, silent in ((1, 0), (0, 1)):
        recorder._take_liveliness(SimpleNamespace(alive_count=alive, not_alive_count=silent))
        assert not recorder.is_gone
    harness.peer.destroy_publisher(publisher)
    harness.wait_until(lambda: recorder.has_left)
    assert node.rig.describe_loss(RECORDER) == (
        "the recorder node has gone: start it again, or see to the network between you"
    )


def test_what_is_published_again_of_a_recorder_keeps_nobody_from_missing_it(harness, node, tell):
    recorder = node.rig[RECORDER]
    again = harness.peer.create_publisher(
        RecorderState, "/rig1/recorder/state", interfaces.RECORDER_STATE.qos
    )
    own = tell(interfaces.RECORDER_STATE, record("a.mcap"))
    again.publish(record("b.mcap"))
    harness.peer.destroy_publisher(own)
    harness.wait_until(lambda: recorder.is_gone)
    assert recorder.state.uri == "a.mcap"


def test_a_device_that_is_lost_is_told_until_it_is_back_and_counted_once(node, tell):
    fault = AcquisitionState(state=AcquisitionState.FAULT, message="the cable is out")
    for _ in range(2):
        tell(interfaces.ACQUISITION_STATE, fault)
        loss = node.rig.describe_loss(ACCELEROMETER)
        assert loss == "the accelerometer's device is lost: the cable is out"
    tell(interfaces.ACQUISITION_STATE, AcquisitionState(state=AcquisitionState.IDLE))
    assert not node.rig.describe_loss(ACCELEROMETER)
    assert node.rig.losses == 1


def test_a_node_that_is_not_active_is_told_until_it_is(node, tell):
    def say(name, lifecycle):
        values = [KeyValue(key="lifecycle", value=lifecycle)]
        status = DiagnosticStatus(name=name, level=b"\0", values=values)
        tell(interfaces.DIAGNOSTICS, DiagnosticArray(status=[status]))
        return node.rig.describe_inactivity(ACCELEROMETER, RECORDER)

    assert not say("/rig1/accelerometer", "active")
    assert not say("/rig2/accelerometer", "inactive")
    for state in ("inactive", "unconfigured"):
        told = say("/rig1/accelerometer", state)
        assert told == "the accelerometer node is not active: activate it to go on"
    assert not say("/rig1/accelerometer", "active")
    assert node.rig.losses == 1


def test_what_was_said_of_an_earlier_record_of_the_same_number_does_not_count(node, tell):
    tell(interfaces.RECORD_STORED, RecordStored(record=1))
    assert node.rig.is_stored(1)
    node.rig.forget_stored(1)
    assert not node.rig.is_stored(1)
