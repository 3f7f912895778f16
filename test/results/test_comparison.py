"""What changed between two runs: against arithmetic done by hand."""

import math

import pytest

from impact_rig.core.paper_method import HammerEstimate
from impact_rig.core.quantity import Quantity
from impact_rig.core.sample import SampleEstimate
from impact_rig.core.setup import RigSetup, Sample, SampleSet
from impact_rig.results.campaign import Results
from impact_rig.results.comparison import CONTACT_TIME, HAMMER_NAME, STIFFNESS, compare_runs

SETUP = RigSetup(SampleSet((Sample("disc", 0.2),), ""), hammer_mass=0.1, impact_speed=0.08)


def make_run(contact_time: float, expanded: float, name: str = "disc") -> Results:
    known = Quantity(contact_time, expanded / 2.0, expanded)
    return Results(SETUP, HammerEstimate(), (SampleEstimate(name, 3, 0, known),), ())


def test_a_difference_is_held_against_the_root_of_the_summed_squares():
    (change,) = compare_runs(make_run(200e-6, 3e-6), make_run(206e-6, 4e-6))
    assert (change.body, change.quantity) == ("disc", CONTACT_TIME)
    assert change.difference.value == pytest.approx(6e-6)
    assert change.difference.expanded == pytest.approx(5e-6)  # 3, 4, 5
    assert change.normalised_error == pytest.approx(1.2)
    assert change.is_beyond_uncertainty


@pytest.mark.parametrize(("later", "beyond"), [(-204.9e-6, True), (195.1e-6, False)])
def test_a_change_counts_in_either_direction_once_it_is_larger_than_its_uncertainty(later, beyond):
    (found,) = compare_runs(make_run(200e-6, 3e-6), make_run(later, 4e-6))
    assert found.is_beyond_uncertainty is beyond


@pytest.mark.parametrize("expanded", [math.nan, 0.0])
def test_without_an_uncertainty_nothing_is_said_of_a_change(expanded):
    (found,) = compare_runs(make_run(200e-6, expanded), make_run(300e-6, expanded))
    assert math.isnan(found.normalised_error)
    assert not found.is_beyond_uncertainty


def test_what_only_one_run_determined_is_not_compared():
    assert compare_runs(make_run(200e-6, 1e-6), make_run(math.nan, math.nan)) == ()
    assert compare_runs(make_run(200e-6, 1e-6), make_run(1e-4, 1e-6, name="rod")) == ()


def test_the_hammer_is_compared_as_well(results):
    compared = compare_runs(results, results)
    assert len(compared) == 12 * 3 + 2
    assert [item.body for item in compared[-2:]] == [HAMMER_NAME] * 2
    assert compared[-2].quantity is STIFFNESS
    assert compared[-2].difference.value == 0.0
