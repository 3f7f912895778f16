"""What a person sees of a campaign, in a log; `test_progress.py` has the bar."""

import math

from impact_rig.cli.campaign import CampaignView
from impact_rig.core.given.findings import Finding, Reason
from impact_rig.results.campaign import HitResults
from impact_rig.status.rig_status import RigStatus
from impact_rig.status.states import CampaignStatus, SampleProgress, Step


def make_good(impact, contact_time):
    return HitResults(
        record=impact, sample="steel small", impact=impact, attempt=1, accepted=True,
        reasons=(), contact_time=contact_time, hammer_peak=1234.56, specimen_peak=600.0,
    )  # fmt: skip


REASONS = (
    Finding(Reason.OVERLOAD, "250 points in a row at the rail"),
    Finding(Reason.WEAK, "3 %"),
)
BAD = HitResults(
    record=2, sample="steel small", impact=2, attempt=1, accepted=False,
    reasons=REASONS, contact_time=math.nan,
    hammer_peak=math.nan, specimen_peak=math.nan,
)  # fmt: skip


def make_campaign(step, *, accepted=0, rejected=0, sample="steel small", message=""):
    progress = SampleProgress("steel small", accepted, rejected), SampleProgress("steel large")
    return CampaignStatus(step, message, impacts=5, counts=progress, sample=sample)


def follow(view, rig, *campaigns):
    for rig.campaign in campaigns:
        view.follow(rig)


def test_a_log_has_a_line_for_each_sample_each_hit_and_each_pause(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    stopped, gone = "emergency stop: reset it", "no answer"
    rig = RigStatus()
    with CampaignView() as view:
        follow(view, rig, make_campaign(Step.JOINING))
        rig.add_hit(make_good(1, 170.004e-6))
        follow(view, rig, make_campaign(Step.COUNTING, accepted=1))
        rig.add_hit(BAD)
        for step, message in (
            (Step.COUNTING, ""), (Step.PAUSED, stopped), (Step.JOINING, stopped),
            (Step.PAUSED, stopped), (Step.PAUSED, gone), (Step.JOINING, gone),
            (Step.STRIKING, gone), (Step.COUNTING, ""),
        ):  # fmt: skip
            follow(view, rig, make_campaign(step, accepted=1, rejected=1, message=message))
        follow(
            view, rig, make_campaign(Step.COUNTING, accepted=5, rejected=1, sample="steel large")
        )
    assert capsys.readouterr().err.splitlines() == [
        "sample 1 of 2: steel small",
        "steel small, hit 1.1 accepted: hammer 1234.6 m/s², sample 600.0 m/s², τp 170.00 µs",
        "steel small, hit 2.1 rejected: overload: 250 points in a row at the rail; weak: 3 %",
        f"paused: {stopped}",
        f"paused: {gone}",
        "the campaign goes on",
        "sample 2 of 2: steel large",
    ]


def test_a_good_hit_says_how_far_it_lies_from_the_others_of_its_sample(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    rig = RigStatus()
    for impact, contact_time in enumerate((169e-6, 170e-6, 171e-6), start=1):
        rig.add_hit(make_good(impact, contact_time))
    rig.add_hit(make_good(4, 172e-6))
    with CampaignView() as view:
        follow(view, rig, make_campaign(Step.COUNTING, accepted=4))
    assert "τp 172.00 µs, off its series 2.0 times its scatter" in capsys.readouterr().err


def test_who_holds_the_hammer_by_hand_reads_a_stop(capsys):
    with CampaignView() as view:
        view.let_go("steel small", 60.0)
        view.hold_back("emergency stop")
    assert capsys.readouterr().err.splitlines() == [
        "Release the hammer on steel small, within 60 s",
        "STOP: do not release the hammer: emergency stop",
    ]
