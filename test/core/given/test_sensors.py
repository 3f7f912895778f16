"""Sensors: calibrations, units, plans, responses, and what they do to results."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.estimates.checks import NO_CHECKS
from impact_rig.core.estimates.mean_reading import UNSEEN
from impact_rig.core.estimates.paper_method import HammerEstimate, PaperEstimate
from impact_rig.core.estimates.ringing import (
    FreeDecayEstimate,
    explain_ringing,
    find_shared_ringing,
)
from impact_rig.core.estimates.sample import SampleParts, TraceEstimates, check_sensors
from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.filtering import respond, restore_level
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.sensors import Sensitivity, Sensor, SensorResponse, compute_scale
from impact_rig.core.given.setup import PAPER_SETUP, RigSetup
from impact_rig.core.mean.mean_hit import MeanHit
from impact_rig.files.plan import ChannelPlan, ChannelUse


@pytest.mark.parametrize(
    ("calibrated", "today", "told"),
    [
        ("", "2026-11-21", None),
        ("2025-11-21", "2026-11-21", None),
        ("2025-11-20", "2026-11-21", "was calibrated on 2025-11-20, over a year before"),
        ("2024-02-29", "2025-03-01", "over a year before"),
        ("2026-11-22", "2026-11-21", "lies ahead of 2026-11-21"),
    ],
)
def test_a_calibration_holds_for_a_year(calibrated, today, told):
    warning = Sensor("hammer", calibration_date=calibrated).describe_age(today)
    assert warning is None if told is None else told in warning


@pytest.mark.parametrize(
    ("unit", "mass", "sensitivity", "scale"),
    [
        ("m/s^2", np.nan, None, 1.0),
        ("g", np.nan, None, 9.80665),
        ("N", 0.5, None, 2.0),
        ("lbf", 2.0, None, 2.2241108),
        ("V", np.nan, Sensitivity(0.01, "g"), 980.665),
        ("V", 0.5, Sensitivity(2.25e-3, "N"), 2 / 2.25e-3),
    ],
)
def test_a_unit_stands_for_an_acceleration(unit, mass, sensitivity, scale):
    assert compute_scale(unit, mass, sensitivity) == pytest.approx(scale, rel=1e-7)


@pytest.mark.parametrize(
    ("unit", "mass", "told"),
    [
        ("N", np.nan, "needs the hammer's mass"),
        ("V", 0.5, "needs a sensitivity"),
        ("Pa", 0.5, "'Pa' is unknown: a channel is in m/s"),
    ],
)
def test_units_that_give_no_acceleration_are_refused(unit, mass, told):
    with pytest.raises(ParameterError, match=told):
        compute_scale(unit, mass)


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: Sensitivity(0.0, "g"), "must not be zero"),
        (lambda: Sensitivity(0.01, "Pa"), "per 'Pa': it must be a voltage per"),
        (lambda: ChannelUse(unit="g", sensitivity=Sensitivity(0.01, "g")), "for channels in V"),
        (lambda: ChannelPlan(columns=("time", "hammer", "time")), "'time' is given twice"),
        (
            lambda: ChannelPlan(columns=("hammer", "hammer", "specimen")),
            "2 columns are the hammer's and 1 the sample's",
        ),
        (lambda: ChannelPlan(columns=("time", "specimen")), "no column has the role 'hammer'"),
        (lambda: ChannelPlan(time_unit="hours"), "'hours' is unknown: it is s, ms, us, ns, min"),
        (lambda: ChannelPlan(time_unit="samples"), "need a sampling rate"),
        (lambda: ChannelPlan(ChannelUse("a"), columns=("hammer",)), "one of the two"),
        (lambda: ChannelPlan(ChannelUse("a"), ChannelUse("a")), "'a' is the hammer's and"),
        (lambda: ChannelPlan(specimen=ChannelUse(unit="N")), "must be an acceleration"),
    ],
)
def test_what_cannot_be_meant_is_refused(make, told):
    with pytest.raises(ParameterError, match=told):
        make()


RATE = 1e6
TIME = np.arange(4000) / RATE
RAMP = np.clip(TIME * 1e4, 0.0, 1.0)


def test_a_resonance_answers_to_a_ramp_as_a_mass_on_a_spring():
    natural, damping = 2.0 * np.pi * 20e3, 0.1
    shown = respond(1e4 * TIME, SensorResponse(20e3, damping), RATE)
    damped = natural * np.sqrt(1.0 - damping**2)
    # Of x'' + 2 z w x' + w^2 x = w^2 b t from rest.
    turn = np.exp(-damping * natural * TIME) * (
        2.0 * damping / natural * np.cos(damped * TIME)
        - (1.0 - 2.0 * damping**2) / damped * np.sin(damped * TIME)
    )
    np.testing.assert_allclose(shown, 1e4 * (TIME - 2.0 * damping / natural + turn), atol=1e-9)


def test_a_low_corner_lets_a_level_decay_and_can_be_undone():
    corner = 300.0
    shown = respond(np.stack([RAMP, 2.0 * RAMP]), SensorResponse(0.0, 0.02, corner), RATE)
    level = np.exp(-2.0 * np.pi * corner * (TIME[-1] - TIME[2000]))
    assert shown[0, -1] == pytest.approx(shown[0, 2000] * level, rel=1e-9)
    np.testing.assert_allclose(
        restore_level(shown, corner, RATE), np.stack([RAMP, 2.0 * RAMP]), atol=1e-6
    )


def test_an_upper_corner_lags_behind_a_ramp_by_its_time_constant():
    corner = 5e3
    shown = respond(1e4 * TIME, SensorResponse(upper_corner=corner), RATE)
    constant = 1.0 / (2.0 * np.pi * corner)
    # Of T y' + y = b t from rest.
    expected = TIME - constant * (1.0 - np.exp(-TIME / constant))
    np.testing.assert_allclose(shown, 1e4 * expected, atol=1e-9)


@pytest.mark.parametrize(
    ("stated", "told"),
    [
        ({"resonance": -1.0}, "resonance of the hammer sensor is -1"),
        ({"resonance_damping": 0.0}, "resonance damping of the hammer sensor is 0.0"),
        ({"resonance": 10.0, "low_corner": 20.0}, "low corner of the hammer sensor is 20 Hz"),
        ({"upper_corner": 10.0, "low_corner": 20.0}, "below the upper corner of 10 Hz"),
        ({"sensitivity_uncertainty": -0.1}, "uncertainty of the sensitivity of the hammer"),
    ],
)
def test_what_no_sensor_does_is_refused(stated, told):
    with pytest.raises(ParameterError, match=told):
        Sensor("hammer", **stated)


NAMES = ("aluminium small", "steel medium", "brass large")


def describe(channel: str, resonance: float) -> RigSetup:
    return replace(PAPER_SETUP, sensors=(Sensor(channel, resonance=resonance),))


def test_a_resonance_near_the_low_pass_is_warned_of():
    (warning,) = check_sensors(describe("hammer", 70e3), 212e-6)
    assert "hammer's sensor, 70 kHz, lies near the low-pass of 50 kHz" in str(warning)
    assert "a low-pass of 35 kHz" in str(warning)
    assert check_sensors(describe("hammer", 110e3), 212e-6) == ()
    assert check_sensors(PAPER_SETUP, 212e-6) == ()


def test_a_resonance_near_the_spectrum_of_the_contact_is_warned_of():
    (warning,) = check_sensors(describe("specimen", 110e3), 40e-6)
    assert "specimen's sensor, 110 kHz, lies near the spectrum of a contact" in str(warning)


@pytest.mark.parametrize(
    ("frequency", "resonance", "told"),
    [
        (55e3, 0.0, "55 kHz, above half the low-pass of 50 kHz"),
        (20.5e3, 20e3, "20.5 kHz is the sensor, by the resonance that is stated"),
        (20.5e3, 40e3, None),
        (4e3, 0.0, None),
    ],
)
def test_which_ringing_is_a_sensors(frequency, resonance, told):
    text = explain_ringing(frequency, describe("specimen", resonance))
    assert told in text if told else text is None


def ring(frequencies: Sequence[float]) -> dict[str, FreeDecayEstimate]:
    return {
        name: FreeDecayEstimate(damping_ratio=Quantity(0.02), frequency=frequency)
        for name, frequency in zip(NAMES, frequencies, strict=False)
    }


def test_what_rings_alike_on_samples_of_other_masses_is_no_samples():
    frequencies = [20e3 * factor for factor in (1.0, 1.01, 0.99)]
    assert find_shared_ringing(ring(frequencies), PAPER_SETUP) == 20e3


def test_samples_that_ring_each_in_its_own_way_keep_what_they_have():
    assert find_shared_ringing(ring((4e3, 2.6e3, 2e3)), PAPER_SETUP) is None
    # Two may well be alike by chance.
    assert find_shared_ringing(ring((4e3, 4e3)), PAPER_SETUP) is None


def test_what_is_a_sensors_is_taken_from_every_part():
    traces, nothing = np.ones((2, 9)), np.zeros(2)
    mean = MeanHit(traces, 1e6, 3, nothing, nothing, (), 5, 1, nothing, nothing, nothing, nothing)
    paper = PaperEstimate(
        damping_ratio=Quantity(0.03), log_decrement=0.2, first_peak_time=0.0,
        second_peak_time=1.0 / 20e3,
    )  # fmt: skip
    (decay,) = ring([20e3]).values()
    traces = TraceEstimates(UNSEEN, NO_CHECKS, decay, ())
    parts = SampleParts(NAMES[0], 0, mean, paper, HammerEstimate(), traces=traces)
    found = parts.without_ringing(20e3)
    assert not found.paper.damping_ratio.is_known
    assert found.traces is not None
    assert not found.traces.free_decay.is_known
    assert "20 kHz does so on all samples, though their masses differ" in str(
        found.traces.notes[-1]
    )
