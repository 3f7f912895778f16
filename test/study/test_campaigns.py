"""Simulated campaigns and faults: truths drawn about what is stated, faults rightly named."""

import math

import numpy as np
import pytest

from impact_rig.core.setup import PAPER_SETUP
from impact_rig.devices.virtual.choices import Plant
from study.campaigns import (
    ASKED,
    PAPER_STIFFNESS,
    Asked,
    Outcome,
    Summary,
    compute_truth,
    draw_truth,
    find_least,
    find_most,
    run_campaign,
    summarize,
)
from study.selection import FAULTS, SURE, strike_fault, strike_good_hits


def test_masses_and_clock_scatter_by_their_stated_uncertainties():
    generator = np.random.default_rng(5)
    truths = [draw_truth(PAPER_SETUP, generator) for _ in range(2000)]
    samples = PAPER_SETUP.samples
    for values, mean, spread in (
        ([setup.hammer_mass for setup, _ in truths],
         PAPER_SETUP.hammer_mass, PAPER_SETUP.hammer_mass_uncertainty),
        ([setup.samples.accelerometer_mass for setup, _ in truths],
         samples.accelerometer_mass, samples.accelerometer_mass_uncertainty),
        ([setup.samples.samples[4].mass for setup, _ in truths],
         samples.samples[4].mass, samples.samples[4].mass_uncertainty),
        ([clock_error for _, clock_error in truths], 0.0, PAPER_SETUP.clock_uncertainty),
    ):  # fmt: skip
        assert spread > 0
        # The mean of 2000 within four of its standard deviations, and so the spread.
        assert np.mean(values) == pytest.approx(mean, abs=4 * spread / math.sqrt(2000))
        assert np.std(values) == pytest.approx(spread, rel=4 / math.sqrt(4000))


def test_the_truth_of_the_published_set_up_is_tables_3_and_4():
    truth = compute_truth(Plant.DYNAMICS, PAPER_SETUP, "steel medium")
    assert truth[PAPER_STIFFNESS] == pytest.approx(45.29e6, rel=1e-3)
    assert truth["stiffness"] == 45.29e6
    # c / (2 sqrt(k m)) by hand, m with the accelerometer.
    assert truth["damping_ratio"] == pytest.approx(1170 / (2 * math.sqrt(45.29e6 * 0.16991)))


@pytest.mark.parametrize("plant", ASKED)
def test_errors_are_as_large_as_they_are_said_to_be(plant):
    outcomes = run_campaign(plant, PAPER_SETUP, 1, 4)
    assert tuple(outcome.asked for outcome in outcomes) == ASKED[plant]
    for outcome in outcomes:
        assert abs(outcome.error) < 2.5 * outcome.half_width
    assert run_campaign(plant, PAPER_SETUP, 1, 4) == outcomes
    assert run_campaign(plant, PAPER_SETUP, 2, 4) != outcomes


def test_intervals_that_cover_are_counted_and_what_is_not_determined_covers_nothing():
    asked, other = Asked("paper", "stiffness", "x"), Asked("free decay", "stiffness", "x")
    outcomes = [
        Outcome(asked, 0.03, 0.02),
        Outcome(asked, -0.01, 0.02),
        Outcome(asked, math.nan, math.nan),
        Outcome(other, 0.0, 0.1),
    ]
    first, second = summarize(outcomes)
    assert (first.asked, first.campaigns, first.covered) == (asked, 3, 1)
    assert first.bias == pytest.approx(0.5)
    assert second == Summary(other, 1, 1, 0.0)


def test_chance_leaves_what_a_binomial_distribution_says():
    # P(X <= 29) of 36 at 0.95 is 0.0016, P(X <= 28) 0.0003.
    assert (find_least(36, 0.95), find_most(36, 0.05)) == (29, 7)


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
