"""A test of somebody else's: nodes of the rig, and one of theirs, in one process."""

import pytest
from impact_rig_msgs.msg import HammerState
from impact_rig_msgs.srv import Act
from rclpy.node import Node

from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.interfaces import ARM_HAMMER, HAMMER_STATE


class Mine(Node):
    def __init__(self, **options):
        super().__init__("mine", **options)
        self.heard = []
        self.create_subscription(HammerState, "hammer/state", self.heard.append, 10)


def test_what_my_node_raises_is_raised_where_the_test_waits(harness):
    harness.add(HammerNode, swing_time=0.01)
    mine = harness.run_node(Mine(context=harness.context))
    mine.create_subscription(HammerState, "hammer/state", lambda message: message.nonsense, 10)
    with pytest.raises(AttributeError, match="nonsense"):
        harness.wait_until(lambda: False)
    with pytest.raises(AttributeError, match="nonsense"):
        harness.listen(HAMMER_STATE).wait(lambda _: False)


def test_a_node_of_mine_hears_the_hammer(harness):
    mine = harness.run_node(Mine(context=harness.context))
    harness.add(HammerNode, swing_time=0.01)
    assert harness.call(Act, ARM_HAMMER).success
    harness.wait_until(lambda: mine.heard and mine.heard[-1].armed)
