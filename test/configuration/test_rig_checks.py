"""Mistakes in a rig file, each with the line that tells it."""

import re

import pytest

from impact_rig.configuration.rig_checks import check_rig, require_rig
from impact_rig.configuration.rig_file import load_rig_file, parse_rig_file, read_template
from impact_rig.core.given.errors import ParameterError

RIG = """\
[hammer]
mass = "113 g"
mass_uncertainty = "0.1 g"
impact_speed = "8.19 cm/s"
release_angle = "3.7 deg"
[digitizer]
clock_uncertainty = 5e-5
[samples]
control = "steel"
accelerometer_mass = "3 g"
[analysis]
cutoff_frequency = "50 kHz"
pre_trigger = "200 us"
record_duration = "2 ms"
detection_level = 0.03
minimum_peak = 0.15
maximum_peak = 0.95
double_hit_level = 0.02
[source]
driver = "scpi"
address = "192.168.1.20:5000"
sampling_rate = "2.5 MHz"
pre_trigger = "300 us"
record_duration = "2.1 ms"
trigger_level = "5 g"
[source.hammer]
channel = 1
sensitivity = "10 mV/g"
full_scale = "200 g"
serial_number = "LW 1"
sensitivity_uncertainty = 0.01
resonance = "70 kHz"
low_corner = "0.5 Hz"
upper_corner = "100 kHz"
[source.specimen]
channel = 2
sensitivity = "10 mV/g"
full_scale = "200 g"
serial_number = "LW 2"
[holder]
driver = "serial"
port = "/dev/ttyUSB0"
[[sample]]
name = "steel"
mass = "110 g"
mass_uncertainty = "0.01 g"
reference_contact_time = "170 us"
[[sample]]
name = "brass"
mass = "180 g"
reference_contact_time = "228 us"
"""
"""A rig of which nothing is wrong."""


def change(old: str, new: str) -> str:
    """Return the rig file with the first of some words in others."""
    assert old in RIG
    return RIG.replace(old, new, 1)


FITTING = change('"228 us"', '"228 us"\nreference_stiffness = "20.80 MN/m"')  # by 0.9 %
GOOD = load_rig_file(None), *map(parse_rig_file, (RIG, FITTING, read_template()))


@pytest.mark.parametrize("rig", GOOD, ids=["the paper's", "a whole one", "fitting", "template"])
def test_of_a_good_rig_nothing_is_said(rig):
    assert check_rig(rig) == ()


UNREADABLE = [
    ('mass = "113 g"', "mass = 113", r"line 2: mass of \[hammer"),
    ('mass = "113 g"', 'mass = "113 s"', r"line 2: mass of \[hammer\]"),
    ('mass = "113 g"', 'mass = "-113 g"', r"line 2: hammer mass"),
    ('mass = "113 g"', 'mas = "113 g"', r"line 2: .*unknown key 'mas': did you mean 'mass'"),
    ('release_angle = "3.7 deg"', 'release_angle = "95 deg"', r"line 5: release angle is 95°"),
    ('"steel"', '"stele"', r"line 9: control sample 'stele' is missing .*'steel', 'brass'"),
    ('name = "brass"', 'name = "steel"', r"line \d+: .*appears twice"),
    ('mass = "180 g"\n', "", r"line 48: .*lacks mass"),
    ('cutoff_frequency = "50 kHz"', "cutoff_frequency = 50", r"line 12: cutoff_frequency"),
    ("minimum_peak = 0.15", "minimum_peak = 1.5", r"line 16: .*between"),
    ("maximum_peak = 0.95", "maximum_peak = 0.1", r"line 17: .*above the minimum_peak"),
    ('pre_trigger = "200 us"', 'pre_trigger = "3 ms"', r"line 13: .*shorter than record_duration"),
    ('"10 mV/g"', '"10 mV"', r"line 28: sensitivity"),
    ('"10 mV/g"', '"0 mV/g"', r"line 28: sensitivity"),
    ('full_scale = "200 g"', 'full_scale = "200 N"', r"line 29: full_scale"),
    ("channel = 1\n", 'quantity = "speed"\nchannel = 1\n', r"line 27: quantity"),
    ('"3.7 deg"', '"3.7 deg"\nimpact_speed_uncertainty = "9 cm/s"',
     r"line 6: impact speed uncertainty is 0.09 m/s: it must be less"),
    ("[holder]", "[check_mass]\nmas = 3\n[holder]", r"line 41: .*unknown key 'mas': did you mean"),
    ("[holder]", "[check_mass]\n[holder]", r"line 40: \[check_mass\] lacks mass"),
    ("[holder]", '[check_mass]\nmass = "0 g"\n[holder]', r"line 41: mass of sample 'check mass'"),
    ("[holder]", "[holde]", r"line 40: .*'holde': did you mean 'holder'"),
    ("[source.specimen]\n", "[source.specimen\n", r"line 35"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "told"), UNREADABLE)
