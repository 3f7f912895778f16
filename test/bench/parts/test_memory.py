"""The part `memory`: a real rig strikes, and every node is looked at twice."""

import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest

from impact_rig.bench import rig_processes
from impact_rig.bench.part import Bench
from impact_rig.bench.parts import memory
from impact_rig.core.errors import RigError

NODES = {"hammer", "accelerometer", "estimator", "campaign", "recorder", "visualizer"}


def test_every_node_is_looked_at_early_and_late(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rclpy", reason="the nodes need ROS 2")
    monkeypatch.setattr(memory, "EARLY_HITS", 1)
    looks: list[set[str]] = []
    read = memory.read_memory

    def read_again(processes: Any) -> dict[str, float]:
        looks.append(set(processes))
        return read(processes)

    monkeypatch.setattr(memory, "read_memory", read_again)
    figures = memory.measure(bench)
    assert looks == [NODES, NODES]
    assert {figure.name.split(",")[0] for figure in figures} == NODES
    for figure in figures:
        assert str(figure.goal) == "at most 1.05"
        assert 0.5 < figure.median < 2.0


@pytest.fixture
def sleeper() -> Iterator[subprocess.Popen[str]]:
    words = [sys.executable, "-c", "block = b'x' * 50_000_000; print(flush=True); input()"]
    with subprocess.Popen(
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        yield process
        process.kill()


def test_memory_is_that_of_the_process(sleeper: subprocess.Popen[str]) -> None:
    assert sleeper.stdout is not None
    sleeper.stdout.readline()
    found = memory.read_memory({"hammer": sleeper})
    assert 50e6 < found["hammer"] < 90e6


def test_a_node_that_has_ended_is_named(sleeper: subprocess.Popen[str]) -> None:
    sleeper.kill()
    sleeper.wait()
    with pytest.raises(RigError, match="the hammer node cannot be looked at"):
        memory.read_memory({"hammer": sleeper})


def test_a_rig_that_does_not_strike_is_an_error_in_its_own_words(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rclpy", reason="the nodes need ROS 2")
    monkeypatch.setattr(memory, "CAMPAIGN", "no_such_module")
    monkeypatch.setattr(rig_processes.RigProcesses, "start_rig", lambda *_, **__: {})
    with pytest.raises(RigError, match=r"the rig does not strike: .*no_such_module"):
        memory.measure(bench)
