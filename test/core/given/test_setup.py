"""Sample sets, settings and set-ups: what is refused says what would be right."""

import math
from dataclasses import replace

import pytest

from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.setup import (
    MISPRINTS,
    PAPER_SETUP,
    AnalysisSettings,
    RigSetup,
    Sample,
    SampleSet,
)

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
        with pytest.raises(ParameterError, match="'stel': there are 'steel', 'brass'"):
            call("stel")


OAK = SampleSet((Sample("oak", 0.1),), "oak")


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda u: Sample("oak", 0.1, mass_uncertainty=u), "mass uncertainty of sample 'oak'"),
        (lambda u: replace(OAK, accelerometer_mass_uncertainty=u), "accelerometer mass uncert"),
        (lambda u: RigSetup(OAK, 0.1, 0.3, hammer_mass_uncertainty=u), "hammer mass uncertainty"),
        (lambda u: RigSetup(OAK, 0.1, 0.3, clock_uncertainty=u), "clock uncertainty"),
    ],
)
def test_an_impossible_uncertainty_is_refused_by_name(make, name):
    for value in (-1e-6, math.nan, math.inf):
        with pytest.raises(ParameterError, match=name):
            make(value)
    if "mass" in name:
        with pytest.raises(ParameterError, match=r"0\.3 kg: it must be less than the mass"):
            make(0.3)


def test_a_missing_control_sample_is_named_with_those_there_are():
    with pytest.raises(ParameterError, match=r"'alum' is missing .* which has 'steel', 'brass'"):
        SampleSet((STEEL, BRASS), "alum")


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
        ([5.0, 10.0, 5.0], "release angle 5° is given twice"),
    ],
)
def test_angles_that_cannot_be_meant_are_refused(degrees, told):
    with pytest.raises(ParameterError, match=told):
        SERIES.at_angles([math.radians(each) for each in degrees])


def test_angles_tell_no_speed_where_none_is_known():
    with pytest.raises(ParameterError, match=r"release_angle of the hammer is not known: give"):
        RigSetup(SampleSet((STEEL,), ""), 0.1, 0.08).at_angles([0.1])


@pytest.mark.parametrize(
    ("field", "value", "right"),
    [
        ("cutoff_frequency", -1.0, "0 or more"),
        ("pulse_factor", 0.5, "between 1 and 4"),
        ("record_duration", -2e-3, "above zero"),
        ("pre_trigger", 2e-3, "shorter than record_duration, which is 0.002 s"),
        ("cutoff_frequency", 1.0, "in a record of 0.002 s it must be 1000 Hz or more"),
        ("maximum_peak", 0.0, "above the minimum_peak of 0.0"),
        ("double_hit_level", 0.0, "between 0.001 and 1"),
    ],
)
def test_what_cannot_be_meant_is_refused_by_name(field, value, right):
    with pytest.raises(ParameterError) as error:
        AnalysisSettings(**{field: value})
    message = str(error.value)
    assert field in message
    assert str(value) in message
    assert right in message


@pytest.mark.parametrize(
    ("material", "totals"),
    # Rows of the printed tables, added up apart from the code: a typing error would show.
    [
        ("aluminium", (185.31e-3, 553.6e-6, 56.09e6, 1539)),
        ("steel", (500.33e-3, 592.4e-6, 120.58e6, 3323)),
        ("bronze", (628.14e-3, 653.6e-6, 89.37e6, 5299)),
        ("brass", (540.60e-3, 721.1e-6, 75.57e6, 4505)),
    ],
)
def test_rows_add_up(material, totals):
    rows = [
        (
            cell.mass,
            MISPRINTS.get(cell.name, cell.reference_contact_time),
            cell.reference_stiffness,
            cell.reference_damping_coefficient,
        )
        for cell in PAPER_SETUP.samples.samples
        if cell.material == material
    ]
    assert tuple(map(sum, zip(*rows, strict=True))) == pytest.approx(totals)


def test_masses_are_as_uncertain_as_they_are_rounded():
    # Half a unit of the last printed digit, rectangular: 0.5 g and 0.005 g over sqrt(3).
    coarse, fine = 0.5e-3 / math.sqrt(3), 0.005e-3 / math.sqrt(3)
    assert PAPER_SETUP.hammer_mass_uncertainty == pytest.approx(coarse, rel=0.01)
    assert PAPER_SETUP.samples.accelerometer_mass_uncertainty == pytest.approx(coarse, rel=0.01)
    for sample in PAPER_SETUP.samples.samples:
        assert sample.mass_uncertainty == pytest.approx(fine, rel=0.01)


@pytest.mark.parametrize(
    ("record", "field"), [(PAPER_SETUP, "release_angle"), (Quantity(), "standard")]
)
def test_a_value_that_is_not_known_equals_itself(record, field):
    once, again = (replace(record, **{field: float("nan")}) for _ in range(2))
    assert once == again
    assert len({once, again}) == 1
    assert once != replace(record, **{field: 0.1})
