"""Real nodes over real DDS, each test in its own ROS domain."""

import contextlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath
from types import SimpleNamespace
from typing import Any, Self

import pytest
import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import SetParameters
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future

from impact_rig.core.setup import PAPER_SETUP
from impact_rig.nodes.async_node import RESEND_PERIOD
from impact_rig.nodes.discovery import reserve_domain
from impact_rig.nodes.executor import make_executor, spin_until
from impact_rig.nodes.interfaces import RECORD_STORED, RECORDER_STATE, SETUP, Topic
from impact_rig.nodes.messages import setup_to_msg, stamp_to_msg
from impact_rig.nodes.recorder import RecorderNode
from impact_rig.nodes.rig_member import RigMember
from impact_rig.nodes.rig_node import RigNode

PATIENCE = 120.0
"""How long anything may take before a test fails [s]; no test waits for it to pass."""


PACE = 10.0
"""How many times as often as usual nodes look at things [-]: else tests wait for a second."""


def wait_until(condition: Callable[[], bool], patience: float = PATIENCE) -> None:
    """Wait for what sends no event (the ROS graph), looking often."""
    deadline = time.monotonic() + patience
    pause = threading.Event()
    while not condition():
        assert time.monotonic() < deadline, "it never came true"
        pause.wait(0.005)


class Collector:
    """Keeps what arrives on a topic, and waits for it."""

    def __init__(self) -> None:
        self.messages: list[Any] = []
        self._arrived = threading.Condition()

    def take(self, message: Any) -> None:
        with self._arrived:
            self.messages.append(message)
            self._arrived.notify_all()

    def wait(self, condition: Callable[[list[Any]], bool]) -> list[Any]:
        """Wait until messages that have come fulfil a condition; return all."""
        return self._wait(lambda: bool(self.messages) and condition(self.messages))

    def wait_for_count(self, count: int) -> list[Any]:
        return self._wait(lambda: len(self.messages) >= count)

    def has_come(self, patience: float) -> bool:
        """Wait for the first message, so long [s]; return whether it came."""
        with self._arrived:
            return self._arrived.wait_for(lambda: bool(self.messages), patience)

    def _wait(self, condition: Callable[[], bool]) -> list[Any]:
        with self._arrived:
            came_true = self._arrived.wait_for(condition, PATIENCE)
            assert came_true, f"only {len(self.messages)} messages came"
            return list(self.messages)


class Harness:
    """Runs nodes in a background thread."""

    def __init__(self, domain: int, recording: Path) -> None:
        self.recording = recording
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain, args=[])
        self._executor = make_executor(self._context)
        self.nodes: list[RigNode] = []
        self._clients: dict[str, Any] = {}
        self.peer = Node("peer", context=self._context)
        self._executor.add_node(self.peer)
        self._stop: Future = Future()
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            spin_until(self._executor, self._stop)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set_result(None)
        self._thread.join(PATIENCE)
        self._executor.shutdown(timeout_sec=1.0)
        for node in self.nodes:
            node.close()
            node.destroy_node()
        self.peer.destroy_node()
        self._context.try_shutdown()

    def add(self, kind: Any, *, namespace: str = "", **parameters: Any) -> Any:
        """Start a node as its `main` would."""
        node = kind(
            context=self._context,
            namespace=namespace or None,
            pace=PACE,
            parameter_overrides=[
                Parameter(name, value=value) for name, value in parameters.items()
            ],
        )
        self.nodes.append(node)
        self._executor.add_node(node)
        self.run(node.autostart)
        return node

    def record(self, namespace: str = "") -> RecorderNode:
        return self.add(RecorderNode, namespace=namespace, output=str(self.recording))

    def run(self, work: Callable[[], Any]) -> Any:
        """Do something in the nodes' executor, between two callbacks."""
        done: Future = Future()

        def run() -> None:
            try:
                done.set_result(work())
            except Exception as error:  # noqa: BLE001 - raised where it was asked for
                done.set_exception(error)

        self._executor.create_task(run)
        return self.wait(done)

    def close(self, node: RigNode) -> None:
        self.run(node.close)

    def listen(self, topic: Topic, namespace: str = "") -> Collector:
        collector = Collector()
        name = str(PurePosixPath("/", namespace, topic.name))
        self.peer.create_subscription(topic.type, name, collector.take, topic.qos)
        return collector

    def advertise(self, topic: Topic) -> Any:
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
        wait_until(client.service_is_ready)
        answers = Collector()
        for _ in range(round(PATIENCE / RESEND_PERIOD)):
            future = client.call_async(request or kind.Request())
            future.add_done_callback(lambda done: answers.take(done.result()))
            if answers.has_come(RESEND_PERIOD):
                return answers.messages[0]
        raise AssertionError(f"{name} does not answer")

    def change_state(self, node: str, *transitions: str) -> None:
        """Lead a node through transitions, as `ros2 lifecycle set` does."""
        for name in transitions:
            transition = Transition(id=getattr(Transition, f"TRANSITION_{name.upper()}"))
            request = ChangeState.Request(transition=transition)
            assert self.call(ChangeState, f"{node}/change_state", request).success

    def set_parameter(self, node: str, name: str, value: Any) -> str:
        """Set a parameter as `ros2 param set` does; return why it was refused, or nothing."""
        parameter = Parameter(name, value=value).to_parameter_msg()
        request = SetParameters.Request(parameters=[parameter])
        (result,) = self.call(SetParameters, f"{node}/set_parameters", request).results
        assert result.successful != bool(result.reason)
        return str(result.reason)

    def ask_until(self, word: str, ask: Callable[[], Any]) -> list[Any]:
        """Ask until a message has a word; return all answers."""
        answers = [ask()]
        self.wait_until(lambda: word in answers[-1].message or answers.append(ask()))
        return answers

    def ask(self, kind: Any, name: str, request: Any) -> Any:
        """Call a service, again while it answers "later", and return its answer."""
        answers: list[Any] = []

        def is_final() -> bool:
            answers.append(self.call(kind, name, request))
            return not answers[-1].later

        wait_until(is_final)
        return answers[-1]

    wait_until = staticmethod(wait_until)
    make_collector = Collector

    @staticmethod
    def wait(future: Any) -> Any:
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        assert future.done() or done.wait(PATIENCE), "no answer came"
        return future.result()


