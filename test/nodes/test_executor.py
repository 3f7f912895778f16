"""rclpy's events executor as the nodes use it."""

import threading
import time
from collections.abc import Iterator

import pytest
import rclpy
from rclpy.task import Future

from impact_rig.core.given.errors import DeviceError
from impact_rig.nodes import interfaces
from impact_rig.nodes.executor import make_executor, spin_until
from impact_rig.nodes.process import DRAIN_QUIET, drain
from impact_rig.nodes.rig_node import RigNode
from impact_rig.testing.harness import PATIENCE, wait_until


@pytest.fixture
def node(ros_domain: int) -> Iterator[RigNode]:
    """Return a node of an executor that does not spin."""
    context = rclpy.Context()
    rclpy.init(context=context, args=[])
    made, executor = RigNode("node", context=context), make_executor(context)
    executor.add_node(made)
    yield made
    executor.shutdown()
    made.destroy_node()
    context.try_shutdown()


def test_another_thread_ends_the_spinning_which_costs_nothing_until_then(node):
    stop: Future = Future()
    threading.Timer(0.5, lambda: stop.set_result(None)).start()
    began = time.thread_time()
    spin_until(node.executor, stop)
    assert stop.done()
    assert time.thread_time() - began < 0.25
    # And what has been stopped before it begins ends at once.
    spin_until(node.executor, stop)


def test_an_error_in_such_work_is_a_fault_and_an_unexpected_one_ends_the_process(node):
    def fail(error: Exception) -> None:
        raise error

    node.run_soon(lambda: fail(DeviceError("the device is lost")))
    node.run_soon(lambda: fail(ValueError("not foreseen")))
    spin_until(node.executor, node.stop_requested)
    assert node.fault == "the device is lost"
    with pytest.raises(ValueError, match="not foreseen"):
        node.stop_requested.result()


def test_what_waits_at_the_end_behind_a_slow_callback_is_handled_too(node):
    topic = interfaces.IMPACT
    node.listen(topic, lambda _: None)
    publisher = node.advertise(topic)
    wait_until(lambda: publisher.get_subscription_count() == 1)
    node.executor.create_task(lambda: time.sleep(3 * DRAIN_QUIET))
    publisher.publish(topic.type())
    assert node.wait_for_acks([publisher], PATIENCE)
    drain(node, node.executor)
    assert node.intake.handled == 1
