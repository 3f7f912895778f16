"""A rig file says in units what the rig is; what cannot be meant is refused by name."""

from dataclasses import asdict

import pytest

from impact_rig.configuration.rig_file import parse_rig_file, read_rig_file, read_template
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.core.setup.paper import PAPER_SETUP

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
    assert rig.setup.hammer_mass_uncertainty == 0.0
    assert rig.setup.samples.accelerometer_mass_uncertainty == 0.0
    assert rig.setup.samples.find("oak").mass_uncertainty == 0.0
    assert rig.setup.clock_uncertainty == pytest.approx(100e-6 / 3**0.5, rel=5e-3)
    assert rig.setup.analysis == PAPER_SETUP.analysis
    assert dict(rig.virtual) == {}


def test_uncertainties_of_masses_and_clock_are_stated_beside_them():
    text = SMALLEST.replace('mass = "0.1 kg"', 'mass = "0.1 kg"\nmass_uncertainty = "0.2 g"')
    text = text.replace('mass = "80 g"', 'mass = "80 g"\nmass_uncertainty = "3 mg"')
    text += '[samples]\naccelerometer_mass = "3 g"\naccelerometer_mass_uncertainty = "0.1 g"\n'
    text += "[digitizer]\nclock_uncertainty = 1e-6\n"
    setup = parse_rig_file(text).setup
    assert setup.hammer_mass_uncertainty == pytest.approx(2e-4)
    assert setup.samples.find("oak").mass_uncertainty == pytest.approx(3e-6)
    assert setup.samples.accelerometer_mass_uncertainty == pytest.approx(1e-4)
    assert setup.clock_uncertainty == 1e-6


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('mass = "80 g"', 'mas = "80 g"', r"sample 'oak' has an unknown key 'mas'.*'mass'"),
        ('mass = "80 g"', 'mass = "80 mm"', r'mass of sample \'oak\' is "80 mm", which is no kg'),
        ('mass = "80 g"', "mass = 80", r"is 80, which has no unit.*21.31 g"),
        ('mass = "80 g"', 'mass = "-80 g"', r"mass of sample 'oak' is -0.08.*above zero"),
        ('mass = "80 g"', 'mass = "0 g"', r"mass of sample 'oak' is 0.0.*above zero"),
        ('mass = "80 g"', 'mass = "heavy"', r'"heavy", which cannot be read'),
        ('mass = "80 g"', 'mass = "80 g("', r"cannot be read as number and unit"),
        ('mass = "80 g"', "", r"sample 'oak' lacks mass"),
        ('mass = "80 g"', 'mass = "80 g"\nmass_uncertainty = "-1 g"',
         r"mass uncertainty of sample 'oak' is -0.001.*0 or more"),
        ('mass = "80 g"', 'mass = "80 g"\nmass_uncertainty = "5 %"', r"cannot be read|no kg"),
        ("[hammer]", '[digitizer]\nclock_uncertainty = "1 s"\n[hammer]', r"plain number.*58e-6"),
        ("[hammer]", "[digitizer]\nclock = 1\n[hammer]", r"unknown key 'clock'"),
        ('name = "oak"', 'name = ""', r"empty name"),
        ('mass = "0.1 kg"', "", r"\[hammer\] lacks mass"),
        ("[hammer]", "[hamer]", r"unknown key 'hamer': did you mean 'hammer'"),
        ("[hammer]", "[hammer", r"this is no TOML"),
        ("[hammer]", '[samples]\ncontrol = "tin"\n[hammer]', r"control sample 'tin' is missing"),
        ("[hammer]", "[analysis]\npulse_factor = true\n[hammer]", r"must be a plain number"),
        ("[hammer]", "[analysis]\npulse_factor = 9\n[hammer]", r"pulse_factor is 9.*between"),
        ("[hammer]", '[analysis]\ncutoff_frequency = "50 us"\n[hammer]', r"which is no Hz"),
        ("[hammer]", "[analysis]\noverload_run = 2.5\n[hammer]", r"overload_run.*whole"),
        ("[hammer]", "[analysis]\nkeep_hits = 9.5\n[hammer]", r"keep_hits.*whole"),
        ("[hammer]", 'name = 3\n[hammer]', r"name of the file is 3: it must be a text"),
        ('[[sample]]\nname = "oak"\nmass = "80 g"', "", r"sample set is empty"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_named_with_its_value(old, new, message):
    assert old in SMALLEST
    with pytest.raises(ParameterError, match=message):
        parse_rig_file(SMALLEST.replace(old, new))


def test_two_samples_of_one_name_are_refused():
    with pytest.raises(ParameterError, match="'oak' appears twice"):
        parse_rig_file(SMALLEST + '[[sample]]\nname = "oak"\nmass = "90 g"\n')


def test_the_file_is_named_in_every_error(tmp_path):
    with pytest.raises(FileError, match=r"there is no rig file .*absent\.toml"):
        read_rig_file(tmp_path / "absent.toml")
    path = tmp_path / "bad.toml"
    path.write_text(SMALLEST.replace("80 g", "80 m"), "utf-8")
    with pytest.raises(FileError, match=r"bad\.toml: mass of sample 'oak'"):
        read_rig_file(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError, match=r"bad\.toml cannot be read"):
        read_rig_file(path)
