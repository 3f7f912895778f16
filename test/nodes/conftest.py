"""Real nodes over real DDS, each test in its own ROS domain; see `impact_rig.testing.harness`."""

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from terminal import Terminal

from impact_rig.nodes.interfaces import RECORD_STORED, RECORDER_STATE
from impact_rig.nodes.recorder import RecorderNode
from impact_rig.testing.harness import Collector, Harness


@pytest.fixture
def start_process(ros_domain: int) -> Iterator[Callable[..., Terminal]]:
    """Return a function that starts a node, by name and parameters, as a process."""
    with ExitStack() as processes:

        def start(name: str, **parameters: Any) -> Terminal:
            words = [sys.executable, "-m", "impact_rig.nodes", name, "--ros-args"]
            for key, value in parameters.items():
                words += ["-p", f"{key}:={value}"]
            terminal = processes.enter_context(Terminal(words))
            processes.callback(terminal.process.kill)
            processes.callback(lambda: print(terminal.text))  # shown where the test has failed
            return terminal

        yield start


@pytest.fixture
def recorder(
    harness: Harness, tmp_path: Path
) -> Callable[..., tuple[Collector, Collector, RecorderNode]]:
    """Return a function that starts a recorder; it returns what it says, and the node."""

    def start(
        kind: Any = RecorderNode, **parameters: Any
    ) -> tuple[Collector, Collector, RecorderNode]:
        namespace = parameters.get("namespace", "")
        states = harness.listen(RECORDER_STATE, namespace)
        stored = harness.listen(RECORD_STORED, namespace)
        output = str(tmp_path / "session.mcap")
        node = harness.add(kind, **{"output": output, **parameters})
        states.wait(lambda messages: messages[-1].recording)
        return states, stored, node

    return start
