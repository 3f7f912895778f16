"""Nodes in the process of a test: the rig's, or yours, and a peer that talks to them."""

import threading
import time
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from typing import Any, TypeVar

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future

from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.nodes.interfaces import SETUP, Topic
from impact_rig.nodes.listener import BackgroundNode
from impact_rig.nodes.managed_node import RESEND_PERIOD
from impact_rig.nodes.messages import setup_to_msg, stamp_to_msg
from impact_rig.nodes.recorder import RecorderNode
from impact_rig.nodes.rig_node import RigNode

T = TypeVar("T")
N = TypeVar("N", bound=RigNode)
G = TypeVar("G", bound=Node)
PATIENCE = 120.0
"""How long anything may take before a test fails [s]; no test waits for it to pass."""
PACE = 10.0
"""How many times as often as usual nodes look at things [-]: else tests wait for a second."""


def wait_until(condition: Callable[[], bool], patience: float = PATIENCE) -> None:
    """Wait for what sends no event (the ROS graph), looking often."""
    deadline = time.monotonic() + patience
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError("it never came true")
        time.sleep(0.005)


class Collector:
    """Keeps the messages that arrive on a topic, and waits for them."""

    def __init__(self) -> None:
        self.messages: list[Any] = []
        self.failure: Exception | None = None  # of a node: nothing may come any more
        self._arrived = threading.Condition()

    def take(self, message: Any) -> None:
        """Keep a message."""
        with self._arrived:
            self.messages.append(message)
            self._arrived.notify_all()

    def fail(self, error: Exception) -> None:
        """Let who waits raise an error."""
        with self._arrived:
            self.failure = error
            self._arrived.notify_all()

    def wait(self, condition: Callable[[list[Any]], bool]) -> list[Any]:
        """Wait until the messages, at least one, fulfil a condition; return all."""

        def is_over() -> bool:
            return self.failure is not None or (bool(self.messages) and condition(self.messages))

        with self._arrived:
            has_come = self._arrived.wait_for(is_over, PATIENCE)
            if self.failure is not None:
                raise self.failure
            if not has_come:
                raise AssertionError(f"only {len(self.messages)} messages came")
            return list(self.messages)

    def wait_for_count(self, count: int) -> list[Any]:
        """Wait until so many messages have come; return all."""
        return self.wait(lambda messages: len(messages) >= count)

    def has_come(self, patience: float) -> bool:
        """Wait for the first message, so long [s]; return whether it came."""
        with self._arrived:
            return self._arrived.wait_for(lambda: bool(self.messages), patience)


