"""A campaign of the virtual rig, held against what really happened; the fixture is the rig's."""

from impact_rig_msgs.msg import Impact
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from impact_rig.testing.harness import wait_until

SAMPLES = ["steel small", "aluminium large"]


def test_the_results_are_what_happened(virtual_rig):
    results = virtual_rig.campaign(SAMPLES, impacts=2)
    assert [results[name].impacts_accepted for name in SAMPLES] == [2, 2]
    for hit in results.record.hits:
        truth = virtual_rig.find_truth(hit)
        assert abs(hit.contact_time / truth.contact_time - 1) < 0.01


def test_a_node_of_mine_hears_every_verdict(virtual_rig):
    context = Context()
    context.init(domain_id=virtual_rig.domain)
    node, heard = Node("listener", context=context), []
    node.create_subscription(Impact, "impact", heard.append, 10)
    # The rig does not wait for a node that has not found it yet.
    wait_until(lambda: node.count_publishers("impact") > 0)
    virtual_rig.campaign(["steel small"], impacts=2)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    wait_until(lambda: executor.spin_once(timeout_sec=0.1) or len(heard) == 2)
    node.destroy_node()
    context.shutdown()
    assert all(message.accepted for message in heard)
