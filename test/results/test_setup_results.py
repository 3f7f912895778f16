"""The set-up in results: nothing is lost on the way to it and back."""

import math
from dataclasses import replace

import pytest

from impact_rig.core.errors import ParameterError
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.setup.samples import RigSetup, Sample, SampleSet
from impact_rig.core.setup.sensors import Sensor
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.results.setup_results import SetupResults, setup_results_from_setup


def test_the_sample_set_comes_back_as_it_was() -> None:
    assert setup_results_from_setup(PAPER_SETUP).to_samples() == PAPER_SETUP.samples


def test_every_figure_lands_in_its_own_field() -> None:
    samples = SampleSet(
        (Sample("tin", 0.01, "metal", 2e-4, 3e6, 4.0, 0.001),),
        control_sample="tin",
        accelerometer_mass=0.005,
        accelerometer_mass_uncertainty=0.0006,
    )
    analysis = AnalysisSettings(
        cutoff_frequency=7e4,
        pulse_factor=1.8,
        pre_trigger=1e-4,
        record_duration=3e-3,
        detection_level=0.01,
        minimum_peak=0.11,
        maximum_peak=0.91,
        overload_run=5,
        double_hit_level=0.06,
        keep_hits=12,
    )
    setup = replace(
        PAPER_SETUP,
        samples=samples,
        hammer_mass=0.2,
        hammer_mass_uncertainty=0.03,
        hammer_stiffness=9e6,
        clock_uncertainty=1e-4,
        impact_speed=0.5,
        analysis=analysis,
        name="rig",
        description="on the bench",
    )
    flat = setup_results_from_setup(setup)
    assert (flat.name, flat.description, flat.control_sample) == ("rig", "on the bench", "tin")
    assert (flat.hammer_mass_kg, flat.hammer_mass_u_kg) == (0.2, 0.03)
    assert (flat.accelerometer_mass_kg, flat.accelerometer_mass_u_kg) == (0.005, 0.0006)
    assert (flat.clock_u, flat.impact_speed_m_per_s) == (1e-4, 0.5)
    assert flat.hammer_stiffness_n_per_m == 9e6
    (tin,) = flat.samples
    assert (tin.name, tin.material, tin.mass_kg, tin.mass_u_kg) == ("tin", "metal", 0.01, 0.001)
    assert tin.reference_contact_time_s == 2e-4
    assert tin.reference_stiffness_n_per_m == 3e6
    assert tin.reference_damping_coefficient_n_s_per_m == 4.0
    settings = flat.analysis
    assert (settings.cutoff_frequency_hz, settings.pulse_factor) == (7e4, 1.8)
    assert (settings.pre_trigger_s, settings.record_duration_s) == (1e-4, 3e-3)
    assert (settings.detection_level, settings.minimum_peak) == (0.01, 0.11)
    assert (settings.maximum_peak, settings.overload_run) == (0.91, 5)
    assert (settings.double_hit_level, settings.keep_hits) == (0.06, 12)


def test_without_a_set_up_nothing_is_known() -> None:
    assert math.isnan(SetupResults().hammer_mass_kg)
    with pytest.raises(ParameterError, match="at least one sample"):
        SetupResults().to_samples()


def test_masses_that_are_not_known_stay_so() -> None:
    samples = SampleSet((Sample("tin", math.nan),), "")
    flat = setup_results_from_setup(RigSetup(samples, math.nan, 0.1, AnalysisSettings()))
    assert math.isnan(flat.samples[0].mass_kg)
    assert math.isnan(flat.to_samples().samples[0].mass)


def test_the_sensors_come_back_as_they_were() -> None:
    sensors = (
        Sensor("hammer", "force", "N", 2.25e-3, 2200.0, "SN 7", "2026-03-01"),
        Sensor("specimen", "acceleration", "g", -0.01),
    )
    flat = setup_results_from_setup(replace(PAPER_SETUP, sensors=sensors))
    assert flat.sensors[0].sensitivity_v_per_unit == 2.25e-3
    assert tuple(item.to_sensor() for item in flat.sensors) == sensors