class Harness(BackgroundNode):
    """Runs nodes in a thread of this process, with a node `peer` that talks to them.

    What a callback of a node raises ends that thread, and is raised where the test waits.

    Parameters
    ----------
    recording : Path
        What `record` writes.
    domain : int, optional
        ROS domain; that of the environment by default.

    Examples
    --------
    The fixture `harness` is one::

        def test_my_node_hears_the_hammer(harness):
            mine = harness.run_node(MyNode(context=harness.context))
            harness.add(HammerNode, swing_time=0.01)
            harness.call(Act, "hammer/arm")
            harness.wait_until(lambda: mine.has_heard_that_it_is_armed)
    """

    def __init__(self, recording: Path, domain: int | None = None) -> None:
        self.failure: Exception | None = None  # what a callback raised
        self._collectors: list[Collector] = []
        super().__init__("peer", domain)
        self.peer = self.node
        self.recording = recording
        self.nodes: list[RigNode] = []  # of the rig
        self._guests: list[Node] = []
        self._clients: dict[str, Any] = {}

    def _spin(self) -> None:
        try:
            super()._spin()
        except Exception as error:  # noqa: BLE001 - raised where the test waits
            self.failure = error
            for collector in self._collectors:
                collector.fail(error)

    def check(self) -> None:
        """Raise what a callback has raised."""
        if self.failure is not None:
            raise self.failure

    def wait_until(self, condition: Callable[[], bool], patience: float = PATIENCE) -> None:
        """Wait for what sends no event (the ROS graph), looking often."""
        wait_until(lambda: self.failure is not None or condition(), patience)
        self.check()

    def make_collector(self) -> Collector:
        """Return a collector of messages; see `listen` for those of a topic of the rig."""
        collector = Collector()
        collector.failure = self.failure
        self._collectors.append(collector)
        return collector

    def leave(self) -> None:
        """Close the nodes."""
        for node in self.nodes:
            node.close()
        for guest in (*self.nodes, *self._guests):
            guest.destroy_node()

    def run_node(self, node: G) -> G:
        """Run a node of yours, made with this harness's context; return it."""
        self._guests.append(node)
        self.executor.add_node(node)
        return node

    def add(self, kind: Callable[..., Any], *, namespace: str = "", **parameters: Any) -> Any:
        """Start a node of the rig, a class or what returns one, as its process would."""
        node = kind(
            context=self.context,
            namespace=namespace or None,
            pace=PACE,
            parameter_overrides=[
                Parameter(name, value=value) for name, value in parameters.items()
            ],
        )
        self.nodes.append(node)
        self.executor.add_node(node)
        self.run(node.autostart)
        return node

    def find(self, kind: type[N]) -> N:
        """Return the node of a class that runs here."""
        (node,) = (node for node in self.nodes if isinstance(node, kind))
        return node

    def record(self, namespace: str = "") -> RecorderNode:
        """Start a recorder."""
        node: RecorderNode = self.add(
            RecorderNode, namespace=namespace, output=str(self.recording)
        )
        return node

    def run(self, work: Callable[[], T]) -> T:
        """Do something in the nodes' thread, between two callbacks; return what it returns."""
        done: Future = Future()

        def run() -> None:
            try:
                done.set_result(work())
            except Exception as error:  # noqa: BLE001 - raised where it was asked for
                done.set_exception(error)

        self.executor.create_task(run)
        result: T = self.wait(done)
        return result

    def listen(self, topic: Topic, namespace: str = "") -> Collector:
        """Collect the messages of a topic of the rig."""
        collector = self.make_collector()
        name = str(PurePosixPath("/", namespace, topic.name))
        self.peer.create_subscription(topic.type, name, collector.take, topic.qos)
        return collector

    def advertise(self, topic: Topic) -> Any:
        """Create a publisher of a topic of the rig, as that of the rig's own node."""
        return self.peer.create_publisher(topic.type, topic.name, topic.leased_qos)

    def tell_setup(self) -> None:
        """Publish the paper's set-up, as a campaign that begins now."""
        message = setup_to_msg(PAPER_SETUP, stamp_to_msg(time.time_ns()))
        self.advertise(SETUP).publish(message)

    def call(self, kind: Any, name: str, request: Any = None) -> Any:
        """Call a service and return its answer.

        A server that has not met the client's reader yet drops its answer: it is asked again.
        """
        if name not in self._clients:
            self._clients[name] = self.run(lambda: self.peer.create_client(kind, name))
        client = self._clients[name]
        self.wait_until(client.service_is_ready)
        answers = Collector()
        for _ in range(round(PATIENCE / RESEND_PERIOD)):
            future = client.call_async(request or kind.Request())
            future.add_done_callback(lambda done: answers.take(done.result()))
            self.check()
            if answers.has_come(RESEND_PERIOD):
                return answers.messages[0]
        raise AssertionError(f"{name} does not answer")

    def ask(self, kind: Any, name: str, request: Any) -> Any:
        """Call a service, again while it answers "later"; return its answer."""
        answers: list[Any] = []

        def is_final() -> bool:
            answers.append(self.call(kind, name, request))
            return not answers[-1].later

        self.wait_until(is_final)
        return answers[-1]

    def settle(self) -> None:
        """Wait until each node has answered: it has taken what came before."""
        for node in self.nodes:
            self.call(GetState, f"{node.get_name()}/get_state")

    def change_state(self, node: str, *transitions: str) -> None:
        """Lead a node through transitions, as `ros2 lifecycle set` does."""
        for name in transitions:
            transition = Transition(id=getattr(Transition, f"TRANSITION_{name.upper()}"))
            request = ChangeState.Request(transition=transition)
            if not self.call(ChangeState, f"{node}/change_state", request).success:
                raise AssertionError(f"{node} does not {name}")

    def set_parameter(self, node: str, name: str, value: Any) -> str | None:
        """Set a parameter as `ros2 param set` does; return why it was refused."""
        parameter = Parameter(name, value=value).to_parameter_msg()
        request = SetParameters.Request(parameters=[parameter])
        (result,) = self.call(SetParameters, f"{node}/set_parameters", request).results
        return None if result.successful else str(result.reason)

    def wait(self, future: Any) -> Any:
        """Wait for what a future will hold."""
        self.wait_until(future.done)
        return future.result()
