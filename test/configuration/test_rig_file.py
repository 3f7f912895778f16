"""A rig file says in units what the rig is; what cannot be meant is refused by name."""

import math
import re
from dataclasses import asdict

import pytest

from impact_rig.configuration.rig_file import (
    parse_rig_file,
    parse_sensors,
    read_rig_file,
    read_template,
)
from impact_rig.configuration.toml_table import parse_toml_table
from impact_rig.core.given.errors import FileError, ParameterError
from impact_rig.core.given.sensors import Sensor, SensorResponse
from impact_rig.core.given.setup import PAPER_SETUP


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


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('[source.hammer]\nsensitivity = "10 mV/N"', "line 3: .*in m/s.2 or g or .*acceleration"),
        ('[source.hammer]\nlow_corner = "2 Hz"\nresonance = "1 Hz"', "line 3: low corner .*below"),
        ('[source.hammer]\nfull_scale = "-500 g"', "line 3: full_scale .*above zero"),
        ('[source.specimen]\nquantity = "force"', "line 3: quantity .*acceleration: force"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_named_with_its_line(text, told):
    with pytest.raises(ParameterError, match=told):
        read(text)


SMALLEST = """
[hammer]
mass = "0.1 kg"
impact_speed = "30 cm/s"

[[sample]]
name = "oak"
mass = "80 g"
"""


def flatten(value, place=""):
    """Return every leaf of nested mappings and sequences by its place."""
    if isinstance(value, dict):
        return {
            key: leaf
            for name, item in value.items()
            for key, leaf in flatten(item, f"{place}.{name}").items()
        }
    if isinstance(value, (list, tuple)):
        return flatten(dict(enumerate(value)), place)
    return {place: value}


def test_the_template_is_the_published_rig():
    read = flatten(asdict(parse_rig_file(read_template()).setup))
    published = flatten(asdict(PAPER_SETUP))
    assert read.keys() == published.keys()
    for place, value in published.items():
        # Units are converted in floating point: one part in 10^12 is rounding.
        expected = (
            value if isinstance(value, str) else pytest.approx(value, rel=1e-12, nan_ok=True)
        )
        assert read[place] == expected, place


def test_units_are_converted_and_defaults_filled_in():
    rig = parse_rig_file(SMALLEST)
    assert rig.setup.hammer_mass == pytest.approx(0.1)
    assert rig.setup.impact_speed == pytest.approx(0.3)
    assert rig.setup.samples.find("oak").mass == pytest.approx(0.08)
    assert rig.setup.samples.control_sample == ""
    assert rig.setup.samples.find("oak").mass_uncertainty == 0.0
    assert rig.setup.clock_uncertainty == pytest.approx(100e-6 / 3**0.5, rel=5e-3)
    assert rig.setup.analysis == PAPER_SETUP.analysis


def test_release_angles_are_in_degrees():
    text = 'release_angle = "3 deg"\nrelease_angles = ["5 deg", "0.35 rad"]'
    rig = parse_rig_file(SMALLEST.replace("[hammer]", f"[hammer]\n{text}"))
    assert rig.setup.release_angle == pytest.approx(math.radians(3.0))
    assert rig.release_angles == pytest.approx((math.radians(5.0), 0.35))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('[[sample]]\nname = "oak"\nmass = "80 g"', "", r"no \[\[sample\]\]: .*--template"),
        ('mass = "80 g"', 'mass = "80 g"\nmass_uncertainty = "-1 g"',
         r"mass uncertainty of sample 'oak' is -0.001.*0 or more"),
        ("[hammer]", "[analysis]\npulse_factor = 9\n[hammer]", r"pulse_factor is 9.*between"),
        ("[hammer]", '[hammer]\nrelease_angles = ["5 deg"]', r"release_angle of .* not known"),
        ("[hammer]", '[hammer]\nrelease_angle = "3 deg"\nrelease_angles = ["5 deg", "0 deg"]',
         r"release angle is 0°: it must be above 0°"),
        ("[hammer]", "[hammer]\nrelease_angles = 5", r'is 5: it must be a list like \["5 deg"'),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_named_with_its_value(old, new, message):
    assert old in SMALLEST
    with pytest.raises(ParameterError, match=message):
        parse_rig_file(SMALLEST.replace(old, new))


def test_the_file_is_named_in_every_error(tmp_path):
    with pytest.raises(FileError, match=r"there is no rig file .*absent\.toml"):
        read_rig_file(tmp_path / "absent.toml")
    path = tmp_path / "bad.toml"
    path.write_text(SMALLEST.replace("80 g", "80 m"), "utf-8")
    with pytest.raises(FileError, match=r"bad\.toml: line 8: mass of sample 'oak'"):
        read_rig_file(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError, match=r"bad\.toml cannot be read"):
        read_rig_file(path)


def read_taught_lines(*, commented: bool = False) -> str:
    """Return the tables of drivers that the template has in comments."""
    begin = read_template().index("# [source]")
    text = read_template()[begin : read_template().index("\n\n", begin)]
    return text if commented else re.sub("^# ", "", text, flags=re.MULTILINE)


def test_what_the_template_comments_out_can_be_used():
    rig = parse_rig_file(SMALLEST + read_taught_lines())
    assert (rig.source["driver"], rig.holder["driver"]) == ("scpi", "manual")
    hammer, specimen = rig.setup.sensors
    assert (hammer.serial_number, hammer.calibration_date) == ("LW1234", "2026-03-01")
    assert hammer.response == SensorResponse(70e3, 0.02, 0.5, 50e3)
    uncertainties = (hammer.resonance_uncertainty, hammer.low_corner_uncertainty)
    assert (*uncertainties, hammer.sensitivity_uncertainty) == (2e3, 0.1, 0.005)
    assert hammer.upper_corner_uncertainty == 2e3
    assert specimen.response.is_flat


def test_what_a_rig_file_says_of_the_swing_are_parameters_of_the_hammer():
    text = '[holder]\ndriver = "manual"\nswing_time = "150 ms"\nconfirm_return = true\n'
    rig = parse_rig_file(SMALLEST + text)
    assert rig.hammer == {"swing_time": pytest.approx(0.15), "confirm_return": True}
    assert parse_rig_file(SMALLEST).hammer == {}
    with pytest.raises(ParameterError, match=r"line 10: swing_time .* between 0 and 60 s"):
        parse_rig_file(SMALLEST + '[holder]\nswing_time = "2 min"\n')


HOLDER = 'driver = "manual"\nswing_time = "207 ms"\nreturn_time = "1 s"\nconfirm_return = true'
FULL = (
    read_template()
    .partition('[[sample]]\nname = "aluminium medium"')[0]
    .replace("aluminium large", "aluminium small")
    .replace(read_taught_lines(commented=True), read_taught_lines())
    .replace('driver = "manual"', HOLDER)
)
OF_DRIVERS = ("driver", "address", "sampling_rate", "trigger_level", "channel")
ODD_VALUES = (
    "true", "-3", "1e400", "nan", "-1.5", '""', '"x"', '"nan kg"', '"inf s"', '"-1 mV/g"', '"1/0"',
    '"5 g g"', '"\\u0000"', "[1]", "{a = 1}", "[[]]", "2020-01-01", "2020-01-01T00:00:00",
    "12:00:00", '"9**9**9**9 kg"', '"1e999 kg"', '"5 kg**-1**-1"',
)  # fmt: skip


def find_error(text):
    """Return why a rig file is refused; empty: it is not."""
    try:
        parse_rig_file(text)
    except ParameterError as error:
        return str(error)
    return ""


@pytest.mark.parametrize(
    "number",
    [
        number
        for number, line in enumerate(FULL.split("\n"))
        if " = " in line and not line.startswith(("#", *OF_DRIVERS))
    ],
)
def test_whatever_stands_for_a_value_it_is_taken_or_refused_with_its_line(number):
    lines = FULL.split("\n")
    key = lines[number].partition(" = ")[0]
    refused = 0
    for value in ODD_VALUES:
        text = "\n".join([*lines[:number], f"{key} = {value}", *lines[number + 1 :]])
        error = find_error(text)
        refused += bool(error)
        assert not error or error.startswith("line ")
    # A text may be anything, but nothing is both a text and a number.
    assert refused >= 8
