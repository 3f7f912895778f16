"""What a person sees of a campaign, in a log; `test_progress.py` has the bar."""

import math

from impact_rig_msgs.msg import CampaignState, Impact, SampleCount

from impact_rig.cli.campaign import CampaignView

NO_HIT = Impact()
GOOD = Impact(
    record=1, sample="steel small", impact=1, attempt=1, accepted=True, reasons=[],
    contact_time=170.004e-6,
)  # fmt: skip
BAD = Impact(
    record=2, sample="steel small", impact=2, attempt=1, accepted=False,
    reasons=["overload: 250 points in a row at the rail", "weak: 3 %"], contact_time=math.nan,
)  # fmt: skip


def make_feedback(last, *, impact, rejected=0, sample="steel small", message=""):
    counts = [SampleCount(sample=name) for name in ("steel small", "steel large")]
    counts[0].rejected = rejected
    return CampaignState(
        sample=sample, impact=impact, impacts=5, last=last, counts=counts, message=message
    )


def test_a_log_has_a_line_for_each_sample_each_rejection_and_each_pause(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    stopped, gone = "emergency stop: call hammer/reset", "no answer"
    with CampaignView() as view:
        for feedback in (
            make_feedback(NO_HIT, impact=0),
            make_feedback(GOOD, impact=1),
            make_feedback(BAD, impact=1, rejected=1),
            make_feedback(BAD, impact=1, rejected=1, message=stopped),
            make_feedback(BAD, impact=1, rejected=1, message=stopped),
            make_feedback(BAD, impact=1, rejected=1, message=gone),
            make_feedback(BAD, impact=1, rejected=1),
            make_feedback(BAD, impact=0, rejected=1, sample="steel large"),
        ):
            view.follow(feedback)
    assert capsys.readouterr().err.splitlines() == [
        "sample 1 of 2: steel small",
        f"steel small, hit 2.1 rejected: {'; '.join(BAD.reasons)}",
        f"paused: {stopped}",
        f"paused: {gone}",
        "the campaign goes on",
        "sample 2 of 2: steel large",
    ]


def test_who_holds_the_hammer_by_hand_reads_a_stop(capsys):
    with CampaignView() as view:
        view.let_go("steel small", 60.0)
        view.hold_back("emergency stop")
    assert capsys.readouterr().err.splitlines() == [
        "Release the hammer on steel small, within 60 s",
        "STOP: do not release the hammer: emergency stop",
    ]
