"""The part `devices`: an instrument, the accelerometers and an observer are processes."""

import queue

import pytest

from impact_rig.bench.part import Bench
from impact_rig.bench.parts import devices
from impact_rig.core.errors import RigError


class Log:
    """Processes of which only what they printed last is asked."""

    @staticmethod
    def read_log() -> str:
        return "no such file"


def test_records_are_timed_from_the_instrument_to_an_observer(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rclpy", reason="the nodes need ROS 2")
    monkeypatch.setattr(devices, "HITS", 2)
    monkeypatch.setattr(devices, "SETTLING", 1)
    whole, tail = devices.measure(bench)
    assert len(whole.values) == 2
    # A record cannot be there before it is complete, nor may it take for ever on a busy computer.
    assert all(0.0 < value < 1000.0 for value in whole.values)
    assert str(whole.goal) == "at most 10"
    assert tail.unit == whole.unit == "ms"


@pytest.mark.parametrize("said", ["", None])
def test_a_process_that_says_nothing_more_is_named_by_its_log(
    monkeypatch: pytest.MonkeyPatch, said: str | None
) -> None:
    monkeypatch.setattr(devices, "PATIENCE", 0.01)
    lines: queue.Queue[str] = queue.Queue()
    if said is not None:
        lines.put(said)
    with pytest.raises(RigError, match="the records do not come: no such file"):
        devices.hear(lines, Log)
