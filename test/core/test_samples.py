"""Sample sets and set-ups: what is refused says what would be right."""

import math

import pytest

from impact_rig.core.errors import ParameterError
from impact_rig.core.setup import RigSetup, Sample, SampleSet

STEEL, BRASS = Sample("steel", 0.05632), Sample("brass", 0.06086)


@pytest.mark.parametrize("text", ["steel\x1b]0;mine\x07", "two\nlines", "\ud800"])
def test_a_name_or_material_that_would_steer_a_terminal_is_refused(text):
    with pytest.raises(ParameterError, match=r"the name of a sample .* letters that can be shown"):
        Sample(text, 0.05)
    with pytest.raises(ParameterError, match="the material of a sample"):
        Sample("steel", 0.05, text)


def test_an_unknown_sample_is_named_with_those_there_are():
    samples = SampleSet((STEEL, BRASS), "")
    for call in (samples.find, samples.get_moving_mass):
        with pytest.raises(ParameterError) as error:
            call("stel")
        assert str(error.value) == "unknown sample 'stel': the set has 'steel', 'brass'"


@pytest.mark.parametrize("value", [-1e-6, math.nan, math.inf])
def test_an_impossible_uncertainty_is_refused_by_name(value):
    samples = SampleSet((Sample("oak", 0.1),), "oak")
    with pytest.raises(ParameterError, match="mass uncertainty of sample 'oak'"):
        Sample("oak", 0.1, mass_uncertainty=value)
    with pytest.raises(ParameterError, match="accelerometer mass uncertainty"):
        SampleSet((Sample("oak", 0.1),), "oak", accelerometer_mass_uncertainty=value)
    with pytest.raises(ParameterError, match="hammer mass uncertainty"):
        RigSetup(samples, 0.1, 0.3, hammer_mass_uncertainty=value)
    with pytest.raises(ParameterError, match="clock uncertainty"):
        RigSetup(samples, 0.1, 0.3, clock_uncertainty=value)


def test_a_missing_control_sample_is_named_with_those_there_are():
    with pytest.raises(ParameterError) as error:
        SampleSet((STEEL, BRASS), "aluminium large")
    assert str(error.value) == (
        "control sample 'aluminium large' is missing from the set, which has 'steel', 'brass'"
    )


def test_an_uncertainty_that_leaves_nothing_of_its_mass_is_refused():
    with pytest.raises(ParameterError, match=r"must be less than the mass, which is 0\.1 kg"):
        Sample("oak", 0.1, mass_uncertainty=0.1)
    with pytest.raises(ParameterError, match=r"accelerometer mass uncertainty is 0\.001 kg"):
        SampleSet((Sample("oak", 0.1),), "oak", accelerometer_mass_uncertainty=1e-3)
    with pytest.raises(ParameterError, match=r"hammer mass uncertainty is 0\.3 kg"):
        RigSetup(SampleSet((Sample("oak", 0.1),), "oak"), 0.1, 0.3, hammer_mass_uncertainty=0.3)


SERIES = RigSetup(
    SampleSet((STEEL, BRASS), control_sample="brass"), 0.1, 0.0819, release_angle=math.radians(3.7)
)


def test_a_sample_is_in_the_set_once_for_each_release_angle():
    setup = SERIES.at_angles([math.radians(5.0), math.radians(12.5)])
    assert setup.samples.names == ("steel 5°", "steel 12.5°", "brass 5°", "brass 12.5°")
    assert setup.samples.find_series(["brass"]) == ("brass 5°", "brass 12.5°")
    assert {item.body for item in setup.samples.samples} == {"steel", "brass"}
    assert setup.samples.control_sample == "brass 5°"


@pytest.mark.parametrize("degrees", [0.5, 3.7, 20.0, 90.0])
def test_a_series_is_as_fast_as_its_pendulum_falls(degrees):
    angle, rig = math.radians(degrees), SERIES.release_angle
    setup = SERIES.at_angles([angle, math.radians(1.0)])
    series = setup.for_series(f"steel {degrees:g}°")
    # By the energy, of the pendulum that the rig's own angle and speed describe.
    length = 0.0819**2 / (2.0 * 9.80665 * (1.0 - math.cos(rig)))
    speed = math.sqrt(2.0 * 9.80665 * length * (1.0 - math.cos(angle)))
    assert series.impact_speed == pytest.approx(speed, rel=1e-9)
    assert series.samples.control_sample == f"brass {degrees:g}°"
    assert series.for_series(f"steel {degrees:g}°") == series


@pytest.mark.parametrize(
    ("degrees", "told"),
    [
        ([0.0], "release angle is 0°: it must be above 0° and 90° at most"),
        ([5.0, -2.0], "release angle is -2°"),
        ([90.5], "release angle is 90.5°"),
        ([math.nan], "release angle is nan°"),
        ([5.0, 10.0, 5.0], "release angle 5° is given twice"),
    ],
)
def test_angles_that_cannot_be_meant_are_refused(degrees, told):
    with pytest.raises(ParameterError, match=told):
        SERIES.at_angles([math.radians(each) for each in degrees])


def test_angles_tell_no_speed_where_none_is_known():
    with pytest.raises(ParameterError, match=r"release_angle of the hammer is not known: give"):
        RigSetup(SampleSet((STEEL,), ""), 0.1, 0.08).at_angles([0.1])