def test_what_cannot_be_meant_is_refused_with_its_line(old, new, told):
    with pytest.raises(ParameterError, match=told):
        parse_rig_file(change(old, new))


IMPOSSIBLE = [
    ("channel = 2", "channel = 1", "line 36: channel of [source.specimen] is '1', the hammer's"),
    ('"50 kHz"', '"1.5 MHz"', "line 12: cutoff_frequency of [analysis] is 1.5e+06 Hz: at"),
    ('"50 kHz"', '"1.1 MHz"', "it must be 1e+06 Hz or less"),
    ('"2.5 MHz"', '"96 kHz"', "line 12: cutoff_frequency of [analysis] is 50000 Hz: at 96000"),
    ('"2.5 MHz"', '"30 kHz"', "line 22: sampling_rate of [source] is 30000 Hz: the 6.0 points"),
    ('"2.5 MHz"', '"30 kHz"', "the shortest expected pulse has 2.5 points at half amplitude"),
    ('pre_trigger = "300 us"', 'pre_trigger = "100 us"',
     "line 23: pre_trigger of [source] is 100 µs: the analysis keeps 200 µs"),
    ('"2.1 ms"', '"1 ms"', "line 24: record_duration of [source] leaves 0.7 ms after the"),
    ('record_duration = "2 ms"', 'record_duration = "0.5 ms"',
     "line 14: record_duration of [analysis] leaves 300 µs after the impact begins: a contact of"),
    ("detection_level = 0.03", "detection_level = 0.2",
     "line 15: detection_level of [analysis] is 0.2: hits begin there, it must be below"),
    ('"5 g"', '"300 g"', "line 25: trigger_level of [source] is 150 % of the hammer's full_s"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "told"), IMPOSSIBLE)
def test_what_cannot_work_is_a_fault_with_its_line(old, new, told):
    rig = parse_rig_file(change(old, new))
    assert any(told in note.text for note in check_rig(rig) if note.is_fault), check_rig(rig)
    with pytest.raises(ParameterError, match=re.escape(told)):
        require_rig(rig)


BARRIER = """\
[source.impact_speed]
channel = 3
distance = "5 mm"
[check_mass]
mass = "150 g"
[holder]
"""
"""A light barrier and a check mass, in a rig of which nothing is wrong; they begin in line 40."""


def add(text: str) -> str:
    """Return the rig file with a light barrier and a check mass."""
    return change("[holder]\n", text)


def test_of_a_light_barrier_and_a_check_mass_nothing_is_said():
    stated = add(BARRIER).replace('"LW 2"', '"LW 2"\nsensitivity_uncertainty = 0.015')
    assert check_rig(parse_rig_file(stated)) == ()


