"""The sensors of a rig file: what a calibration sheet says, in its own units."""

import math

import pytest

from impact_rig.configuration.sensor_table import parse_sensors
from impact_rig.configuration.toml_table import parse_toml_table
from impact_rig.core.errors import ParameterError
from impact_rig.core.setup.sensors import Sensor


def read(text):
    return parse_sensors(parse_toml_table("[source]\n" + text).take_table("source"))


def test_a_sheet_is_taken_as_it_is_written():
    hammer, specimen = read(
        '[source.hammer]\nquantity = "force"\nsensitivity = "2.25 mV/N"\nfull_scale = "2.2 kN"\n'
        'serial_number = "SN 7"\ncalibration_date = 2026-03-01\n'
        '[source.specimen]\nsensitivity = "-1.02 mV/(m/s^2)"\nfull_scale = "500 g"\n'
    )
    assert hammer.sensitivity == pytest.approx(2.25e-3)
    sheet = Sensor("hammer", "force", "N", hammer.sensitivity, 2200.0, "SN 7", "2026-03-01")
    assert hammer == sheet
    assert (specimen.unit, specimen.sensitivity) == ("m/s^2", -1.02e-3)
    assert specimen.full_scale == pytest.approx(500 * 9.80665)


def test_a_source_that_measures_in_units_needs_no_sensitivity():
    (hammer,) = read('[source.hammer]\nunit = "g"\nfull_scale = "1e3 m/s²"\n')
    assert hammer.unit == "g"
    assert math.isnan(hammer.sensitivity)
    assert hammer.full_scale == pytest.approx(1000 / 9.80665)
    assert read("") == ()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('[source.hammer]\nquantity = "speed"', "line 3: quantity .*one of acceleration, force"),
        ("[source.hammer]\nsensitivity = 10", r"line 3: sensitivity of .source.hammer. is 10"),
        ('[source.hammer]\nsensitivity = "10 mV/N"', "line 3: .*in m/s.2 or g: .*acceleration"),
        ('[source.hammer]\nsensitivity = "10 kg/g"', "line 3: .*no V"),
        ('[source.hammer]\nsensitivity = "0 mV/g"', "line 3: sensitivity is .*not be zero"),
        ('[source.hammer]\nunit = "V"', "line 3: unit .* 'V': .*in m/s.2 or g"),
        ('[source.hammer]\nsensitivity = "10 mV/g"\nunit = "m/s^2"', "line 4: .* be g, as"),
        ('[source.hammer]\nfull_scale = "500 N"', "line 3: full_scale .*in m/s.2 or g"),
        ('[source.hammer]\nfull_scale = "-500 g"', "line 3: full_scale .*above zero"),
        ('[source.hammer]\nserial_number = 7', "line 3: serial_number .*text in quotes"),
        ('[source.hammer]\ncalibration_date = "March"', "line 3: .*year-month-day"),
        ('[source.specimen]\nquantity = "force"', "line 3: quantity .*acceleration: on the"),
        ("hammer = 3", r"line 2: source.hammer is 3: it must be a table \[source.hammer\]"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_named_with_its_line(text, told):
    with pytest.raises(ParameterError, match=told):
        read(text)
