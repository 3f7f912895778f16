"""rclpy's events executor as the nodes use it."""

import threading
import time
from collections.abc import Callable, Iterator

import pytest
import rclpy
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.task import Future

from impact_rig.core.given.errors import DeviceError
from impact_rig.nodes import interfaces
from impact_rig.nodes.executor import make_executor, spin_until
from impact_rig.nodes.process import DRAIN_QUIET, drain
from impact_rig.nodes.rig_node import RigNode

PATIENCE = 30.0
"""How long anything may take before a test fails [s]; no test waits for it to pass."""


@pytest.fixture
def node(ros_domain: int) -> Iterator[RigNode]:
    context = rclpy.Context()
    rclpy.init(context=context, args=[])
    made = RigNode("node", context=context)
    yield made
    made.destroy_node()
    context.try_shutdown()


@pytest.fixture
def executor(node: Node) -> Iterator[Executor]:
    made = make_executor(node.context)
    made.add_node(node)
    yield made
    made.shutdown()


def run_until(executor: Executor, condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, "it never came true"
        executor.spin_once(timeout_sec=0.1)


def test_another_thread_ends_the_spinning_which_costs_nothing_until_then(executor):
    stop: Future = Future()
    threading.Timer(0.5, lambda: stop.set_result(None)).start()
    began = time.thread_time()
    spin_until(executor, stop)
    assert stop.done()
    assert time.thread_time() - began < 0.25
    # And what has been stopped before it begins ends at once.
    spin_until(executor, stop)


def test_an_error_in_such_work_is_a_fault_and_an_unexpected_one_ends_the_process(node, executor):
    def fail(error: Exception) -> None:
        raise error

    node.run_soon(lambda: fail(DeviceError("the device is lost")))
    run_until(executor, lambda: node.fault == "the device is lost")
    assert not node.stop_requested.done()
    node.run_soon(lambda: fail(ValueError("not foreseen")))
    spin_until(executor, node.stop_requested)
    with pytest.raises(ValueError, match="not foreseen"):
        node.stop_requested.result()


def test_what_waits_at_the_end_behind_a_slow_callback_is_handled_too(node, executor):
    topic = interfaces.IMPACT
    node.listen(topic, lambda _: None)
    publisher = node.advertise(topic)
    run_until(executor, lambda: publisher.get_subscription_count() == 1)
    executor.create_task(lambda: time.sleep(3 * DRAIN_QUIET))
    publisher.publish(topic.type())
    assert node.wait_for_acks([publisher], PATIENCE)
    drain(node, executor)
    assert node.intake.handled == 1
