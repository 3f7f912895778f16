"""A sensitivity comes with an uncertainty that holds what it promises."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.calibration.sensitivity import CalibrationMethod, estimate_sensitivity
from impact_rig.core.calibration.trace_fit import HitFit, TraceFit
from impact_rig.core.errors import NotDeterminedError, ParameterError
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.setup.sensors import Sensor
from impact_rig.core.signals.record import HitLabel

FORCE = Sensor("hammer", "force", "N", 2.25e-3)
HAMMER = Sensor("hammer", "acceleration", "g", -0.01)
SPECIMEN = Sensor("specimen", "acceleration", "g", 0.01)
MASSES = replace(PAPER_SETUP, hammer_mass=0.1, hammer_mass_uncertainty=0.001)


def make_fits(*ratios, misfit=0.0):
    return [
        HitFit(HitLabel("block", number), 0, TraceFit(ratio, misfit, misfit))
        for number, ratio in enumerate(ratios, start=1)
    ]


def find_contributions(calibration):
    return {line.source: line.contribution for line in calibration.uncertainty.budget}


def test_the_new_sensitivity_is_the_old_one_times_the_ratio():
    found = estimate_sensitivity(
        make_fits(1.01, 1.02, 1.03), CalibrationMethod("hammer"), MASSES, HAMMER
    )
    assert found.ratio == pytest.approx(1.02)
    assert found.sensitivity == pytest.approx(-0.0102)
    assert found.hits == 3
    assert not found.is_reversed
    # Student's t of two degrees of freedom: 4.303; of three hits s / sqrt(3).
    assert find_contributions(found) == {"scatter of the hits": pytest.approx(0.01 / math.sqrt(3))}
    assert found.uncertainty.expanded == pytest.approx(4.303 * 0.01 / math.sqrt(3), rel=1e-3)


def test_sensors_that_look_opposite_ways_are_told_of_and_keep_their_sign():
    found = estimate_sensitivity(
        make_fits(-1.0, -1.1, -1.2), CalibrationMethod("specimen"), MASSES, SPECIMEN
    )
    assert found.is_reversed
    assert found.sensitivity == pytest.approx(0.011)


def test_what_is_known_otherwise_is_in_the_budget():
    method = CalibrationMethod("hammer", 0.2, 0.002, 0.005)
    found = estimate_sensitivity(make_fits(1.0, 1.0, 1.0, misfit=0.04), method, MASSES, HAMMER)
    assert find_contributions(found) == {
        "known mass": pytest.approx(0.01),
        "mass of the hammer": pytest.approx(0.01),
        "sensitivity of the reference": pytest.approx(0.005),
        "misfit of the traces": pytest.approx(0.0016 / math.sqrt(3)),
    }
    assert found.remarks == ()
    assert math.isinf(found.uncertainty.degrees_of_freedom)


def test_the_hammers_mass_cancels_out_where_its_force_is_measured():
    method = CalibrationMethod("hammer", 0.2, 0.002, 0.005)
    found = estimate_sensitivity(make_fits(1.0, 1.0, 1.0), method, MASSES, FORCE)
    assert set(find_contributions(found)) == {"known mass", "sensitivity of the reference"}
    reverse = replace(method, channel="specimen")
    measured = replace(MASSES, sensors=(FORCE,))
    found = estimate_sensitivity(make_fits(1.0, 1.0, 1.0), reverse, measured, SPECIMEN)
    assert set(find_contributions(found)) == {"known mass", "sensitivity of the reference"}
    found = estimate_sensitivity(make_fits(1.0, 1.0, 1.0), reverse, MASSES, SPECIMEN)
    assert "mass of the hammer" in find_contributions(found)


def test_what_is_not_stated_is_told():
    method = CalibrationMethod("hammer", 0.2)
    setup = replace(MASSES, hammer_mass_uncertainty=0.0)
    found = estimate_sensitivity(make_fits(1.0, 1.1, 1.2), method, setup, HAMMER)
    (remark,) = found.remarks
    assert remark.startswith("the uncertainty of the reference and of the known mass and of the")
    assert remark.endswith("mass of the hammer is not stated, and not in it")


def test_too_few_hits_determine_nothing_and_the_flaws_are_named():
    flawed = [HitFit(HitLabel("block", 9), 0, None, "it has no pulse")]
    with pytest.raises(
        NotDeterminedError, match=r"2 of 3 hits can be used \(it has no pulse\): .* needs 3"
    ):
        estimate_sensitivity(
            make_fits(1.0, 1.1) + flawed, CalibrationMethod("hammer"), MASSES, HAMMER
        )


def test_a_flawed_hit_is_left_out():
    flawed = replace(make_fits(5.0)[0], flaw="misfit")
    found = estimate_sensitivity(
        [*make_fits(1.0, 1.1, 1.2), flawed], CalibrationMethod("hammer"), MASSES, HAMMER
    )
    assert (found.hits, found.ratio) == (3, pytest.approx(1.1))


def test_force_is_mass_times_acceleration():
    assert CalibrationMethod("hammer").find_factor(MASSES) == 1.0
    assert CalibrationMethod("hammer", 0.25).find_factor(MASSES) == pytest.approx(2.5)
    assert CalibrationMethod("specimen", 0.25).find_factor(MASSES) == pytest.approx(0.4)
    with pytest.raises(ParameterError, match=r"mass of the hammer is not known"):
        CalibrationMethod("hammer", 0.25).find_factor(replace(MASSES, hammer_mass=math.nan))


@pytest.mark.parametrize(
    ("values", "told"),
    [
        (("anvil",), "sensor under test is 'anvil'"),
        (("hammer", -1.0), "known mass is -1.0 kg"),
        (("hammer", 1.0, 2.0), "must be less than the mass"),
        (("hammer", math.nan, 0.0, 0.75), "uncertainty of the reference is 0.75"),
    ],
)
def test_impossible_numbers_are_refused(values, told):
    with pytest.raises(ParameterError, match=told):
        CalibrationMethod(*values)


@pytest.mark.parametrize("hits", [3, 5, 10])
def test_the_interval_covers_the_truth_nineteen_times_out_of_twenty(hits):
    # Each calibration has its own wrong mass, wrong reference and scatter, of the stated widths.
    rng = np.random.default_rng(hits)
    truth, trials, covered = 1.03, 600, 0
    method = CalibrationMethod("hammer", 0.2, 0.2 * 0.004, 0.003)
    for _ in range(trials):
        mass, reference = rng.normal(1.0, 0.004), rng.normal(1.0, 0.003)
        # Expected is mass times acceleration: a body heavier than stated gives a larger ratio.
        ratios = truth * mass / reference * rng.normal(1.0, 0.01, hits)
        found = estimate_sensitivity(make_fits(*ratios), method, MASSES, FORCE)
        covered += abs(found.ratio - truth) <= found.uncertainty.expanded
    # Binomial: standard deviation 0.009 of 600; with few hits t is a little generous.
    assert 0.92 <= covered / trials <= 0.99
