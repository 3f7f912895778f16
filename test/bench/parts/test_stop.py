"""The part `stop`: a running campaign is stopped, and goes on for the next stop."""

import json
import queue
from pathlib import Path

import pytest

from impact_rig.bench.part import Bench
from impact_rig.bench.parts import stop
from impact_rig.bench.rig_processes import RigProcesses
from impact_rig.core.errors import RigError


def test_a_campaign_is_stopped_by_the_command_and_by_rclpy_alone(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rclpy", reason="the nodes need ROS 2")
    monkeypatch.setattr(stop, "STOPS", 1)
    ours, bare = stop.measure(bench)
    assert str(ours.goal) == "at most 1"
    # No process with rclpy can be faster; how slow it is is what the bench is for.
    assert min(*ours.values, *bare.values) > 0.05


def test_the_time_of_a_stop_is_that_of_the_hammers_own_word(tmp_path: Path) -> None:
    states: queue.Queue[str] = queue.Queue()
    for moment, released, stopped in ((1.0, True, False), (2.5, False, True), (4.0, True, False)):
        states.put(json.dumps({"time": moment, "released": released, "stopped": stopped}))
    processes = RigProcesses({}, tmp_path / "log.txt")
    assert stop.await_state(states, "stopped", processes) == 2.5
    assert stop.await_state(states, "released", processes) == 4.0


def test_a_hammer_that_says_nothing_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop, "PATIENCE", 0.01)
    log = tmp_path / "log.txt"
    log.write_text("the holder is lost\n")
    with pytest.raises(RigError, match="the hammer is not stopped: the holder is lost"):
        stop.await_state(queue.Queue(), "stopped", RigProcesses({}, log))
