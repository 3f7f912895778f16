"""What is varied, and how much of it."""

import math

import pytest

from impact_rig.core.errors import ParameterError
from impact_rig.study.cases import Case, Configuration, Part, find_case, list_cases
from impact_rig.study.run import plan_units
from impact_rig.study.selection import FAULTS


def test_the_full_study_is_as_large_as_its_goals_ask():
    full = Configuration()
    assert full.count_campaigns(Part.COVERAGE) == 2000
    # Each fault and the good hits in turn: so many show 99 %, and 0.2 %.
    assert full.count_campaigns(Part.SELECTION) / (len(FAULTS) + 1) >= 1000
    levels = [case.noise_of_peak for case in list_cases(Part.EFFICIENCY)]
    assert (min(levels), max(levels)) == (2e-4, 1e-2)


def test_the_bias_is_studied_along_every_axis():
    cases = list_cases(Part.BIAS)
    assert {case.axis for case in cases} == {
        "noise",
        "bits",
        "sampling rate",
        "damping ratio",
        "pulse shape",
        "contact law",
        "read as a law",
    }
    ratios = [case.damping_ratio for case in cases if not math.isnan(case.damping_ratio)]
    assert max(ratios) == 0.7


def test_every_case_has_a_key_of_its_own():
    cases: list[Case] = [case for part in Part for case in list_cases(part)]
    assert len({case.key for case in cases}) == len(cases)
    assert all(find_case(case.key) == case for case in cases)
    with pytest.raises(ParameterError, match="unknown case 'bias/colour/red'"):
        find_case("bias/colour/red")


@pytest.mark.parametrize("campaigns", [1, 7, 2000])
def test_units_hold_every_campaign_once(campaigns):
    configuration = Configuration(campaigns=campaigns)
    found: dict[str, list[int]] = {}
    for unit in plan_units(configuration):
        found.setdefault(unit.key, []).extend(range(unit.first, unit.first + unit.count))
    for unit in plan_units(configuration):
        assert found[unit.key] == list(range(configuration.count_campaigns(unit.part)))


def test_parts_have_one_order():
    assert Configuration((Part.SELECTION, Part.BIAS)) == Configuration((Part.BIAS, Part.SELECTION))


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"parts": ()}, "has no part"),
        ({"campaigns": 0}, "number of campaigns is 0"),
        ({"seed": -1}, "seed is -1"),
    ],
)
def test_a_study_of_nothing_is_refused(values, words):
    with pytest.raises(ParameterError, match=words):
        Configuration(**values)
