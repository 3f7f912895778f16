"""Faults of sensors and converters are found from their size on, good hits stay."""

import pytest

from impact_rig.core.setup import PAPER_SETUP
from study.selection import FAULTS, SURE, strike_fault, strike_good_hits


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.reason.value)
def test_a_fault_is_found_from_its_size_on(fault):
    found = [strike_fault(PAPER_SETUP, fault, 2, number) for number in range(3)]
    for size in fault.sizes:
        name = fault.name(size)
        # A step of some sizes goes as a droop of that size would.
        assert name not in SURE or sum(series[name] for series in found) >= 2


def test_faults_below_that_size_are_tried_and_some_are_missed():
    for fault in FAULTS:
        sure = [fault.name(size) in SURE for size in fault.sizes]
        assert sure == sorted(sure)
    small = strike_fault(PAPER_SETUP, FAULTS[0], 2, 0)
    assert not small["second contact of 1.5 %"]


def test_good_hits_stay():
    assert sum(strike_good_hits(PAPER_SETUP, 2, number) for number in range(3)) == 0
