"""Two methods on one quantity: the interval of the result holds both, or one of them leads."""

import math
from dataclasses import replace

import pytest

from impact_rig.core.estimates.paper_method import PaperEstimate
from impact_rig.core.estimates.ringing import NO_DECAY, FreeDecayEstimate, reach, settle_damping
from impact_rig.core.given.quantity import UNKNOWN, BudgetLine, Quantity

C = Quantity(482.0, 3.0, 6.0, degrees_of_freedom=20.0, budget=(BudgetLine("mass", "B", 3.0, 1.0),))
PAPER = PaperEstimate(
    damping_ratio=Quantity(0.18, 0.001, 0.002),
    damping_coefficient=C,
    damping_method="log decrement",
    first_peak_time=0.0,
    second_peak_time=200e-6,
)
DECAY = FreeDecayEstimate(
    damping_ratio=Quantity(0.21, 0.001, 0.002),
    damping_coefficient=Quantity(560.0, 3.0, 6.0),
    frequency=4.7e3,
    r_squared=0.9999,
)


def test_an_interval_reaches_the_far_end_of_what_contradicts_it():
    found = reach(C, DECAY.damping_coefficient, "method")
    assert (found.value, found.lower, found.upper) == (482.0, 476.0, 566.0)
    # By hand: a rectangle from 482 to 560.
    assert found.standard == pytest.approx(math.hypot(3.0, 78.0 / math.sqrt(3.0)))
    assert [line.source for line in found.budget] == ["method", "mass"]
    assert sum(line.share for line in found.budget) == pytest.approx(1.0)
    below = reach(DECAY.damping_coefficient, C, "method")
    assert (below.lower, below.upper, below.is_even) == (476.0, 566.0, False)


@pytest.mark.parametrize(("other", "is_beyond"), [(493.9, False), (494.1, True)])
def test_it_reaches_only_what_lies_beyond_both_intervals(other, is_beyond):
    assert (reach(C, Quantity(other, 3.0, 6.0), "method") != C) is is_beyond
    # Without a ± of either nothing contradicts.
    assert reach(C, Quantity(other), "method") == C


def test_the_log_decrement_stays_and_the_free_decay_leads_where_it_is_alone():
    both = settle_damping(PAPER, DECAY)
    assert (both.damping_method, both.damping_coefficient.upper) == ("log decrement", 566.0)
    assert both.damping_ratio.upper == pytest.approx(0.212)
    alone = settle_damping(PAPER.without_damping(), DECAY)
    assert (alone.damping_method, alone.damping_coefficient.value) == ("free decay", 560.0)
    assert settle_damping(PAPER, NO_DECAY) == PAPER
    # Without k of the paper's method c is by the free decay, and ζ with it.
    bare = settle_damping(replace(PAPER, damping_coefficient=UNKNOWN), DECAY)
    assert (bare.damping_method, bare.damping_ratio.value) == ("free decay", 0.21)
    # What is on no spring has no c that could lead.
    free = replace(DECAY, damping_coefficient=UNKNOWN)
    assert settle_damping(PAPER.without_damping(), free).damping_method == ""


def test_without_a_mass_zeta_reaches_what_the_free_decay_says():
    found = settle_damping(
        replace(PAPER, damping_coefficient=UNKNOWN), replace(DECAY, damping_coefficient=UNKNOWN)
    )
    assert (found.damping_method, found.damping_ratio.value) == ("log decrement", 0.18)
    assert found.damping_ratio.upper == pytest.approx(0.212)


@pytest.mark.parametrize(
    ("period", "is_one"), [(0.76, True), (0.74, False), (1.24, True), (1.26, False), (41.0, False)]
)
def test_equation_7b_holds_of_peaks_one_period_apart(period, is_one):
    lone = replace(DECAY, damping_coefficient=UNKNOWN, frequency=period / 200e-6)
    found = settle_damping(PAPER, lone)
    assert found.damping_ratio.is_known is is_one
    if not is_one:
        (note,) = found.notes
        assert f"{period:.2g} periods of the free decay apart" in note.explanation


def test_equation_7b_does_not_hold_of_several_modes():
    many = FreeDecayEstimate(r_squared=0.38)
    found = settle_damping(PAPER, many)
    assert not found.damping_coefficient.is_known
    assert "explains only 38 % of the tail" in found.notes[0].explanation
    assert settle_damping(PAPER, FreeDecayEstimate(r_squared=0.99)) == PAPER
