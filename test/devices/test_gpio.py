"""A GPIO line as the holder, as far as a kernel without GPIO lets it be tested.

No line has been switched here: what is tested is what the rig file says, and every way in which a
line is not to be had.
"""

import errno
import os
import sys
from pathlib import Path
from types import ModuleType

import pytest

from impact_rig.configuration.toml_table import TomlTable, parse_toml_table
from impact_rig.core.errors import DeviceError, ParameterError
from impact_rig.devices.gpio import GpioHolder, explain_refusal
from impact_rig.testing.contract import HammerHolderContract, HolderBench

gpiod = pytest.importorskip("gpiod", reason="the extra `gpio` is not installed")


def read_options(text):
    return parse_toml_table("[holder]\n" + text).take_table("holder")


@pytest.mark.parametrize(
    ("chip", "word"),
    [
        ("/dev/gpiochip4094", "there is no GPIO chip /dev/gpiochip4094"),
        ("/dev/null", "/dev/null is no GPIO chip"),
    ],
)
def test_a_chip_that_is_none_is_named(chip, word):
    holder = GpioHolder(read_options(f'chip = "{chip}"\nline = 3'))
    with pytest.raises(DeviceError, match=word):
        holder.configure()
    holder.close()


@pytest.mark.parametrize("line", [3, "RELEASE"])
@pytest.mark.parametrize(
    ("number", "word"),
    [
        (errno.EACCES, "no permission to open"),
        (errno.EBUSY, "in use by another program"),
        (errno.ENOENT, "has no line"),
        (errno.EINVAL, "cannot be used as an output"),
    ],
)
def test_every_refusal_of_the_kernel_is_one_sentence(line, number, word):
    text = explain_refusal(os.devnull, line, OSError(number, os.strerror(number)))
    assert word in text
    assert os.devnull in text


def test_a_library_of_the_time_before_2_0_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "gpiod", ModuleType("gpiod"))
    with pytest.raises(DeviceError, match=r"one before 2\.0"):
        GpioHolder(read_options("line = 3")).configure()


@pytest.mark.parametrize("action", ["hold", "release", "read_state"])
def test_nothing_is_switched_before_it_is_configured(action):
    with pytest.raises(DeviceError, match="configure the holder first"):
        getattr(GpioHolder(read_options("line = 3")), action)()


def test_the_chips_found_are_those_of_this_computer():
    found = {device.address for device in GpioHolder.find_devices()}
    assert found == {str(path) for path in Path("/dev").glob("gpiochip*")}


@pytest.mark.parametrize(
    ("keys", "word"),
    [
        ("", "lacks line"),
        ("line = -1", "line 2: line of .* between 0 and 4095"),
        ('line = ""', "its number on the chip, or its name"),
        ("line = 3\nactive_low = 1", "line 3: active_low .* true or false"),
        ('line = 3\nenergized = "low"', "one of releases, holds"),
        ("pin = 3", "unknown key 'pin'"),
    ],
)
def test_a_key_that_cannot_be_meant_is_named_with_its_line(keys, word):
    with pytest.raises(ParameterError, match=word):
        GpioHolder(read_options(keys))


class GpioBench(HolderBench):
    """A chip that the kernel simulates: no line of a real one is switched by a test."""

    def get_driver(self):
        return GpioHolder

    def make_holder(self):
        for path in sorted(Path("/dev").glob("gpiochip*")):
            with gpiod.Chip(str(path)) as chip:
                is_simulated = chip.get_info().label.startswith("gpio-sim")
            if is_simulated:
                return GpioHolder(TomlTable({"chip": str(path), "line": 0}, "[holder]"))
        pytest.skip("this kernel simulates no GPIO: load gpio-sim to run this")


class TestGpioHolder(HammerHolderContract):
    @pytest.fixture
    def bench(self):
        with GpioBench() as bench:
            yield bench
