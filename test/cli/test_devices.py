"""`impact-rig devices`: drivers and what they find, one driver, and the devices of a rig file."""

from pathlib import Path

import pytest

from impact_rig.cli.devices import survey_drivers

MODULE = '''
from impact_rig.core.given.errors import DeviceError
from impact_rig.devices.protocols import Acquisition
from impact_rig.devices.protocols import FoundDevice
from impact_rig.devices.protocols import HolderState

class Good:
    description = "a digitizer of another package"
    example = """[source]\\ndriver = "good"\\nport = 7   # its own key\\n"""
    is_by_hand = False
    hammerless = False

    def __init__(self, options):
        options.check_keys("port")
        self.port = options.take_whole("port", 1, 9, 7)

    @classmethod
    def find_devices(cls):
        print("what a vendor's library says")
        return (FoundDevice("here", "digitizer 3000"), FoundDevice("there"))

    def configure(self, plan=None):
        if self.port == 8:
            raise DeviceError("the digitizer at port 8 does not answer: switch it on")
        if self.port == 9:
            import no_such_library
        return Acquisition("digitizer 3000", 0.5 * plan.sampling_rate) if plan else "holder 3000"

    def read_state(self):
        return HolderState.RELEASED if self.port == 6 else HolderState.HOLDING

    def release(self):
        raise AssertionError("this was not asked for")

    def close(self):
        open(f"closed", "a").write(f"{self.port}")

class Failing(Good):
    @classmethod
    def find_devices(cls):
        raise KeyError("vendor")

class Silent(Good):
    @classmethod
    def find_devices(cls):
        raise DeviceError("the vendor's service is not running: start it")
'''
SOURCES = ("good", "failing", "silent")


@pytest.fixture
def foreign_package(tmp_path, monkeypatch):
    """Install the package for this process and those that it starts."""
    folder = tmp_path / "site"
    info = folder / "bench_drivers-1.0.dist-info"
    info.mkdir(parents=True)
    (folder / "bench_drivers.py").write_text(MODULE)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: bench-drivers\nVersion: 1.0\n")
    lines = [f"{name} = bench_drivers:{name.title()}" for name in SOURCES]
    gone = "gone = bench_drivers:NotThere"
    (info / "entry_points.txt").write_text(
        "\n".join(["[impact_rig.acceleration_sources]", *lines, gone,
                   "[impact_rig.hammer_holders]", "good = bench_drivers:Good"])
    )  # fmt: skip
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setenv("PYTHONPATH", str(folder), prepend=":")
    monkeypatch.chdir(tmp_path)
    return folder


pytestmark = pytest.mark.usefixtures("foreign_package")


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("failing", "its search for devices failed: KeyError: 'vendor'"),
        ("silent", "the vendor's service is not running: start it"),
        ("gone", "driver 'gone' of bench-drivers cannot be loaded"),
    ],
)
def test_what_keeps_a_driver_from_searching_is_told(name, told):
    (driver,) = survey_drivers(name)
    assert told in driver.trouble
    assert driver.devices == ()


RIG = """\
[hammer]
mass = "0.1 kg"
impact_speed = "30 cm/s"
[[sample]]
name = "oak"
mass = "80 g"
[source]
driver = "good"
sampling_rate = "1 MHz"
trigger_level = "5 g"
[source.hammer]
sensitivity = "10 mV/g"
serial_number = "LW 7"
calibration_date = 2020-03-01
[holder]
driver = "good"
"""


def write_rig(folder, text=RIG):
    path = folder / "rig.toml"
    path.write_text(text)
    return path


def test_one_driver_is_shown_with_a_table_to_copy(run):
    outcome = run("devices", "good")
    assert outcome.exit_code == 0
    text = " ".join(outcome.stdout.split())
    assert "good source a digitizer of another package ready" in text
    assert "good holder here digitizer 3000" in text
    assert '[source]\ndriver = "good"\nport = 7   # its own key\n' in outcome.stdout


def test_the_list_fits_a_terminal_and_names_what_is_not_ready(run):
    outcome = run("devices")
    assert outcome.exit_code == 0
    assert max(map(len, outcome.stdout.splitlines())) <= 80
    text = " ".join(outcome.stdout.split())
    assert "silent: the vendor's service is not running: start it." in text
    assert "here digitizer 3000" in text


def test_a_check_opens_both_devices_says_what_they_are_and_closes_them(run, tmp_path):
    outcome = run("devices", "--check", write_rig(tmp_path))
    assert outcome.exit_code == 0
    text = " ".join(outcome.stdout.split())
    assert "ok source driver good device digitizer 3000" in text
    assert "rate 500 kHz, 1000 kHz requested" in text
    assert "hammer acceleration, 10 mV per g, serial number LW 7" in text
    assert "specimen not measured" in text
    assert "ok holder driver good device holder 3000 state it holds" in text
    assert "warning: the hammer sensor LW 7 was calibrated on 2020-03-01, over a year" in text
    assert Path("closed").read_text() == "77"


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('driver = "good"\ns', 'driver = "god"\ns', "rig.toml: line 8: driver of [source] is"),
        ('"1 MHz"', '"1 MHz"\nport = 10', "rig.toml: line 10: port of [source] is 10"),
        ('"1 MHz"', '"1 MHz"\nport = 8', "the digitizer at port 8 does not answer: switch it on"),
        ('"1 MHz"', '"1 MHz"\nport = 9', "the Python package 'no_such_library' is not"),
        ('driver = "good"\ns', 'driver = "gone"\ns', "driver 'gone' of bench-drivers cannot"),
    ],
)
def test_what_is_wrong_with_one_device_is_told_and_the_other_is_tried_all_the_same(
    run, tmp_path, old, new, told
):
    outcome = run("devices", "--check", write_rig(tmp_path, RIG.replace(old, new)))
    assert outcome.exit_code == 1
    # Lines end in the middle of a long path.
    text = "".join(outcome.stdout.split())
    for part in (told, "fault source", "ok holder"):
        assert part.replace(" ", "") in text


def test_a_holder_that_does_not_hold_is_a_fault(run, tmp_path):
    path = write_rig(tmp_path, RIG + "port = 6\n")
    outcome = run("devices", "--check", path)
    assert outcome.exit_code == 1
    assert "the holder holder 3000 does not hold: check its wiring" in outcome.stdout


def test_options_that_contradict_each_other_are_refused(run, tmp_path):
    outcome = run("devices", "good", "--check", write_rig(tmp_path))
    assert (outcome.exit_code, "leave 'good' out" in outcome.stderr) == (2, True)
    outcome = run("devices", "--check", tmp_path / "no.toml")
    assert (outcome.exit_code, "there is no rig file" in outcome.stderr) == (2, True)
