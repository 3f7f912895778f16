"""Faults found by their size, good hits kept: what is counted, and that a failure would be."""

import pytest

from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.hits.reasons import Reason, Rejection
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.signals.record import HitLabel
from impact_rig.study.selection import (
    ASKED,
    CABLE,
    CLIPPED,
    DROPOUT,
    FAULTS,
    SERIES_HITS,
    STEP,
    SelectionCount,
    count_faulty,
    count_good,
    simulate_series,
)

SAMPLES = len(PAPER_SETUP.samples.names)


def judge(rejected=(), corrected=()):
    against, findings = (
        tuple(Rejection(reason, "in words") for reason in reasons)
        for reasons in (rejected, corrected)
    )
    return JudgedHit(HitLabel("steel"), against, findings=findings)


def test_a_fault_counts_as_found_for_the_right_reason_only():
    small, medium, large = (STEP.name(size) for size in STEP.sizes[:3])
    count = count_faulty(
        STEP,
        {
            small: judge(rejected=(Reason.DOUBLE_HIT,)),
            medium: judge(corrected=(Reason.ZERO_SHIFT,)),
            large: judge(rejected=(Reason.ZERO_SHIFT, Reason.DOUBLE_HIT)),
        },
    )
    assert count.faulty == {small: 1, medium: 1, large: 1}
    assert count.detected == {small: 0, medium: 1, large: 1}


def test_a_good_hit_that_is_left_out_is_counted_with_its_reason():
    count = count_good(10, (judge(rejected=(Reason.INCONSISTENT, Reason.DOUBLE_HIT)),))
    assert (count.good, count.good_rejected) == (10, 1)
    assert count.false_reasons == {"inconsistent": 1, "double_hit": 1}


def test_counts_add_up_and_survive_json():
    first = SelectionCount(5, 1, {"one": 2}, {"one": 2}, {"weak": 1})
    second = SelectionCount(7, 0, {"one": 1, "other": 4}, {"one": 0, "other": 3}, {})
    total = first + SelectionCount(**second.to_json())
    assert total == SelectionCount(
        12, 1, {"one": 3, "other": 4}, {"one": 2, "other": 3}, {"weak": 1}
    )


def test_every_fault_is_asked_for_from_a_size_on_and_tried_below_it():
    for fault in FAULTS:
        asked = [fault.name(size) in ASKED for size in fault.sizes]
        assert asked == sorted(asked)
        assert any(asked) is (fault is not CABLE)
    assert CLIPPED.name(99.0) not in ASKED
    assert {DROPOUT.name(10.0), DROPOUT.name(50.0)} < ASKED


@pytest.mark.parametrize("number", range(len(FAULTS) + 1))
def test_what_is_asked_for_is_found_and_good_hits_stay(number):
    found = sum(
        (simulate_series(PAPER_SETUP, (2,), number * SAMPLES + i) for i in range(3)),
        SelectionCount(),
    )
    asked = ASKED & set(found.faulty)
    # A step of some sizes goes as a droop of that size would.
    assert all(found.detected[name] >= 2 for name in asked)
    assert found.good_rejected == 0
    is_good = number == len(FAULTS)
    assert found.good == (3 * SERIES_HITS if is_good else 0)
    assert list(found.faulty) == (
        [] if is_good else [FAULTS[number].name(size) for size in FAULTS[number].sizes]
    )