BARRED = [
    ("channel = 3", "channel = 2", True, "line 41: channel of [source.impact_speed] is '2', the"),
    ("channel = 3", "channel = 1", True, "line 41: channel of [source.impact_speed] is '1', the"),
    ('"5 mm"', '"50 mm"', True, "line 42: distance of [source.impact_speed] is 50 mm: the ham"),
    ('"5 mm"', '"1 um"', False, "line 42: distance of [source.impact_speed] is 0.001 mm: from"),
    ('"150 g"', '"150 kg"', False, "line 44: mass of [check_mass] is 1.5e+05 g beside a hammer"),
    ('"150 g"', '"1.5 g"', False, "line 44: mass of [check_mass] is 1.5 g beside a hammer of"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "is_fault", "told"), BARRED)
def test_mistakes_of_barrier_and_check_mass_are_named_with_their_line(old, new, is_fault, told):
    assert old in BARRIER
    notes = check_rig(parse_rig_file(add(BARRIER.replace(old, new, 1))))
    assert any(told in note.text for note in notes if note.is_fault is is_fault), notes


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        *(("5 mm", way, "line 42: distance") for way in ("0 mm", "-5 mm")),
        *(("2.5 MHz", rate, "line 22: sampling_rate") for rate in ("0 Hz", "-1 MHz")),
    ],
)
def test_a_barrier_without_a_way_and_a_rate_that_is_none_are_refused(old, new, told):
    rig = parse_rig_file(add(BARRIER).replace(old, new, 1))
    with pytest.raises(ParameterError, match=f"{told} of .* is '{new}': it must"):
        check_rig(rig)


def test_the_virtual_rig_has_a_rate_where_the_file_states_none():
    text = read_template().replace('cutoff_frequency = "50 kHz"', 'cutoff_frequency = "2 MHz"')
    with pytest.raises(ParameterError, match=r"line \d+: cutoff_frequency .* at 2.5e\+06 Hz"):
        require_rig(parse_rig_file(text))


def test_a_sample_may_not_be_called_as_the_check_mass():
    text = add(BARRIER).replace('name = "brass"', 'name = "check mass"')
    _, note = check_rig(parse_rig_file(text))
    assert note.is_fault
    assert "line 54: a sample is called 'check mass', as that of [check_mass]" in note.text


