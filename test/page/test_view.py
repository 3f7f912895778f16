"""The sentence that a person reads first, and what stands beside it."""

from dataclasses import replace

import pytest

from impact_rig.core.estimates.contact_law import ContactLaw
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.findings import Finding, Reason
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.devices.manual import IDENTITY
from impact_rig.page.sentence import (
    CATCH,
    PULL_BACK,
    READ_REJECTION,
    UNCONFIRMED,
    make_sentence,
    say_plainly,
)
from impact_rig.page.view import Button, Strength, make_view
from impact_rig.results.campaign import HitResults
from impact_rig.status.levels import InputLevel, InputLevels
from impact_rig.status.rig_status import RigStatus
from impact_rig.status.states import (
    CampaignStatus,
    Disarming,
    HammerPlace,
    HammerStatus,
    Level,
    NodeHealth,
    SampleProgress,
    Step,
    Task,
)

GOOD = HitResults("steel small", 1, 1, 1, True, contact_time=170e-6, hammer_peak=600.0)
SECOND = Finding(Reason.DOUBLE_HIT, "a second pulse of 9 %")
BAD = HitResults("steel small", 2, 1, 2, False, reasons=(SECOND,))
RUNNING = CampaignStatus(
    state=Step.STRIKING,
    impacts=10,
    counts=(SampleProgress("steel small", 3, 1),),
    sample="steel small",
)


def make_status(campaign=RUNNING, hits=()):
    return make_aged_status(campaign, hits, {})[0]


@pytest.mark.parametrize(
    ("changes", "hits", "kind", "headline", "detail"),
    [
        ({"task": Task.MOUNT}, (), "ask", "MOUNT steel small", "Then say so"),
        (
            {"task": Task.LET_GO, "until": 1234.5},
            (),
            "go",
            "PULL BACK, then RELEASE",
            "hit 4 of 10",
        ),
        ({"task": Task.PUT_BACK}, (), "ask", "PUT THE HAMMER BACK", "hit 4 of 10"),
        ({"task": Task.KEEP_AWAY}, (), "bad", "KEEP AWAY", "Any key holds it back"),
        ({"task": Task.ARM, "message": "no disk"}, (), "paused", "ARM FIRST", "no disk"),
        ({"task": Task.RESUME}, (), "paused", "PAUSED", ""),
        ({"state": Step.PAUSED, "message": "gone"}, (), "paused", "PAUSED", "gone"),
        ({}, (), "wait", "KEEP AWAY", "swings"),
        ({"state": Step.COUNTING}, (GOOD,), "good", "ACCEPTED", "hit 4 of 10"),
        ({"state": Step.COUNTING}, (BAD,), "bad", "REJECTED: second contact", "more gently"),
        ({"state": Step.COUNTING}, (), "wait", "WAIT", "prepares"),
        ({"state": Step.COMPLETE, "impacts": 3}, (), "done", "DONE", "has its hits"),
        (
            {"state": Step.COMPLETE},
            (),
            "paused",
            "ENDED",
            "3 of 10 hits in the mean: steel small lacks 7",
        ),
        ({"state": Step.ENDED, "message": "cancelled"}, (), "paused", "ENDED", "cancelled"),
        ({"state": Step.ENDED}, (), "wait", "READY", "Choose samples"),
    ],
)
def test_the_sentence_says_what_to_do(changes, hits, kind, headline, detail):
    sentence = make_sentence(make_status(replace(RUNNING, **changes), hits))
    assert (sentence.kind, sentence.headline) == (kind, headline)
    assert detail in sentence.detail
    assert sentence.until == (1_234_500 if "until" in changes else None)


STOPPED = {"message": "by Anna", "disarmed_by": Disarming.EMERGENCY_STOP, "stopped_by": "Anna"}
SWITCH = "keep away, use the switch"


def hear(status, *names):
    status.add_health([NodeHealth(f"/{name}", Level.OK, "") for name in names])


