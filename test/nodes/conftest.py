"""Real nodes over real DDS, each test in a ROS domain of its own."""

import contextlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pytest
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future

from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.nodes.discovery import reserve_domain
from impact_rig.nodes.executor import make_executor, spin_until
from impact_rig.nodes.interfaces import NOT_YET, SETUP, Topic
from impact_rig.nodes.messages import setup_to_msg, stamp_to_msg
from impact_rig.nodes.rig_node import RESEND_PERIOD, RigNode

PATIENCE = 120.0
"""How long anything may take before a test fails [s]; no test waits for it to pass."""


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

    def __init__(self, domain: int) -> None:
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain, args=[])
        self._executor = make_executor(self._context)
        self.nodes: list[RigNode] = []
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

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
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
            parameter_overrides=[
                Parameter(name, value=value) for name, value in parameters.items()
            ],
        )
        self.nodes.append(node)
        self._executor.add_node(node)
        self.run(node.autostart)
        return node

    def run(self, work: Callable[[], Any]) -> Any:
        """Do something where the nodes' callbacks run, none of them being under way."""
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
        self.peer.create_subscription(
            topic.type, f"{namespace}/{topic.name}", collector.take, topic.qos
        )
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
        client = self.peer.create_client(kind, name)
        wait_until(client.service_is_ready)
        answers = Collector()
        for _ in range(round(PATIENCE / RESEND_PERIOD)):
            future = client.call_async(request or kind.Request())
            future.add_done_callback(lambda done: answers.take(done.result()))
            if answers.has_come(RESEND_PERIOD):
                return answers.messages[0]
        raise AssertionError(f"{name} does not answer")

    def ask(self, kind: Any, name: str, request: Any) -> Any:
        """Call a service, again while it answers "not yet", and return its answer."""
        answers: list[Any] = []

        def is_final() -> bool:
            answers.append(self.call(kind, name, request))
            return not answers[-1].message.startswith(NOT_YET)

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
    """A node in a process of its own, with what it prints."""

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

    def wait(self) -> int:
        """Wait for the end; return the exit code."""
        self.output += self._process.communicate(timeout=PATIENCE)[0]
        return self._process.returncode

    def kill(self) -> None:
        if self._process.poll() is None:
            self._process.kill()
            self.wait()


@pytest.fixture
def start_process(
    ros_domain: int, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[..., NodeProcess]]:
    """Return a function that starts a node, by name and parameters, in a process of its own."""
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
def ros_domain(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Return a ROS domain that nobody else on this host uses now."""
    # Where a hammer remembers its emergency stop, by its domain.
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with reserve_domain() as number:
        yield number


@pytest.fixture
def harness(ros_domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Harness]:
    """Return a place to run nodes in."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with Harness(ros_domain) as started:
        yield started
