"""A new sensitivity changes two lines of a rig file, and no other byte."""

import difflib
import tomllib
from pathlib import Path

import pytest

from impact_rig.configuration.sheet_change import change_sheet, name_new_file
from impact_rig.core.errors import FileError, ParameterError

TEXT = """\
# my rig: "quoted", [bracketed], sensitivity = "1 mV/g"
[source]
driver = "scpi"
[source.hammer]
channel = 1
  sensitivity = "10 mV/g"   # of the old sheet
serial_number = "LW 1"
  calibration_date = 2025-03-01  # and its day
[source.specimen]
sensitivity='-2.25e1 mV / (m/s^2)' # inline
[[sample]]
name = "sensitivity = 3"
"""


def find_changes(old, new):
    return [line for line in difflib.ndiff(old.split("\n"), new.split("\n")) if line[0] in "+-"]


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_the_lines_of_the_sheet_change_and_nothing_else(end):
    old = TEXT.replace("\n", end)
    tail = end.removesuffix("\n")
    new = change_sheet(old, "hammer", 0.0102345678, "2026-11-21")
    assert find_changes(old, new) == [
        '-   sensitivity = "10 mV/g"   # of the old sheet' + tail,
        '+   sensitivity = "10.2346 mV/g"   # of the old sheet' + tail,
        "-   calibration_date = 2025-03-01  # and its day" + tail,
        "+   calibration_date = 2026-11-21  # and its day" + tail,
    ]
    read = tomllib.loads(new)["source"]["hammer"]
    assert read["calibration_date"].isoformat() == "2026-11-21"


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_date_that_was_not_there_stands_below_the_sensitivity(end):
    old = TEXT.replace("\n", end)
    tail = end.removesuffix("\n")
    new = change_sheet(old, "specimen", -0.0226, "2026-11-21")
    assert find_changes(old, new) == [
        "- sensitivity='-2.25e1 mV / (m/s^2)' # inline" + tail,
        '+ sensitivity="-22.6 mV / (m/s^2)" # inline' + tail,
        "+ calibration_date = 2026-11-21" + tail,
    ]


@pytest.mark.parametrize(
    ("written", "voltage", "expected"),
    [
        ("10 mV/g", 0.011, "11 mV/g"),
        ("0.01 V/g", 0.011, "0.011 V/g"),
        ("2.25mV/N", 0.002, "2 mV/N"),
        ("1500 µV/N", 0.002, "2000 µV/N"),
        ("-10 mV/(m/s²)", -0.01025, "-10.25 mV/(m/s²)"),
    ],
)
def test_the_units_stay_as_they_are_written(written, voltage, expected):
    text = f'[source.hammer]\nsensitivity = "{written}"\ncalibration_date = "2020-01-01"\n'
    read = tomllib.loads(change_sheet(text, "hammer", voltage, "2026-11-21"))
    assert read["source"]["hammer"]["sensitivity"] == expected


def test_a_table_in_one_line_is_changed_too():
    text = '[source]\nhammer = { sensitivity = "10 mV/g", calibration_date = "2020-01-01" }\n'
    new = change_sheet(text, "hammer", 0.02, "2026-11-21")
    assert new == '[source]\nhammer = { sensitivity = "20 mV/g", calibration_date = 2026-11-21 }\n'


@pytest.mark.parametrize(
    "text",
    [
        '[source]\nhammer = { sensitivity = "10 mV/g" }\n',
        'source.specimen = {sensitivity = "3 mV/g"}\nsource.hammer.sensitivity = "10 mV/g"\n',
        '[source]\nspecimen.hidden = "sensitivity = 1"\nhammer.sensitivity = """\n10 mV/g"""\n',
    ],
)
def test_what_cannot_be_changed_by_itself_is_left_to_a_person(text):
    with pytest.raises(FileError, match=r'"20 mV/g" and calibration_date = .* by hand'):
        change_sheet(text, "hammer", 0.02, "2026-11-21")


def test_a_sensor_without_a_sensitivity_has_nothing_to_change():
    with pytest.raises(ParameterError, match=r"line 1: \[source.hammer\] has no sensitivity"):
        change_sheet('[source.hammer]\nfull_scale = "5 g"\n', "hammer", 0.02, "2026-11-21")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("bench/rig.toml", "bench/rig-2026-11-21.toml"),
        ("rig-2026-03-01.toml", "rig-2026-11-21.toml"),
        ("my-rig", "my-rig-2026-11-21"),
    ],
)
def test_the_new_file_has_the_day_in_its_name(old, new):
    assert name_new_file(Path(old), "2026-11-21") == Path(new)