def make_aged_status(campaign=RUNNING, hits=(), hammer=STOPPED):
    """Return a status by a clock that can be set, whose nodes have just spoken."""
    now = [0.0]
    status = RigStatus(clock=lambda: now[0])
    status.begin(PAPER_SETUP)
    status.keep(campaign)
    status.keep(HammerStatus(**hammer))
    hear(status, "estimator", "recorder", "accelerometer")
    for hit in hits:
        status.add_hit(hit)
    return status, now


def test_silence_goes_before_a_stop_and_a_stop_before_everything():
    status, now = make_aged_status(replace(RUNNING, task=Task.LET_GO), (GOOD,))
    now[0] = 2.0
    sentence = make_sentence(status)
    assert (sentence.kind, sentence.headline) == ("stopped", "STOPPED")
    assert sentence.detail == "Stopped by Anna. To go on: reset the stop, then arm."
    now[0] = 2.01
    assert make_sentence(status).headline == f"THE HAMMER DOES NOT ANSWER: {SWITCH}"
    assert make_view(status).moment is None
    assert make_view(status).armed == "not known"


@pytest.mark.parametrize(
    ("heard", "headline"),
    [
        ((), f"THE HAMMER DOES NOT ANSWER: {SWITCH}"),
        (("hammer",), "THE RIG DOES NOT ANSWER"),
        (("hammer", "campaign"), "NO VERDICTS"),
        (("hammer", "campaign", "estimator"), "NOTHING IS RECORDED"),
        (("hammer", "campaign", "estimator", "recorder"), "THE SENSORS DO NOT ANSWER"),
        (("hammer", "campaign", "estimator", "recorder", "accelerometer"), "KEEP AWAY"),
    ],
)
def test_the_node_that_matters_most_is_told_of_first(heard, headline):
    status, now = make_aged_status(hammer={})
    now[0] = 10.0
    states = {"hammer": HammerStatus(), "campaign": RUNNING}
    for name in heard:
        if name in states:
            status.keep(states[name])
        else:
            hear(status, name)
    assert make_sentence(status).headline.startswith(headline)


def test_a_stop_that_is_not_confirmed_goes_before_a_verdict():
    status, now = make_aged_status(replace(RUNNING, state=Step.COUNTING), (GOOD,), hammer={})
    assert make_sentence(status).headline == "ACCEPTED"
    status.stop_asked_at = 0.0
    now[0] = UNCONFIRMED
    assert make_sentence(status).headline == "STOP SENT"
    now[0] = UNCONFIRMED + 0.01
    assert make_sentence(status).headline == f"STOP IS NOT CONFIRMED: {SWITCH}"


def test_after_a_stop_a_person_arms_first():
    status, _ = make_aged_status(CampaignStatus(), hammer={"disarmed_by": Disarming.PERSON})
    assert make_sentence(status).headline == "ARM FIRST"
    assert make_view(status).moment == Button("arm", "Arm")
    # What was reached stays in sight.
    status.keep(replace(RUNNING, state=Step.COMPLETE, impacts=3))
    assert make_sentence(status).headline == "DONE. ARM FIRST"
    status.keep(CampaignStatus())
    status.keep(HammerStatus(armed=True))
    assert make_sentence(status).headline == "READY"
    assert make_view(status).moment is None


def test_by_hand_the_hammer_is_back_before_it_is_let_go_again():
    by_hand = {"holder": IDENTITY, "state": HammerPlace.SWINGING, "armed": True}
    asked = replace(RUNNING, task=Task.LET_GO)
    found = {}
    for hit in (GOOD, BAD):
        status, now = make_aged_status(asked, (hit,), by_hand)
        moments = (0.0, CATCH - 0.01, CATCH, READ_REJECTION - 0.01, READ_REJECTION)
        for moment in (*moments, PULL_BACK - 0.01, PULL_BACK):
            now[0] = moment
            status.keep(HammerStatus(**by_hand))
            status.keep(asked)
            hear(status, "estimator", "recorder", "accelerometer")
            found[hit, moment] = make_sentence(status).headline
    pull = "PULL BACK and HOLD"
    rejected = "REJECTED: second contact"
    assert list(found.values()) == [
        *("CATCH", "CATCH", pull, pull, pull, pull, "RELEASE"),
        *(rejected, rejected, rejected, rejected, pull, pull, "RELEASE"),
    ]
    status.keep(replace(RUNNING, task=Task.NOTHING))
    assert make_sentence(status).headline == pull
    # Who has said that it is back holds it.
    status, now = make_aged_status(asked, (GOOD,), {**by_hand, "state": HammerPlace.AWAY})
    now[0] = 0.1
    status.keep(HammerStatus(**by_hand))
    assert make_sentence(status).headline == "RELEASE"


