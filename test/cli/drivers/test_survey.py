"""All drivers are listed with what they find, whatever one of them does while it searches."""

import pytest

from impact_rig.cli.drivers.survey import survey_drivers
from impact_rig.devices.found_device import FoundDevice

pytestmark = pytest.mark.usefixtures("foreign_package")


def test_a_driver_of_another_package_is_found_with_its_devices() -> None:
    source, holder = survey_drivers("good")
    assert (source.kind, holder.kind) == ("source", "holder")
    assert (source.name, source.package) == ("good", "bench-drivers")
    assert source.description == "a digitizer of somebody else"
    assert source.example.startswith('[source]\ndriver = "good"')
    assert source.devices == (FoundDevice("here", "digitizer 3000"), FoundDevice("there"))
    assert source.trouble == ""


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("crashing", "it crashed while it searched for devices (signal SIGSEGV)"),
        ("failing", "its search for devices failed: KeyError: 'vendor'"),
        ("silent", "the vendor's service is not running: start it"),
        ("gone", "driver 'gone' of bench-drivers cannot be loaded"),
    ],
)
def test_what_keeps_a_driver_from_searching_is_told(name: str, told: str) -> None:
    (driver,) = survey_drivers(name)
    assert told in driver.trouble
    assert driver.devices == ()


def test_a_library_that_is_missing_is_named_with_the_way_to_get_it() -> None:
    (driver,) = survey_drivers("bare")
    assert "'serial" in driver.trouble
    assert "is not installed" in driver.trouble
    assert driver.advice == 'pip install "pyserial"; all else works without it'


def test_a_search_without_end_is_ended_and_the_others_are_heard() -> None:
    # Generous: of the two that search, only the endless one ever takes so long.
    source, holder = survey_drivers("hanging", timeout=5.0)
    assert source.trouble == "its search for devices did not come to an end"
    assert holder.trouble == ""
    assert len(holder.devices) == 2
