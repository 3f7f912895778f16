"""The part `devices`: an instrument, the accelerometers and an observer are processes."""

import pytest

from bench import devices


def test_records_are_timed_from_the_instrument_to_an_observer(bench, monkeypatch):
    pytest.importorskip("rclpy", reason="the nodes need ROS 2")
    monkeypatch.setattr(devices, "HITS", 2)
    monkeypatch.setattr(devices, "WARM_UP", 1)
    whole, tail = devices.measure_devices(bench)
    assert len(whole.values) == 2
    # A record cannot be there before it is complete, nor may it take for ever on a busy computer.
    assert all(0.0 < value < 1000.0 for value in whole.values)
    assert str(whole.goal) == "at most 10"
    assert tail.unit == whole.unit == "ms"