SPECIMEN = RIG[RIG.index("[source.specimen]") : RIG.index("[holder]")]
HOLDER = RIG[RIG.index("[holder]") : RIG.index("[[sample]]")]
SOURCE = RIG[RIG.index("[source]") : RIG.index("[holder]")]
UNWISE = [
    ('mass = "110 g"', 'mass = "210 g"', "line 9: the control sample 'steel' of 213 g is not"),
    ('control = "steel"\n', "", "line 8: [samples] names no control sample: contact times"),
    ('mass = "180 g"', 'mass = "110 kg"', "line 50: mass of sample 'brass' is 1.1e+05 g beside"),
    ('mass = "180 g"', 'mass = "180 mg"', "line 50: mass of sample 'brass' is 0.18 g beside"),
    ('mass = "113 g"', 'mass = "113 kg"', "line 2: mass of [hammer] is 113 kg: a pendulum"),
    ('"0.1 g"', '"10 g"', "line 3: mass_uncertainty of [hammer] is 8.85 % of the mass"),
    ('"8.19 cm/s"', '"8.19 km/h"', "line 5: release_angle of [hammer] is that of a pen"),
    ('"8.19 cm/s"', '"81.9 m/s"', "line 4: impact_speed of [hammer] is 81.9 m/s: a pendulum"),
    ('"3.7 deg"', '"3.7 deg"\nimpact_speed_uncertainty = "3 cm/s"',
     "line 6: impact_speed_uncertainty of [hammer] is 36.6 % of the speed: a light barrier"),
    ("clock_uncertainty = 5e-5", "clock_uncertainty = 0.05", "line 7: clock_uncertainty of"),
    ('"3 g"', '"3 kg"', "line 10: accelerometer_mass of [samples] is 3000 g, beside sample"),
    ('"0.01 g"', '"10 g"', "line 46: mass_uncertainty of sample 'steel' is 9.09 % of the mass"),
    ('"50 kHz"', '"5 kHz"', "line 12: cutoff_frequency of [analysis] is 5000 Hz: it widens a"),
    ("double_hit_level = 0.02", "double_hit_level = 0.5", "line 18: double_hit_level of"),
    ("maximum_peak = 0.95", "maximum_peak = 1.0", "line 17: maximum_peak of [analysis] is 1: it"),
    ('record_duration = "2 ms"', 'record_duration = "2 s"', "line 14: record_duration of [anal"),
    ('"2.1 ms"', '"20 ms"', "line 24: record_duration of [source] leaves 19.7 ms after the"),
    ('"2.5 MHz"', '"110 kHz"', "line 22: sampling_rate of [source] is 110000 Hz: the shortest"),
    ('"5 g"', '"50 g"', "line 25: trigger_level of [source] is 25 % of the hammer's full_scale"),
    ('"5 g"', '"0.05 g"', "line 25: trigger_level of [source] is 0.025 % of the hammer's"),
    ('"200 g"', '"5000 g"', "line 29: hits on 'brass' will reach about"),
    ('"200 g"', '"20 g"', "the hammer's full_scale is 196.1 m/s²: swing lower, or use a less"),
    ('"10 mV/g"', '"10 V/g"', "line 28: sensitivity times full_scale of [source.hammer] is 2000"),
    (SPECIMEN, SPECIMEN.replace("mV", "uV"), "line 37: sensitivity times full_scale of [source.s"),
    ("sensitivity_uncertainty = 0.01", "sensitivity_uncertainty = 0.5", "line 31: sensitivity_u"),
    ('"70 kHz"', '"30 kHz"', "line 32: resonance of [source.hammer] is 30000 Hz, below the low"),
    ('"0.5 Hz"', '"500 Hz"', "line 33: low_corner of [source.hammer] is 500 Hz: a contact of"),
    ('"100 kHz"', '"5 kHz"', "line 34: upper_corner of [source.hammer] is 5000 Hz: it widens a"),
    ('"LW 2"', '"LW 1"', "line 39: serial_number of [source.specimen] is 'LW 1', the hammer"),
    ('name = "brass"', 'name = "Steel "', "line 49: samples 'steel' and 'Steel ' differ in space"),
    ('"228 us"', '"228 ms"', "reference_contact_time of sample 'brass' is 2.28e+05 µs: metal"),
    ('"228 us"', '"228 us"\nreference_stiffness = "20.95 MN/m"',
     "line 51: reference_contact_time of sample 'brass' is 228 µs: by the masses, the hammer's"),
    ("[holder]", '[check_mass]\nmass = "150 g"\n[holder]',
     "the check mass ends undecided unless sensitivity_uncertainty stands in [source.specimen]"),
    (SPECIMEN, "", "line 19: [source] has no [source.specimen]: only the hammer is measured"),
    (HOLDER, "", "line 20: [source] measures, and nothing lets a hammer go: add [holder]"),
    (SOURCE, "", "line 20: [holder] moves a real hammer, and the accelerations are of the"),
    ("sensitivity_uncertainty = 0.01", "calibration_date = 2001-01-01", "calibrated on 2001-01"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "told"), UNWISE)
def test_what_is_unwise_is_a_warning_with_its_line(old, new, told):
    notes = check_rig(parse_rig_file(change(old, new)))
    assert any(told in note.text for note in notes if not note.is_fault), notes


def test_what_is_recorded_is_looked_at_unless_the_file_says_otherwise():
    text = change('"2.1 ms"', '"20.3 ms"').replace('record_duration = "2 ms"\n', "")
    rig = parse_rig_file(text)
    assert rig.setup.analysis.record_duration == pytest.approx(20.2e-3)
    assert check_rig(rig) == ()
