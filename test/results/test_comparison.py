"""What changed between runs: against arithmetic done by hand, and against drawn measurements."""

import math
from dataclasses import replace

import pytest

from impact_rig.core.estimation.paper_method import HammerEstimate
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.quantity import Quantity
from impact_rig.core.setup.samples import RigSetup, Sample, SampleSet
from impact_rig.core.setup.sensors import Sensor
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.results.campaign import Results
from impact_rig.results.comparison import (
    CONTACT_TIME,
    HAMMER_NAME,
    STIFFNESS,
    Change,
    ComparedQuantity,
    compare_runs,
    find_setup_differences,
)

SETUP = RigSetup(SampleSet((Sample("disc", 0.2),), ""), hammer_mass=0.1, impact_speed=0.08)


def make_run(contact_time: float, expanded: float, name: str = "disc") -> Results:
    known = Quantity(contact_time, expanded / 2.0, expanded)
    return Results(SETUP, HammerEstimate(), (SampleEstimate(name, 3, 0, known),), ())


def find(compared: tuple[ComparedQuantity, ...], body: str, symbol: str) -> ComparedQuantity:
    return next(x for x in compared if x.body == body and x.quantity.symbol == symbol)


def test_a_difference_is_held_against_the_root_of_the_summed_squares():
    first, later = make_run(200e-6, 3e-6), make_run(206e-6, 4e-6)
    (found,) = compare_runs([first, later])
    (change,) = found.changes
    assert found.body == "disc"
    assert found.quantity is CONTACT_TIME
    assert change.difference == pytest.approx(6e-6)
    assert change.expanded == pytest.approx(5e-6)  # 3, 4, 5
    assert change.normalised_error == pytest.approx(1.2)
    assert change.is_beyond_uncertainty


@pytest.mark.parametrize(("later", "beyond"), [(-204.9e-6, True), (195.1e-6, False)])
def test_a_change_counts_in_either_direction_once_it_is_larger_than_its_uncertainty(later, beyond):
    (found,) = compare_runs([make_run(200e-6, 3e-6), make_run(later, 4e-6)])
    assert found.changes[0].is_beyond_uncertainty is beyond


def test_without_an_uncertainty_nothing_is_said_of_a_change():
    for expanded in (math.nan, 0.0):
        change = Change(1.0, expanded)
        assert math.isnan(change.normalised_error)
        assert not change.is_beyond_uncertainty


def test_what_only_one_run_determined_is_not_compared():
    assert compare_runs([make_run(200e-6, 1e-6), make_run(math.nan, math.nan)]) == ()
    assert compare_runs([make_run(200e-6, 1e-6), make_run(1e-4, 1e-6, name="rod")]) == ()


def test_a_run_that_lacks_a_sample_leaves_a_hole():
    runs = [make_run(1e-4, 1e-6), make_run(1e-4, 1e-6, name="rod"), make_run(2e-4, 1e-6)]
    (found,) = compare_runs(runs)
    assert found.body == "disc"
    assert math.isnan(found.found[1].value)
    assert not found.changes[0].is_beyond_uncertainty
    assert found.changes[1].is_beyond_uncertainty


def test_the_hammer_is_compared_as_well(results):
    compared = compare_runs([results, results])
    assert find(compared, HAMMER_NAME, STIFFNESS.symbol).changes[0].difference == 0.0
    assert len(compared) == 12 * 3 + 2


def test_differing_masses_and_settings_are_named_with_their_values():
    run = make_run(1e-4, 1e-6)
    other = replace(
        run,
        setup=replace(
            SETUP,
            name="another name alone is no difference",
            samples=SampleSet((Sample("disc", 0.3), Sample("rod", math.nan)), ""),
            sensors=(Sensor("hammer", "force", "N", 2e-3),),
            analysis=AnalysisSettings(cutoff_frequency=30e3),
        ),
    )
    found = {
        (item.sample, item.field): item.values for item in find_setup_differences([run, other])
    }
    assert found["", "cutoff_frequency"] == (50e3, 30e3)
    assert found["disc", "mass"] == (0.2, 0.3)
    assert found["rod", "material"] == (None, "")
    assert found["hammer sensor", "sensitivity"] == (None, 2e-3)
    assert ("", "name") not in found
    assert ("", "hammer_mass") not in found
