"""What nodes say of themselves: those of one rig, with those that are silent."""

import itertools

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from impact_rig.nodes.visualizing import rate_meter, rig_health
from impact_rig.nodes.visualizing.rate_meter import RateMeter
from impact_rig.nodes.visualizing.rig_health import SILENCE, RigHealth
from impact_rig.visualization.health import Level


@pytest.fixture
def clock(monkeypatch):
    """Return a clock that only moves when it is told to."""

    class Clock:
        now = 100.0

        def monotonic(self):
            return self.now

    made = Clock()
    monkeypatch.setattr(rig_health, "time", made)
    monkeypatch.setattr(rate_meter, "time", made)
    return made


def say(name, message="active", level=DiagnosticStatus.OK, **values):
    status = DiagnosticStatus(name=name, message=message, level=level)
    status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
    array = DiagnosticArray(status=[status])
    array.header.stamp.sec = 7
    return array


def test_the_last_word_of_each_node_is_kept(clock):
    health = RigHealth("/lab/rig1")
    assert health.add(say("/lab/rig1/recorder", gaps="0"))
    assert health.add(say("/lab/rig1/hammer"))
    assert health.add(say("/lab/rig1/recorder", "disk full", DiagnosticStatus.ERROR, gaps="2"))

    made = health.make_health()
    hammer, recorder = made.nodes
    assert made.stamp == 7 * 10**9
    assert (hammer.name, hammer.level) == ("hammer", Level.OK)
    assert (recorder.name, recorder.level, recorder.message) == (
        "recorder", Level.ERROR, "disk full",
    )  # fmt: skip
    assert recorder.values == (("gaps", "2"),)


@pytest.mark.parametrize("name", ["/hammer", "/lab/rig2/hammer", "joystick: status", "/lab/rig1"])
def test_nodes_of_others_are_left_to_others(name):
    health = RigHealth("/lab/rig1")
    assert not health.add(say(name))
    assert health.make_health().nodes == ()


def test_without_a_namespace_rigs_in_namespaces_are_others():
    health = RigHealth("/")
    assert not health.add(say("/lab/rig1/hammer"))
    assert health.add(say("/hammer"))


def test_a_node_that_says_nothing_any_more_is_marked(clock):
    health = RigHealth("/")
    health.add(say("/hammer", "armed"))
    clock.now += SILENCE + 1.0
    health.add(say("/recorder"))

    hammer, recorder = health.make_health().nodes
    assert hammer.level == Level.STALE
    assert hammer.message == "silent for 6 s; last: armed"
    assert recorder.level == Level.OK


def test_rates_are_counted_from_one_call_to_the_next(clock):
    meter = RateMeter()
    rates = []
    for count, step in itertools.pairwise([0, 50, 50, 51]):
        del step
        clock.now += 2.0
        rates.append(meter.measure({"blocks": count})["blocks"])
    assert rates == [0.0, 25.0, 0.0]