def test_what_nodes_say_is_told_without_names_of_options_and_services():
    assert say_plainly("not armed: call hammer/arm first") == "not armed"
    assert (
        say_plainly("wait for it, or go on with it (--resume)") == "wait for it, or go on with it"
    )
    assert say_plainly("the campaign node stood still") == "the campaign stood still"
    assert len(say_plainly("x" * 5000)) == 300


@pytest.mark.parametrize(
    ("changes", "hits", "lamps"),
    [
        ({}, (), []),
        ({}, (replace(GOOD, specimen_peak=900.0),), ["good", "good"]),
        ({}, (GOOD,), ["good", "quiet"]),
        ({"full_scales": (2000.0, 900.0)}, "overload", ["good", "overload"]),
        ({"full_scales": (660.0, 1002.0)}, "overload", ["overload", "good"]),
        ({"full_scales": (667.0, 1000.0)}, "overload", ["good", "overload"]),
        ({}, "overload", ["overload", "overload"]),
        ({"levels": InputLevels((InputLevel(noise=1.0, peak=20.0),))}, (), ["quiet"]),
        ({"levels": InputLevels((InputLevel(noise=1.0, peak=20.1),))}, (), ["good"]),
        ({"levels": InputLevels((InputLevel(overloaded=True),))}, (), ["overload"]),
    ],
)
def test_a_lamp_for_each_channel(changes, hits, lamps):
    if hits == "overload":
        reasons = (Finding(Reason.OVERLOAD, "at the rail"),)
        hits = (replace(GOOD, specimen_peak=900.0, accepted=False, reasons=reasons),)
    status = make_status(hits=hits)
    for name, value in changes.items():
        setattr(status, name, value)
    assert [state for _, state in make_view(status).lamps] == lamps


def test_the_time_left_is_that_of_the_pace_so_far():
    status, now = make_aged_status(hammer={})
    for number in range(3):
        now[0] = 30.0 * number
        status.add_hit(replace(GOOD, record=number + 1))
    assert make_view(status).time_left == "4 min left"  # 7 hits, 30 s each
    status.keep(replace(RUNNING, impacts=260))
    assert make_view(status).time_left == "2 h 09 min left"
    status.keep(replace(RUNNING, state=Step.ENDED))
    assert make_view(status).time_left == ""


def test_hits_are_listed_newest_first_and_deviate_from_the_others_of_their_sample():
    series = [replace(GOOD, record=n, contact_time=(170 + n % 2) * 1e-6) for n in range(1, 5)]
    odd = replace(GOOD, record=9, contact_time=175e-6)
    status = make_status(hits=(*series, odd))
    view = make_view(status)
    assert [hit.record for hit in view.hits] == [9, 4, 3, 2, 1]
    # 175 from the mean of 170.5, in scatters of 0.577.
    assert status.compute_deviation(odd) == pytest.approx(4.5 / 0.57735, rel=1e-3)
    assert ("off its series", "7.8 times its scatter") in view.numbers
    assert view.marks["steel small"] == ["accepted"] * 5 + [""] * 7


def test_strength_is_told_once_the_range_is_known():
    status = make_status(hits=(GOOD,))
    assert make_view(status).strength is None
    status.full_scales = (2000.0,)
    strength = make_view(status).strength
    assert strength == Strength(30, 0, 95, "good")
    assert status.list_levels() == (("largest peak", 1900.0),)
    analysis = replace(PAPER_SETUP.analysis, minimum_peak=0.15)
    status.setup = replace(PAPER_SETUP, analysis=analysis)
    assert make_view(status).strength == Strength(30, 15, 95, "good")
    assert status.list_levels() == (("least peak", 300.0), ("largest peak", 1900.0))


