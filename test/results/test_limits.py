"""Statements of conformity: a value passes or fails with its whole interval."""

import math
from dataclasses import replace

import pytest

from impact_rig.core.estimates.paper_method import HammerEstimate, PaperEstimate
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.quantity import UNKNOWN, Conformity, Quantity
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.results.campaign import Results
from impact_rig.results.numbers import CONTACT_TIME
from impact_rig.results.references import JudgedValue, judge_values, tabulate_conformity

PASSED, FAILED, UNDECIDED = Conformity


@pytest.mark.parametrize(
    ("value", "low", "high", "stated"),
    [
        (100.0, 99.0, 101.0, PASSED),  # the interval's ends lie on the limits
        (100.0, 99.1, 110.0, UNDECIDED),
        (100.0, 90.0, 100.9, UNDECIDED),
        (100.0, 101.1, 110.0, FAILED),
        (100.0, 90.0, 98.9, FAILED),
        (100.0, 99.5, 100.5, UNDECIDED),  # U is too large for such limits
        (100.0, -math.inf, 101.0, PASSED),
        (100.0, 102.0, math.inf, FAILED),
        (math.nan, 90.0, 110.0, UNDECIDED),
    ],
)
def test_the_guard_band_is_the_expanded_uncertainty(value, low, high, stated):
    found = Quantity(value, 0.5, 1.0) if math.isfinite(value) else UNKNOWN
    judged = JudgedValue("oak", CONTACT_TIME, found, low, high)
    assert judged.conformity is stated
    # How few hits scatter is hardly known, and so not in the guard band.
    assert replace(judged, has_scatter=False).conformity is UNDECIDED


def test_what_no_limit_decides_has_its_reason():
    judged = JudgedValue("oak", CONTACT_TIME, Quantity(100.0, 0.5, 1.0), 90.0, 110.0)
    for changes, statement in (
        ({}, "passed"),
        ({"has_scatter": False}, "undecided: fewer than 4 hits"),
        ({"found": UNKNOWN}, "undecided: not determined"),
    ):
        assert replace(judged, **changes).statement == statement


def test_series_of_all_release_angles_have_the_limits_of_their_sample():
    setup = PAPER_SETUP.at_angles([0.1, 0.2])
    paper = PaperEstimate(
        contact_time=Quantity(170e-6, 1e-7, 2e-7), stiffness=Quantity(3e7, 1e5, 2e5)
    )
    names = setup.samples.find_series(["steel small", "brass small"])
    samples = tuple(SampleEstimate(name, 4, 0, paper=paper) for name in names)
    results = Results(setup, HammerEstimate(), samples, ())
    limits = {"steel small": {"contact_time": (160e-6, 169e-6), "stiffness": (2e7, math.inf)}}
    judged = judge_values(results, limits)
    assert [item.sample for item in judged] == [names[0], names[0], names[1], names[1]]
    (table,) = tabulate_conformity(judged)
    assert table.rows[0][:3] == (names[0], "τp [µs]", "versed-sine")
    assert table.rows[0][3:] == ("160.00", "170.00 ± 0.20", "169.00", "failed")
    assert table.rows[1][-2:] == ("-", "passed")
    assert table.marked == {0, 2}
    assert "ILAC-G8" in table.notes[0]
    assert tabulate_conformity(judge_values(replace(results, samples=()), limits)) == []
