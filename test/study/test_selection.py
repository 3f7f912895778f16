"""Faults found, good hits kept: what is counted, and that a failure would be."""

from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.hits.reasons import Reason, Rejection
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.choices import Fault
from impact_rig.devices.virtual.rig import ScheduledFault
from impact_rig.study.selection import (
    RIGHT_REASONS,
    SERIES_HITS,
    SelectionCount,
    count_verdicts,
    simulate_series,
)


def reject(impact, *reasons):
    found = tuple(Rejection(reason, "in words") for reason in reasons)
    return JudgedHit(HitLabel("steel", impact, impact), found)


def test_every_fault_has_its_right_reason():
    assert set(RIGHT_REASONS) == set(Fault)


def test_a_fault_counts_as_found_for_the_right_reason_only():
    scheduled = (
        ScheduledFault(Fault.OVERLOAD, 1),
        ScheduledFault(Fault.OVERLOAD, 2),
        ScheduledFault(Fault.OVERLOAD, 3),
    )
    rejected = (reject(1, Reason.OVERLOAD, Reason.DOUBLE_HIT), reject(2, Reason.DOUBLE_HIT))
    count = count_verdicts(scheduled, rejected)
    assert count.faulty == {"overload": 3}
    assert count.detected == {"overload": 1}


def test_a_good_hit_that_is_left_out_is_counted_with_its_reason():
    count = count_verdicts((), (reject(5, Reason.INCONSISTENT, Reason.DOUBLE_HIT),))
    assert (count.good, count.good_rejected) == (SERIES_HITS, 1)
    assert count.false_reasons == {"inconsistent": 1, "double_hit": 1}


def test_counts_add_up_and_survive_json():
    first = SelectionCount(5, 1, {"overload": 2}, {"overload": 2}, {"weak": 1})
    second = SelectionCount(7, 0, {"overload": 1, "weak_hit": 4}, {"weak_hit": 3}, {})
    total = first + SelectionCount(**second.to_json())
    assert total == SelectionCount(
        12, 1, {"overload": 3, "weak_hit": 4}, {"overload": 2, "weak_hit": 3}, {"weak": 1}
    )
    assert total.hits == 19


def test_a_series_is_its_number():
    assert simulate_series(PAPER_SETUP, (1,), 3) == simulate_series(PAPER_SETUP, (1,), 3)


def test_the_rig_finds_what_is_wrong():
    total = sum(
        (simulate_series(PAPER_SETUP, (1,), number) for number in range(24)), SelectionCount()
    )
    assert total.hits == 24 * SERIES_HITS
    assert set(total.faulty) == {fault.value for fault in Fault}
    # Of 288 hits 58 are expected to have a fault, give or take four times 7.
    assert 30 < sum(total.faulty.values()) < 86
    assert total.detected == total.faulty
    assert total.good_rejected == 0
