"""The page of the interface, msg_config/README.md, against the nodes as they are."""

import re
from pathlib import Path

import pytest
from impact_rig_msgs.msg import CampaignState, HammerState
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from impact_rig.configuration.parameters import PARAMETERS, check_parameters
from impact_rig.core.given.errors import ParameterError
from impact_rig.nodes import guarded_hammer, interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.campaign import CampaignNode
from impact_rig.nodes.campaign_state import TRANSITIONS
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.recorder import RecorderNode
from impact_rig.nodes.replayer import ReplayerNode
from impact_rig.nodes.visualizer import VisualizerNode
from impact_rig.status.states import HammerPlace, Step

PAGE = (Path(__file__).parents[2] / "msg_config" / "README.md").read_text("utf-8")
ROWS = [line.strip("| ").split(" | ") for line in PAGE.splitlines() if line.startswith("| `")]
OF_EVERY_NODE = {"autostart", "use_sim_time", "start_type_description_service"}
NODES = {
    "accelerometer": AccelerometerNode,
    "campaign": CampaignNode,
    "estimator": EstimatorNode,
    "hammer": HammerNode,
    "recorder": RecorderNode,
    "replayer": ReplayerNode,
    "visualizer": VisualizerNode,
}


def list_names(cell):
    return re.findall(r"`([\w/]+)`", cell)


def test_every_parameter_of_a_node_is_on_the_page_and_no_other(harness):
    for name, kind in NODES.items():
        (row,) = [row for row in ROWS if row[0] == f"`{name}`"]
        node = harness.add(kind, autostart=False)
        own = set(node.get_parameters_by_prefix("")) - OF_EVERY_NODE
        assert set(list_names(row[2])) == own
        # What is refused elsewhere.
        assert set(PARAMETERS[name]) == own
        with pytest.raises(ParameterError):
            check_parameters({"swing_tme": 1.0}, name)


def test_every_topic_service_and_action_is_on_the_page():
    named = {name for row in ROWS for name in list_names(row[0])}
    for item in vars(interfaces).values():
        if isinstance(item, interfaces.Topic) and not item.name.startswith("/"):
            assert item.name in named
        elif isinstance(item, str) and re.fullmatch(r"\w+/\w+", item):
            assert item in named


def test_the_quality_of_service_of_every_topic_is_on_the_page():
    told = {
        name: (int(row[1]), row[2] == "yes", float(row[3].removesuffix(" s")))
        for row in ROWS
        if len(row) > 2 and row[1].isdigit()
        for name in list_names(row[0])
    }
    topics = [item for item in vars(interfaces).values() if isinstance(item, interfaces.Topic)]
    assert told == {
        topic.name: (
            topic.qos.depth,
            topic.qos.durability is DurabilityPolicy.TRANSIENT_LOCAL,
            interfaces.LEASE if topic.owners else 0.0,
        )
        for topic in topics
        if topic is not interfaces.DIAGNOSTICS
    }
    assert {topic.qos.reliability for topic in topics} == {ReliabilityPolicy.RELIABLE}


@pytest.mark.parametrize(
    ("states", "transitions", "message"),
    [
        (Step, TRANSITIONS, CampaignState),
        (HammerPlace, guarded_hammer.TRANSITIONS, HammerState),
    ],
)
def test_the_states_are_those_of_the_code_and_of_the_message(states, transitions, message):
    table = {
        row[0].strip("`"): list_names(row[-1]) if len(row) > 2 else []
        for row in ROWS
        if row[0].strip("`") in states.__members__
    }
    assert table == {
        state.name: [following.name for following in found] for state, found in transitions.items()
    }
    constants = {name: getattr(message, name) for name in states.__members__}
    assert constants == {state.name: state.value for state in states}