def test_a_hit_that_was_rejected_as_weak_is_called_weak():
    weak = Finding(Reason.WEAK, "swing higher")
    status = make_status(hits=(replace(GOOD, accepted=False, reasons=(weak,)),))
    status.full_scales = (2000.0,)
    assert make_view(status).strength == Strength(30, 0, 95, "weak")


def test_speed_and_momenta_are_those_of_two_free_bodies():
    hit = replace(GOOD, sample_mass=PAPER_SETUP.samples.get_moving_mass("steel small") / 0.98)
    status = make_status(hits=(hit,))
    m1, m2 = PAPER_SETUP.hammer_mass, PAPER_SETUP.samples.get_moving_mass("steel small")
    speed, e = 0.0819, 0.7
    # What the hammer loses, by the balance of momenta and e.
    status.speed_changes[1] = speed - (m1 - e * m2) * speed / (m1 + m2)
    numbers = dict(make_view(status).numbers)
    assert numbers["momenta"] == "0.980"
    assert "impact speed" not in numbers
    law = ContactLaw(restitution=Quantity(e, 0.01))
    status.estimates["steel small"] = SampleEstimate("steel small", 1, 0, contact_law=law)
    assert dict(make_view(status).numbers)["impact speed"] == "81.9 mm/s"
    # Measured is better than computed.
    status.add_hit(replace(hit, impact_speed=0.0815))
    assert dict(make_view(status).numbers)["impact speed"] == "81.5 mm/s"


def test_a_sample_of_another_mass_is_asked_about():
    stated = PAPER_SETUP.samples.get_moving_mass("steel small")
    hit = replace(GOOD, sample_mass=1.3 * stated)
    odd = replace(hit, findings=(Finding(Reason.OTHER_SAMPLE, "heavy"),))
    told = f"Mass by the traces {1300 * stated:.1f} g, stated {1000 * stated:.1f} g."
    views = [make_view(make_status(hits=(it,))) for it in (GOOD, hit, odd)]
    assert [view.mass for view in views] == ["", told, told]
    assert [view.mass_differs for view in views] == [False, False, True]


def test_the_monitor_holds_the_largest_peaks_and_suggests_by_them():
    status = make_status(replace(RUNNING, state=Step.ENDED))
    for peak in (5.0, 612.0, 6.0):
        status.keep(InputLevels((InputLevel(3.0, 1.5, peak, 2000.0), InputLevel(0.0, 1.5, 4.0))))
    view = make_view(status)
    hammer, sample = view.inputs
    assert hammer[3] == ["3.0 m/s²", "1.5 m/s²", "612.0 m/s²", "2000.0 m/s²", "1300.0 m/s²"]
    assert sample[3][3:] == ["-", "-"]
    assert (view.is_monitoring, view.trigger_level) == (True, "61.2 m/s²")
    # Ended, and what was seen stays; begun again, it is forgotten.
    status.keep(InputLevels())
    assert not make_view(status).is_monitoring
    assert make_view(status).trigger_level == "61.2 m/s²"
    status.keep(InputLevels((InputLevel(3.0, 1.5, 5.0, 2000.0),)))
    assert make_view(status).trigger_level == ""


@pytest.mark.parametrize(("hit", "told"), [(GOOD, "would have been accepted"), (BAD, "gently")])
def test_a_trial_hit_says_that_it_does_not_count_and_what_suits(hit, told):
    status = RigStatus(campaign=replace(RUNNING, state=Step.COMPLETE))
    status.begin(PAPER_SETUP, is_trial=True)
    status.add_hit(replace(hit, hammer_peak=600.0))
    sentence = make_sentence(status)
    assert (sentence.headline, told in sentence.detail) == ("TRIAL HIT", True)
    view = make_view(status)
    assert [texts[-1] for *_, texts in view.inputs] == ["1200.0 m/s²"]
    assert view.trigger_level == "60 m/s²"
