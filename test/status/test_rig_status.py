"""State of a rig, kept for every display."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from impact_rig.nodes.interfaces import DIAGNOSTICS
from impact_rig.status.rig_status import SILENCE, RigStatus
from impact_rig.status.states import Level

OK, ERROR = DiagnosticStatus.OK, DiagnosticStatus.ERROR


def say(name, message="active", level=OK, **values):
    """Return the diagnostics of a node, as they come by the topic."""
    status = DiagnosticStatus(name=name, message=message, level=level)
    status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
    return DIAGNOSTICS.convert(DiagnosticArray(status=[status]))


def test_the_last_word_of_each_node_is_kept():
    health = RigStatus("/lab/rig1")
    assert health.add_health(say("/lab/rig1/recorder", gaps="0"))
    assert health.add_health(say("/lab/rig1/hammer"))
    assert health.add_health(say("/lab/rig1/recorder", "disk full", ERROR, gaps="2"))

    hammer, recorder = health.list_nodes()
    assert (hammer.name, hammer.level) == ("hammer", Level.OK)
    assert (recorder.name, recorder.level, recorder.message) == (
        "recorder", Level.ERROR, "disk full",
    )  # fmt: skip
    assert recorder.values == (("gaps", "2"),)
    for other in ("/hammer", "/lab/rig2/hammer", "joystick: status", "/lab/rig1"):
        assert not health.add_health(say(other))
    assert len(health.list_nodes()) == 2


def test_a_node_that_says_nothing_any_more_is_marked():
    now = 100.0
    health = RigStatus("/", clock=lambda: now)
    health.add_health(say("/hammer", "armed"))
    now += SILENCE + 1.0
    health.add_health(say("/recorder"))

    hammer, recorder = health.list_nodes()
    assert hammer.level == Level.STALE
    assert hammer.message == "silent for 6 s; last: armed"
    assert recorder.level == Level.OK
