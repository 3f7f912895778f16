"""A test of somebody else's: nodes of the rig, and one of theirs, in one process."""

from impact_rig_msgs.msg import HammerState
from impact_rig_msgs.srv import Act
from rclpy.node import Node

from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.interfaces import ARM_HAMMER


class Mine(Node):
    def __init__(self, **options):
        super().__init__("mine", **options)
        self.heard = []
        self.create_subscription(HammerState, "hammer/state", self.heard.append, 10)


def test_a_node_of_mine_hears_the_hammer(harness):
    mine = harness.run_node(Mine(context=harness.context))
    harness.add(HammerNode, swing_time=0.01)
    assert harness.call(Act, ARM_HAMMER).success
    harness.wait_until(lambda: mine.heard and mine.heard[-1].armed)
