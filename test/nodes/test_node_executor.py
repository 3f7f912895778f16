"""The executor of the nodes: what it runs, what it leaves, and what it costs."""

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import rclpy
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import String

from impact_rig.nodes.domain import reserve_domain
from impact_rig.nodes.node_executor import NodeExecutor, make_executor
from impact_rig.nodes.rig_node import RigNode

PATIENCE = 30.0
"""How long anything may take before a test fails [s]; no test waits for it to pass."""
SOON = 1e-9
"""Of a timer that is ready at once [s]."""


@pytest.fixture
def node() -> Iterator[Node]:
    context = rclpy.Context()
    with reserve_domain() as domain:
        rclpy.init(context=context, domain_id=domain, args=[])
        made = Node("node", context=context)
        yield made
        made.destroy_node()
        context.try_shutdown()


@pytest.fixture
def executor(node: Node) -> Iterator[NodeExecutor]:
    made = NodeExecutor(context=node.context)
    made.add_node(node)
    yield made
    made.shutdown()


def spin_until(executor: Any, condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, "it never came true"
        executor.spin_once(timeout_sec=1.0)


def test_messages_reach_their_callbacks_in_their_order(node: Node, executor: NodeExecutor) -> None:
    heard: list[str] = []
    node.create_subscription(String, "words", lambda message: heard.append(message.data), 10)
    publisher = node.create_publisher(String, "words", 10)
    spin_until(executor, lambda: publisher.get_subscription_count() > 0)
    for word in "abc":
        publisher.publish(String(data=word))
    spin_until(executor, lambda: len(heard) == 3)
    assert heard == ["a", "b", "c"]


def test_what_another_thread_adds_while_it_waits_is_waited_for_too(
    node: Node, executor: NodeExecutor
) -> None:
    fired = threading.Event()
    threading.Timer(0.05, lambda: node.create_timer(SOON, fired.set)).start()
    spin_until(executor, fired.is_set)


def test_a_task_of_another_thread_ends_the_waiting(executor: NodeExecutor) -> None:
    done = threading.Event()
    threading.Timer(0.05, lambda: executor.create_task(done.set)).start()
    spin_until(executor, done.is_set)


def test_without_anything_to_do_it_waits_as_long_as_asked(executor: NodeExecutor) -> None:
    for _ in range(3):
        executor.spin_once(timeout_sec=0.0)
    began = time.monotonic()
    executor.spin_once(timeout_sec=0.05)
    assert time.monotonic() - began >= 0.05


@pytest.mark.parametrize("end", ["cancel", "destroy"])
def test_what_a_callback_has_ended_has_no_turn_though_it_was_ready(
    node: Node, executor: NodeExecutor, end: str
) -> None:
    fired: list[str] = []
    timers: list[Any] = []

    def fire(name: str, other: int) -> None:
        fired.append(name)
        if end == "cancel":
            timers[other].cancel()
        else:
            node.destroy_timer(timers[other])

    timers += [
        node.create_timer(SOON, lambda: fire("first", 1)),
        node.create_timer(SOON, lambda: fire("second", 0)),
    ]
    for _ in range(4):
        executor.spin_once(timeout_sec=0.0)
    assert len(set(fired)) == 1


@pytest.mark.parametrize(
    ("group", "passes"),
    [(ReentrantCallbackGroup(), True), (MutuallyExclusiveCallbackGroup(), False)],
)
def test_a_callback_that_waits_holds_up_those_of_its_group_that_must_not_run_beside_it(
    node: Node, executor: NodeExecutor, group: Any, passes: bool
) -> None:
    go_on = Future(executor=executor)
    course: list[str] = []

    async def wait() -> None:
        course.append("begins")
        slow.cancel()
        await go_on
        course.append("ends")

    def tick() -> None:
        course.append("tick")

    slow = node.create_timer(SOON, wait, callback_group=group)
    spin_until(executor, lambda: "begins" in course)
    node.create_timer(SOON, tick, callback_group=group)
    for _ in range(5):
        executor.spin_once(timeout_sec=0.0)
    assert ("tick" in course) is passes
    executor.create_task(go_on.set_result, None)
    spin_until(executor, lambda: "ends" in course and course[-1] == "tick")


def test_a_callback_goes_on_as_soon_as_what_it_waits_for_is_there(
    node: Node, executor: NodeExecutor
) -> None:
    word = Future(executor=executor)
    heard: list[str] = []

    async def listen() -> None:
        heard.append(await word)

    executor.create_task(listen)
    executor.spin_once(timeout_sec=0.0)
    threading.Timer(0.05, lambda: executor.create_task(word.set_result, "now")).start()
    spin_until(executor, lambda: heard == ["now"])


@pytest.mark.parametrize("kind", ["callback", "waiting callback", "task"])
def test_an_error_comes_out_of_spinning(node: Node, executor: NodeExecutor, kind: str) -> None:
    ready = Future(executor=executor)

    def fail() -> None:
        raise ValueError("told")

    async def fail_later() -> None:
        timer.cancel()
        await ready
        fail()

    if kind == "task":
        executor.create_task(fail)
    else:
        timer = node.create_timer(SOON, fail if kind == "callback" else fail_later)
        executor.create_task(lambda: executor.create_task(ready.set_result, None))
    with pytest.raises(ValueError, match="told"):
        spin_until(executor, lambda: False)


def test_the_end_of_ros_ends_it(node: Node, executor: NodeExecutor) -> None:
    threading.Timer(0.05, node.context.shutdown).start()
    with pytest.raises(ExternalShutdownException):
        spin_until(executor, lambda: False)


def test_a_node_that_was_removed_is_left_alone(node: Node, executor: NodeExecutor) -> None:
    fired: list[None] = []
    node.create_timer(SOON, lambda: fired.append(None))
    spin_until(executor, lambda: bool(fired))
    executor.remove_node(node)
    count = len(fired)
    for _ in range(3):
        executor.spin_once(timeout_sec=0.0)
    assert len(fired) == count


def test_a_callback_costs_less_than_half_of_what_it_costs_with_rclpys(node: Node) -> None:
    # Measured: a fifth.
    rig_node = RigNode("rig_node", context=node.context)
    costs = {
        kind: measure_callbacks(rig_node, kind(context=node.context))
        for kind in (SingleThreadedExecutor, NodeExecutor)
    }
    rig_node.destroy_node()
    assert costs[NodeExecutor] < 0.5 * costs[SingleThreadedExecutor]


def measure_callbacks(node: Node, executor: Any) -> float:
    """Return the processor time of two hundred callbacks that come one by one [s]."""
    executor.add_node(node)
    heard: list[None] = []
    guard = node.create_guard_condition(lambda: heard.append(None))
    spent = 0.0
    for count in range(210):
        began = time.thread_time()
        guard.trigger()
        spin_until(executor, lambda count=count: len(heard) > count)
        spent += (time.thread_time() - began) * (count >= 10)
    node.destroy_guard_condition(guard)
    executor.remove_node(node)
    executor.shutdown()
    return spent


def test_an_rclpy_with_other_insides_runs_its_own_executor(
    node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = make_executor(context=node.context)
    known.shutdown()
    monkeypatch.delattr(Executor, "_take_client")
    other = make_executor(context=node.context)
    other.shutdown()
    assert isinstance(known, NodeExecutor)
    assert isinstance(other, SingleThreadedExecutor)
