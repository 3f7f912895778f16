"""State of a rig, kept for every display."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from impact_rig.nodes.interfaces import DIAGNOSTICS
from impact_rig.status.rig_status import MOST_NODES, SILENCE, STATE_SILENCE, RigStatus
from impact_rig.status.states import AcquisitionStatus, CampaignStatus, HammerStatus, Level

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


def test_diagnostics_of_names_that_nobody_knows_are_not_kept_for_ever():
    health = RigStatus("/")
    for number in range(MOST_NODES):
        health.add_health(say(f"/stranger{number}"))
    health.add_health(say("/hammer"))
    names = [node.name for node in health.list_nodes()]
    assert len(names) == MOST_NODES
    assert "hammer" in names
    assert "stranger0" not in names


def test_a_node_that_does_not_answer_is_named_the_hammer_first():
    now = 100.0
    rig = RigStatus("/", clock=lambda: now)
    assert rig.list_silent() == ()  # who has said nothing yet is not missed
    rig.add_health(say("/estimator"))
    rig.keep(CampaignStatus())
    rig.keep(HammerStatus())
    now += STATE_SILENCE
    assert rig.list_silent() == ()
    now += 0.01
    assert rig.list_silent() == ("hammer", "campaign")
    rig.keep(CampaignStatus())
    now = 100.0 + SILENCE
    assert rig.list_silent() == ("hammer", "campaign", "estimator")
    rig.keep(HammerStatus())
    assert rig.list_silent() == ("campaign", "estimator")


def test_simulated_is_a_rig_whose_source_and_holder_both_have_no_hammer():
    rig = RigStatus("/")
    for source, holder in ((True, False), (False, True), (False, False), (True, True)):
        rig.keep(AcquisitionStatus(hammerless=source))
        rig.keep(HammerStatus(hammerless=holder))
        assert rig.is_simulated == (source and holder)
