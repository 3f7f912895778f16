"""What a person sees of a campaign, on a terminal and in a log."""

import io
import math
import re
from types import SimpleNamespace

import pytest
from rich.cells import cell_len
from rich.console import Console

from impact_rig.cli.campaign import CampaignView

NO_HIT = SimpleNamespace(record=0)
GOOD = SimpleNamespace(
    record=1, sample="steel small", impact=1, attempt=1, accepted=True, reasons=[],
    contact_time=170.004e-6,
)  # fmt: skip
BAD = SimpleNamespace(
    record=2, sample="steel small", impact=2, attempt=1, accepted=False,
    reasons=["overload: 250 points in a row at the rail", "overload: 9 points", "weak: 3 %"],
    contact_time=math.nan,
)  # fmt: skip


def make_feedback(last, *, impact, rejected=0, sample="steel small", message=""):
    return SimpleNamespace(
        sample=sample, sample_number=1, sample_count=2, impact=impact, impacts=5, last=last,
        rejected=rejected, message=message,
    )  # fmt: skip


def follow(*feedbacks, width=100, is_terminal=True):
    """Return what was shown after each feedback; the bar is drawn by hand, not by the clock."""
    console = Console(
        file=io.StringIO(), width=width, force_terminal=is_terminal, color_system=None,
        markup=False, highlight=False, emoji=False,
    )  # fmt: skip
    shown = []
    with CampaignView(console) as view:
        for feedback in feedbacks:
            view.follow(feedback)
            if view.is_drawn:
                view._progress.refresh()
            shown.append(console.file.getvalue())
            console.file.truncate(0)
            console.file.seek(0)
    return shown


def test_the_bar_tells_place_verdict_and_rejections():
    first, second, third = follow(
        make_feedback(NO_HIT, impact=0),
        make_feedback(GOOD, impact=1),
        make_feedback(BAD, impact=1, rejected=1),
    )
    assert "steel small (1 of 2), hit 1 of 5" in first
    assert "0 of 10" in first
    assert "rejected" not in first
    assert "hit 2 of 5" in second
    assert "1 of 10, -:--:--" in second
    assert "last hit, 1.1: accepted, τp 170.00 µs" in second
    assert "1 of 10, 1 rejected" in third
    assert "last hit, 2.1: rejected, overload, weak" in third


def test_a_rejection_is_told_once_with_all_reasons_and_stays():
    texts = follow(
        make_feedback(GOOD, impact=1),
        make_feedback(BAD, impact=1, rejected=1),
        make_feedback(BAD, impact=1, rejected=1),
    )
    line = "steel small, hit 2.1 rejected: overload: 250 points in a row at the rail; overload: 9"
    assert [text.count(line) for text in texts] == [0, 1, 0]


def test_a_log_has_a_line_for_each_sample_and_each_rejection_and_nothing_else():
    texts = follow(
        make_feedback(NO_HIT, impact=0),
        make_feedback(GOOD, impact=1),
        make_feedback(BAD, impact=1, rejected=1),
        make_feedback(BAD, impact=0, rejected=1, sample="steel large"),
        width=1000,
        is_terminal=False,
    )
    assert "".join(texts).splitlines() == [
        "sample 1 of 2: steel small",
        f"steel small, hit 2.1 rejected: {'; '.join(BAD.reasons)}",
        "sample 1 of 2: steel large",
    ]


def test_a_pause_is_told_once_with_its_reason_and_so_is_its_end():
    stopped, gone = "emergency stop: call hammer/reset", "no answer"
    texts = follow(
        make_feedback(GOOD, impact=1),
        make_feedback(GOOD, impact=1, message=stopped),
        make_feedback(GOOD, impact=1, message=stopped),
        make_feedback(GOOD, impact=1, message=gone),
        make_feedback(GOOD, impact=1),
        width=1000,
        is_terminal=False,
    )
    assert "".join(texts).splitlines()[1:] == [
        f"paused: {stopped}",
        f"paused: {gone}",
        "it goes on",
    ]


@pytest.mark.parametrize("width", [60, 80])
def test_a_narrow_terminal_loses_no_figure(width):
    text = follow(make_feedback(BAD, impact=1, rejected=12), width=width)[0]
    assert "1 of 10, 12 rejected, -:--:--" in text
    lines = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", text).replace("\r", "\n").splitlines()
    assert max(map(cell_len, lines)) <= width


def test_the_end_of_the_hits_is_not_the_end_of_the_work():
    done = make_feedback(GOOD, impact=5)
    done.sample_number = 2
    assert "estimating" in follow(done)[0]
