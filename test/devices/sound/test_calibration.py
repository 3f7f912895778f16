"""A count is an acceleration by the rig file, or by what the device's own name says."""

import numpy as np
import pytest

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.errors import ParameterError
from impact_rig.core.setup.sensors import Sensor
from impact_rig.devices.acceleration_source import SourceChannel
from impact_rig.devices.sound.calibration import find_count_scale
from impact_rig.devices.sound.name_calibration import NameCalibration, find_name_calibrations

GRAVITY = 9.80665
PLACE = "[source.hammer]"


def make_channel(sensor: Sensor, mass: float = float("nan"), **options) -> SourceChannel:
    return SourceChannel("1", sensor, mass, TomlTable(options, PLACE))


def test_a_voltage_is_one_by_the_input_range():
    sensor = Sensor("hammer", unit="g", sensitivity=0.01, full_scale=500.0)
    found = find_count_scale(make_channel(sensor, input_range="1.4 V"), None)
    assert found.scale * 2**31 == pytest.approx(140 * GRAVITY)
    assert found.full_scale == pytest.approx(140 * GRAVITY)
    found = find_count_scale(make_channel(sensor, input_range="10 V"), None)
    assert found.full_scale == pytest.approx(500 * GRAVITY), "the sensor takes no more"


def test_a_force_needs_the_hammer_s_mass():
    sensor = Sensor("hammer", "force", "N", -0.002)
    found = find_count_scale(make_channel(sensor, 0.1, input_range="1 V"), None)
    assert found.scale * 2**31 == pytest.approx(-1.0 / 0.002 / 0.1)
    assert found.full_scale == pytest.approx(5000.0)


def test_without_a_sensitivity_the_full_scale_is_the_largest_count():
    sensor = Sensor("hammer", unit="g", full_scale=20.0)
    found = find_count_scale(make_channel(sensor), NameCalibration("m/s^2", 1.0))
    assert found.scale * 2**31 == pytest.approx(20 * GRAVITY)


def test_a_voltage_without_a_range_is_refused_unless_the_device_knows_it():
    channel = make_channel(Sensor("hammer", unit="g", sensitivity=0.1))
    with pytest.raises(ParameterError, match="lacks input_range"):
        find_count_scale(channel, None)
    found = find_count_scale(channel, NameCalibration("V", 5.0))
    assert found.full_scale == pytest.approx(50 * GRAVITY)


def test_a_sensor_of_which_nobody_knows_the_scale_is_refused():
    for known in (None, NameCalibration("V", 5.0)):
        with pytest.raises(ParameterError, match=r"\[source.hammer\] says neither sensitivity"):
            find_count_scale(make_channel(Sensor("hammer")), known)
    known = NameCalibration("m/s^2", 100.0)
    assert find_count_scale(make_channel(Sensor("hammer")), known).full_scale == 100.0


def test_an_unknown_key_of_a_channel_is_refused():
    with pytest.raises(ParameterError, match="did you mean 'input_range'"):
        find_count_scale(make_channel(Sensor("hammer"), input_rnage="1 V"), None)


@pytest.mark.parametrize(("bits", "is_overloaded"), [(16, True), (24, True), (32, True)])
def test_the_largest_count_of_every_converter_is_an_overload(bits, is_overloaded):
    scale = find_count_scale(make_channel(Sensor("hammer", full_scale=1.0)), None)
    unused = 32 - bits
    for rail in ((2 ** (bits - 1) - 1) << unused, -(2**31)):
        counts = np.array([0, rail], np.int64).astype(np.int32)
        assert scale.make_block(counts).overloaded is is_overloaded
    below = np.array([int(0.999 * 2**31), -int(0.999 * 2**31)], np.int32)
    assert not scale.make_block(below).overloaded


def test_a_usb_accelerometer_brings_its_calibration():
    # Counts of 24 bits per m/s^2: of full scale there are 2^23.
    name = "333D01 10123454277085540260301"
    first, second = find_name_calibrations(f"{name}: USB Audio (hw:1,0)")
    assert (first.unit, second.unit) == ("m/s^2", "m/s^2")
    assert first.full_scale / GRAVITY == pytest.approx(20.0, rel=1e-4)
    assert second.full_scale / GRAVITY == pytest.approx(10.0, rel=1e-4)


def test_a_usb_voltage_input_brings_its_calibration():
    for form, factor in (("2", 1), ("3", 20)):
        parts = ("485B39_", form, "000123", "0838861", "1677722", "260301")
        name = "".join(parts)
        first, second = find_name_calibrations(name)
        assert first.unit == "V"
        assert first.full_scale == pytest.approx(10.0 / factor, rel=1e-5)
        assert second.full_scale == pytest.approx(5.0 / factor, rel=1e-5)


@pytest.mark.parametrize("name", ["USB Audio", "333D01", "333D01 1012345000000000026030"])
def test_a_name_without_a_calibration_says_nothing(name):
    assert find_name_calibrations(name) == ()