class NodeProcess:
    """A node as a process, with what it prints."""

    def __init__(self, name: str, domain: int, parameters: dict[str, Any]) -> None:
        arguments = ["--ros-args"]
        for key, value in parameters.items():
            arguments += ["-p", f"{key}:={value}"]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "impact_rig.nodes", name, *arguments],
            env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.number = self._process.pid
        self.output = ""

    def send_signal(self, number: int) -> None:
        self._process.send_signal(number)

    @property
    def is_running(self) -> bool:
        return self._process.poll() is None

    def wait_for(self, word: str) -> None:
        """Wait until it prints a word."""
        for line in self._process.stdout or ():
            self.output += line
            if word in line:
                return
        raise AssertionError(f"it has ended: {self.output}")

    def wait(self) -> int:
        """Wait for the end; return the exit code."""
        self.output += self._process.communicate(timeout=PATIENCE)[0]
        return self._process.returncode

    def kill(self) -> None:
        if self.is_running:
            self._process.kill()
            self.wait()


@pytest.fixture
def start_process(
    ros_domain: int, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[..., NodeProcess]]:
    """Return a function that starts a node, by name and parameters, as a process."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    processes = []

    def start(name: str, **parameters: Any) -> NodeProcess:
        processes.append(NodeProcess(name, ros_domain, parameters))
        return processes[-1]

    yield start
    for process in processes:
        process.kill()
        # Shown where the test has failed.
        print(process.output)


@pytest.fixture
def ros_domain() -> Iterator[int]:
    """Return a ROS domain that is free on this host."""
    with reserve_domain() as number:
        yield number


@pytest.fixture
def harness(ros_domain: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Harness]:
    """Return a place to run nodes in."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv(
        "ROS_DOMAIN_ID", str(ros_domain)
    )  # of which a node looks for a rig that is up
    keep = RigMember._keep_liveliness

    def keep_liveliness(member: RigMember, status: Any) -> None:
        """Nodes of one process give each other no signs of life, and are not silent."""
        theirs = started.peer.get_publishers_info_by_topic(member._subscription.topic_name)
        ours = {node.get_name() for node in (*started.nodes, started.peer)}
        is_ours = any(item.node_name in ours for item in theirs)
        silent = 0 if is_ours and not status.alive_count else status.not_alive_count
        keep(member, SimpleNamespace(alive_count=status.alive_count, not_alive_count=silent))

    monkeypatch.setattr(RigMember, "_keep_liveliness", keep_liveliness)
    with Harness(ros_domain, tmp_path / "session.mcap") as started:
        yield started


@pytest.fixture
def recorder(
    harness: Harness, tmp_path: Path
) -> Callable[..., tuple[Collector, Collector, RecorderNode]]:
    """Return a function that starts a recorder; it returns what it says, and the node."""

    def start(**parameters: Any) -> tuple[Collector, Collector, RecorderNode]:
        namespace = parameters.get("namespace", "")
        states = harness.listen(RECORDER_STATE, namespace)
        stored = harness.listen(RECORD_STORED, namespace)
        output = str(tmp_path / "session.mcap")
        node = harness.add(RecorderNode, **{"output": output, **parameters})
        states.wait(lambda messages: messages[-1].recording)
        return states, stored, node

    return start
