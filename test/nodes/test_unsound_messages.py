"""No message on the rig's topics ends a node: it is dropped, counted and named.

The messages of all topics are made of their definitions, over DDS, against all nodes at once.
"""

import re
from types import SimpleNamespace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from impact_rig_msgs import msg
from impact_rig_msgs.srv import GetResults

from impact_rig.nodes import interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.campaign import CampaignNode
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.intake import Intake
from impact_rig.nodes.interfaces import Topic
from impact_rig.nodes.recorder import RecorderNode
from impact_rig.nodes.visualizer import VisualizerNode

TOPICS = sorted(
    (item for item in vars(interfaces).values() if isinstance(item, Topic)),
    key=lambda topic: topic.name,
)
NUMBERS = {
    "boolean": st.booleans(),
    "octet": st.binary(min_size=1, max_size=1),
    "float": st.floats(width=32),
    "double": st.floats(),
    "string": st.sampled_from(["", "measured", "steel small", "aluminium large", "Prüfkörper"]),
}
LONGEST = 9
"""Of an array [-]."""


def make_integers(kind):
    bits = int(re.sub(r"\D", "", kind))
    low = 0 if kind.startswith("u") else -(2 ** (bits - 1))
    return st.integers(low, low + 2**bits - 1) | st.integers(0, 3)


def make_field(kind):
    """Return a strategy for one field, by the type that its message's class names."""
    if found := re.fullmatch(r"sequence<(.*?)(, \d+)?>", kind):
        return st.lists(make_field(found[1]), max_size=LONGEST)
    if found := re.fullmatch(r"(.*)\[(\d+)\]", kind):
        count = int(found[2])
        return st.lists(make_field(found[1]), min_size=count, max_size=count)
    if "/" in kind:
        package, name = kind.split("/")
        module = __import__(f"{package}.msg", fromlist=[name])
        return make_messages(getattr(module, name))
    return NUMBERS[kind] if kind in NUMBERS else make_integers(kind)


def make_messages(kind):
    fields = kind.get_fields_and_field_types()
    return st.builds(kind, **{name: make_field(type_) for name, type_ in fields.items()})


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
    publishers = [(topic, harness.advertise(topic)) for topic in TOPICS]

    @given(st.data())
    @settings(max_examples=200, deadline=None, suppress_health_check=list(HealthCheck))
    def publish(data):
        topic, publisher = data.draw(st.sampled_from(publishers))
        publisher.publish(data.draw(make_messages(topic.type)))
        harness.settle()

    publish()
    assert all(node.is_active for node in nodes)
    harness.call(GetResults, interfaces.GET_RESULTS)


class Listener:
    """What an intake asks its node for."""

    def __init__(self):
        self.warnings = []

    def get_logger(self):
        return SimpleNamespace(warning=self.warnings.append)

    def count_publishers(self, topic):
        return 1


def test_the_first_unsound_message_of_a_topic_is_named():
    listener = Listener()
    intake = Intake(listener)
    for _ in range(2):
        assert intake.take(interfaces.HAMMER_STATE, msg.HammerState(state=7)) is None
    (warning,) = listener.warnings
    assert warning.startswith(
        "a message of hammer/state is dropped, as all like it: 7 is not a valid HammerPlace"
    )
