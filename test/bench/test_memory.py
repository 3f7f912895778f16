"""The parts `series` and `memory`: hits are judged, and every node of a real rig is looked at."""

from dataclasses import replace

import pytest

from bench import memory
from impact_rig.core.session import Session

NODES = {"hammer", "accelerometer", "estimator", "campaign", "recorder", "visualizer"}


def test_every_node_is_looked_at_early_and_late(bench, monkeypatch):
    pytest.importorskip("rclpy", reason="the nodes need ROS 2")
    monkeypatch.setattr(memory, "EARLY_HITS", 1)
    monkeypatch.setattr(memory, "FURTHER_HITS", 1)
    looks: list[set[str]] = []
    read = memory.read_memory

    def read_again(processes):
        looks.append(set(processes))
        return read(processes)

    monkeypatch.setattr(memory, "read_memory", read_again)
    *figures, cost = memory.measure_memory(bench)
    assert looks == [NODES, NODES]
    assert {figure.name.split(",")[0] for figure in figures} == NODES
    for figure in figures:
        assert (str(figure.goal), figure.unit) == ("at most 1", "kB")
        assert "MB after" in figure.note
    assert cost.median > 1.0
    assert {share.split()[0] for share in cost.note.split(", ")} == NODES


def test_the_cost_of_a_hit_is_that_of_all_nodes_from_look_to_look():
    cost = memory.compute_hit_cost(
        [
            (100, {"hammer": 5.0, "recorder": 7.0}),
            (150, {"hammer": 5.1, "recorder": 7.4}),
            (200, {"hammer": 5.3, "recorder": 8.0}),
        ]
    )
    assert cost.values == pytest.approx((10.0, 16.0))
    assert cost.note == "hammer 3.0, recorder 10.0"
    assert cost.unit == "ms"


def test_every_hit_is_judged_and_the_first_and_last_are_estimated(bench, monkeypatch):
    asked: list[int] = []
    original = Session.estimate_numbers

    def watch(session, name):
        estimate = original(session, name)
        asked.append(estimate.impacts_accepted + estimate.impacts_rejected)
        return estimate

    monkeypatch.setattr(Session, "estimate_numbers", watch)
    cost, grown = memory.measure_series(replace(bench, extent=replace(bench.extent, hits=30)))
    assert asked == [1, 2, 3, 28, 29, 30]
    assert cost.values[0] > 0.0
    assert grown.unit == "kB"
