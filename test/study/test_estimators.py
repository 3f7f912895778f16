"""Every estimate stands beside its truth; what is not determined says so."""

import math
from dataclasses import replace

import pytest

from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.study.campaigns import CampaignSource
from impact_rig.study.cases import ESTIMATORS, FREE_DECAY, IDENTIFICATION, PAPER, Part, list_cases
from impact_rig.study.estimators import ESTIMATED, evaluate

PUBLISHED, DYNAMICS = list_cases(Part.COVERAGE)


def evaluate_one(case, number=4):
    outcomes = evaluate(CampaignSource(case, PAPER_SETUP, (1,)).run(number))
    return {(outcome.estimator, outcome.quantity): outcome for outcome in outcomes}


@pytest.fixture(scope="module")
def dynamics():
    return evaluate_one(DYNAMICS)


def test_every_estimator_is_asked_for_all_it_determines(dynamics):
    assert set(dynamics) == {
        (name, quantity) for name in ESTIMATORS for quantity in ESTIMATED[name]
    }
    assert {name for name, _ in evaluate_one(PUBLISHED)} == {PAPER, FREE_DECAY}


def test_errors_are_relative_to_the_truth_and_as_large_as_they_are_said_to_be(dynamics):
    for (estimator, quantity), outcome in dynamics.items():
        assert outcome.half_width > 0
        if estimator == PAPER and quantity.startswith("damping"):
            # Its first peak lies in the contact: on this plant it is some 9 % low.
            assert -0.2 < outcome.error < -0.03
        else:
            assert abs(outcome.error) < 2.5 * outcome.half_width < 0.1


def test_bounds_are_there_for_what_the_model_has(dynamics):
    assert math.isnan(dynamics[PAPER, "stiffness"].bound)
    for quantity in ESTIMATED[IDENTIFICATION]:
        assert 0 < dynamics[IDENTIFICATION, quantity].bound < 0.01


def test_one_hit_has_a_value_and_no_interval():
    found = evaluate_one(list_cases(Part.EFFICIENCY)[0])
    assert all(math.isnan(outcome.half_width) for outcome in found.values())
    assert abs(found[IDENTIFICATION, "stiffness"].error) < 1e-3
    # Without the control sample there is no k1.
    assert (PAPER, "stiffness") not in found
    assert abs(found[PAPER, "contact_time"].error) < 1e-3


def test_what_an_estimator_refuses_is_not_determined():
    critical = replace(DYNAMICS, damping_ratio=0.97, estimators=(FREE_DECAY,))
    for outcome in evaluate_one(critical).values():
        assert math.isnan(outcome.error)
        assert math.isnan(outcome.half_width)
