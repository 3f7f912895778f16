"""Simulated campaigns and faults: errors within their intervals, faults rightly named."""

import numpy as np
import pytest

from impact_rig.core.given.setup import PAPER_SETUP
from study.campaigns import ASKED, run_campaign
from study.laboratories import Cause, draw_laboratory, judge, judge_all
from study.selection import FAULTS, SURE, strike_fault, strike_good_hits


@pytest.mark.parametrize("plant", ASKED)
def test_errors_are_as_large_as_they_are_said_to_be(plant):
    outcomes = run_campaign(plant, PAPER_SETUP, 1, 4)
    assert tuple(outcome.asked for outcome in outcomes) == ASKED[plant]
    for outcome in outcomes:
        assert abs(outcome.error) < 2.5 * outcome.half_width
    assert run_campaign(plant, PAPER_SETUP, 1, 4) == outcomes
    assert run_campaign(plant, PAPER_SETUP, 2, 4) != outcomes


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.reason.value)
def test_a_fault_is_found_from_its_size_on(fault):
    found = [strike_fault(fault, 2, number) for number in range(3)]
    for size in fault.sizes:
        name = fault.name(size)
        # A step of some sizes goes as a droop of that size would.
        assert name not in SURE or sum(series[name] for series in found) >= 2


def test_good_hits_stay():
    assert sum(strike_good_hits(2, number) for number in range(3)) == 0


def test_no_cause_makes_a_wrong_number_with_nothing_said():
    causes = (Cause.GAIN, Cause.RINGING, Cause.FRICTION, Cause.SERIES)
    verdicts = list(judge_all(4, 3, causes))
    assert [item.cause for item in verdicts] == list(causes)
    assert all(item.given for item in verdicts)
    assert [item.cause for item in verdicts if item.is_silent] == []


@pytest.mark.parametrize(
    ("cause", "number", "named"),
    [
        # The foot of the contact is no part of the free decay.
        (Cause.RINGING, 34, set()),
        # A ringing of which half a period is a part of the tail is no droop, and a law of free
        # bodies tells nothing of one that is held.
        (Cause.RINGING, 50, set()),
        # A window of an analyser, behind what the low-pass makes of a record's end.
        (Cause.FRICTION, 115, {"checks.impulse", "checks.traced_mass"}),
        # Losses of two forms of which the law knows one.
        (Cause.GAIN, 65, {"contact_law.restitution", "contact_law.exponent"}),
    ],
)
def test_a_series_whose_number_was_wrong_once(cause, number, named):
    verdict = judge(cause, draw_laboratory(cause, np.random.default_rng((1, number))))
    assert set(verdict.wrong) == named
    assert not verdict.is_silent
