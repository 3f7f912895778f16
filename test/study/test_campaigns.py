"""Truths are drawn about what is stated; a campaign shows the laboratory the stated ones only."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.digitizer import DigitizerSettings
from impact_rig.devices.virtual.rig import VirtualRigSettings
from impact_rig.study.campaigns import (
    CampaignSource,
    Truth,
    adapt_ranges,
    draw_truth,
    make_exact,
    set_damping_ratio,
    shift_clock,
)
from impact_rig.study.cases import Case, Part, list_cases

QUIET = VirtualRigSettings(
    plant=Plant.DYNAMICS,
    contact_time_scatter=0.0,
    amplitude_scatter=0.0,
    digitizer=DigitizerSettings(noise=0.0, offset=0.0, trigger_jitter=0.0),
)


def make_case(rig=QUIET, **values):
    return Case(Part.BIAS, "axis", "value", 0.0, rig, **{"hits": 2, **values})


def draw_many(setup, count=2000):
    generator = np.random.default_rng(5)
    return [draw_truth(setup, generator) for _ in range(count)]


def test_masses_and_clock_scatter_by_their_stated_uncertainties():
    truths = draw_many(PAPER_SETUP)
    samples = PAPER_SETUP.samples
    for values, mean, spread in (
        ([truth.setup.hammer_mass for truth in truths],
         PAPER_SETUP.hammer_mass, PAPER_SETUP.hammer_mass_uncertainty),
        ([truth.setup.samples.accelerometer_mass for truth in truths],
         samples.accelerometer_mass, samples.accelerometer_mass_uncertainty),
        ([truth.setup.samples.samples[4].mass for truth in truths],
         samples.samples[4].mass, samples.samples[4].mass_uncertainty),
        ([truth.clock_error for truth in truths], 0.0, PAPER_SETUP.clock_uncertainty),
    ):  # fmt: skip
        assert spread > 0
        # The mean of 2000 within four of its standard deviations, the spread likewise.
        assert np.mean(values) == pytest.approx(mean, abs=4 * spread / math.sqrt(2000))
        assert np.std(values) == pytest.approx(spread, rel=4 / math.sqrt(4000))


def test_the_draws_are_independent_of_each_other():
    truths = draw_many(PAPER_SETUP)
    table = [
        (
            truth.setup.hammer_mass,
            truth.clock_error,
            *(s.mass for s in truth.setup.samples.samples),
        )
        for truth in truths
    ]
    correlation = np.corrcoef(np.array(table).T) - np.eye(14)
    assert np.abs(correlation).max() < 4.5 / math.sqrt(2000)


def test_what_is_exact_stays_and_moves_no_other_draw():
    weighed = replace(PAPER_SETUP, hammer_mass_uncertainty=0.0)
    (before,), (after,) = draw_many(PAPER_SETUP, 1), draw_many(weighed, 1)
    assert after.setup.hammer_mass == PAPER_SETUP.hammer_mass
    assert after.clock_error == before.clock_error
    assert after.setup.samples == before.setup.samples
    exact = make_exact(PAPER_SETUP)
    assert draw_many(exact, 1) == [Truth(exact)]


def test_the_paper_stiffness_is_table_3():
    truth = Truth(PAPER_SETUP).find_parameters("steel medium")
    assert truth["paper_stiffness"] == pytest.approx(45.29e6, rel=1e-3)
    assert truth["stiffness"] == 45.29e6
    # c / (2 sqrt(k m)) by hand, m with the accelerometer.
    assert truth["damping_ratio"] == pytest.approx(1170 / (2 * math.sqrt(45.29e6 * 0.16991)))


def test_the_true_masses_count_in_the_true_stiffness():
    heavy = replace(PAPER_SETUP, hammer_mass=0.101)
    ratio = (
        Truth(heavy).find_parameters("steel medium")["paper_stiffness"]
        / Truth(PAPER_SETUP).find_parameters("steel medium")["paper_stiffness"]
    )
    m1, m2, mc = np.array([0.100, 0.101]), 0.16991, 0.10538
    equivalent = m1 * m2 / (m1 + m2) / 203.2e-6**2
    hammer = 2 * m1 * mc / (m1 + mc) / 212.0e-6**2
    expected = 1 / (1 / equivalent - 1 / hammer)
    assert ratio == pytest.approx(expected[1] / expected[0], rel=1e-12)


def test_one_damping_ratio_for_every_sample():
    changed = Truth(set_damping_ratio(PAPER_SETUP, 0.3))
    for name in PAPER_SETUP.samples.names:
        assert changed.find_parameters(name)["damping_ratio"] == pytest.approx(0.3)


def test_a_fast_clock_takes_as_many_points_in_less_time():
    shifted = shift_clock(DigitizerSettings(), 5e-4)
    assert shifted.count == 5000
    assert shifted.sampling_rate == pytest.approx(2.50125e6)


def test_the_laboratory_reads_times_by_the_clock_it_believes_in():
    setup = replace(make_exact(PAPER_SETUP), clock_uncertainty=0.05)
    campaign = CampaignSource(make_case(), setup, (2,)).run(4)
    assert abs(campaign.truth.clock_error) > 1e-3
    true = campaign.truth.find_parameters(campaign.sample)["contact_time"]
    estimate = campaign.session.estimate_sample(campaign.sample)
    # A fast clock counts more points; the low-pass leaves the width within 1e-4.
    assert estimate.contact.contact_time == pytest.approx(
        true * (1 + campaign.truth.clock_error), rel=3e-4
    )
    assert {hit.filtered.sampling_rate for hit in campaign.hits} == {2.5e6}


def test_a_campaign_is_its_number_whatever_came_before():
    case = list_cases(Part.COVERAGE)[0]
    first = CampaignSource(case, PAPER_SETUP, (1, 2))
    for number in (0, 1):
        first.run(number)
    again, late = CampaignSource(case, PAPER_SETUP, (1, 2)).run(2), first.run(2)
    assert again.truth == late.truth
    times = [[hit.contact_time for hit in campaign.hits] for campaign in (again, late)]
    assert times[0] == times[1]
    other = CampaignSource(case, PAPER_SETUP, (2, 2)).run(2)
    assert [hit.contact_time for hit in other.hits] != times[0]


def test_samples_take_turns_and_the_control_sample_is_struck_where_it_is_wanted():
    alone = CampaignSource(make_case(has_control=False), PAPER_SETUP, (1,)).run(13)
    assert alone.sample == PAPER_SETUP.samples.names[1]
    assert alone.session.names == (alone.sample,)
    both = CampaignSource(make_case(), PAPER_SETUP, (1,)).run(0)
    assert set(both.session.names) == {"aluminium small", "aluminium large"}
    assert len(both.hits) == 2


@pytest.mark.parametrize("sample", ["aluminium small", "bronze large"])
def test_noise_as_a_part_of_each_peak(sample):
    case = list_cases(Part.EFFICIENCY)[-1]
    number = PAPER_SETUP.samples.names.index(sample)
    rig = adapt_ranges(case, PAPER_SETUP, sample)
    hit = CampaignSource(case, PAPER_SETUP, (1,)).run(number).hits[0]
    for channel, peak in enumerate((hit.hammer_peak, hit.specimen_peak)):
        # 1 % of the peak; 1400 points of baseline tell it within 2 % standard.
        assert hit.filtered.raw_noise[channel] == pytest.approx(0.01 * peak, rel=0.1)
    assert hit.hammer_peak == pytest.approx(rig.digitizer.hammer_full_scale / 2, rel=0.02)
