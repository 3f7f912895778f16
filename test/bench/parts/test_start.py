"""The part `start`: processes are started and timed."""

import pytest

from impact_rig.bench.part import Bench
from impact_rig.bench.parts import start


def test_a_process_is_timed_to_its_end() -> None:
    assert start.run_python(("-c", "import time; time.sleep(0.2)")) > 0.2


def test_help_and_every_node_are_measured(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("rclpy", reason="the nodes need ROS 2")
    started: list[str] = []

    def run(words: tuple[str, ...]) -> float:
        started.append(words[-1])
        return float(len(started))

    monkeypatch.setattr(start, "run_python", run)
    helps, empties, *nodes = start.measure(bench)
    assert str(helps.goal) == "at most 0.3"
    assert (len(helps.values), len(empties.values)) == (bench.extent.repeats,) * 2
    names = {"hammer", "accelerometer", "estimator", "campaign", "recorder", "visualizer"}
    assert {figure.name.split(",")[0] for figure in nodes} == names
    assert {"import impact_rig.nodes." + name for name in names} < set(started)
    assert {len(figure.values) for figure in nodes} == {start.IMPORTS}


def test_without_ros_it_is_said_what_is_missing(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(start.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(ModuleNotFoundError) as caught:
        start.measure(bench)
    assert caught.value.name == "rclpy"
