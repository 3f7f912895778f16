"""No message on the rig's topics ends a node: it is dropped, counted and named.

The messages of all topics are made of their definitions, over DDS, against all nodes at once.
"""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from impact_rig_msgs import msg
from impact_rig_msgs.srv import GetResults

from impact_rig.nodes import interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.campaign import CampaignNode
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.intake import Intake
from impact_rig.nodes.recorder import RecorderNode
from impact_rig.nodes.visualizer import VisualizerNode

from .stranger import TOPICS, RandomMessages


@pytest.fixture
def nodes(harness, tmp_path, monkeypatch):
    """All nodes of a rig, active; what a test publishes counts as said by a topic's owner."""
    monkeypatch.setattr(Intake, "find_stranger", lambda *_: None)
    kinds = {
        AccelerometerNode: {}, HammerNode: {}, EstimatorNode: {}, CampaignNode: {},
        RecorderNode: {"output": str(tmp_path / "session.mcap")},
        VisualizerNode: {"output": str(tmp_path / "session.rrd")},
    }  # fmt: skip
    return [harness.add(kind, **parameters) for kind, parameters in kinds.items()]


def test_no_message_of_any_topic_ends_a_node(harness, nodes):
    publishers, random = [(topic, harness.advertise(topic)) for topic in TOPICS], RandomMessages(7)
    for _ in range(200):
        topic, publisher = random.choose(publishers)
        publisher.publish(random.make(topic.type))
        harness.settle()
    assert all(node.is_active for node in nodes)
    harness.call(GetResults, interfaces.GET_RESULTS)


class Listener:
    """What an intake asks its node for."""

    def __init__(self):
        self.warnings = []

    def get_logger(self):
        return SimpleNamespace(warning=self.warnings.append)


def test_the_first_unsound_message_of_a_topic_is_named():
    listener = Listener()
    intake, topic = Intake(listener), replace(interfaces.HAMMER_STATE, owners=())
    for _ in range(2):
        assert intake.take(topic, msg.HammerState(state=7)) is None
    (warning,) = listener.warnings
    assert warning.startswith(
        "a message of hammer/state is dropped, and so is each like it: 7 is not a valid"
    )
