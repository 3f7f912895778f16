"""What `impact-rig devices` prints of drivers and devices."""

import dataclasses
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.text import Text

from impact_rig.cli.drivers.survey import SurveyedDriver
from impact_rig.reporting.terminal.columns import Column
from impact_rig.reporting.terminal.console import ALARM, GOOD, WARNING, print_table
from impact_rig.results.numbers import MISSING

TITLES = {"source": "Acceleration sources", "holder": "Hammer holders"}
READY = "ready"
NOT_READY = "not ready"


def print_drivers(console: Console, drivers: Sequence[SurveyedDriver]) -> None:
    """Print all drivers, then the devices that they have found."""
    for kind, title in TITLES.items():
        _print_kind(console, title, [driver for driver in drivers if driver.kind == kind])
    found = [(driver, device) for driver in drivers for device in driver.devices]
    if not found:
        console.print("No device was found.")
        return
    columns = [
        Column("Driver", [driver.name for driver, _ in found], is_text=True),
        Column("Kind", [driver.kind for driver, _ in found], is_text=True),
        Column("Address", [device.address for _, device in found], is_text=True),
        Column("Device", [device.identity or MISSING for _, device in found], is_text=True),
    ]
    print_table(console, f"Devices found: {len(found)}", columns)


def _print_kind(console: Console, title: str, drivers: Sequence[SurveyedDriver]) -> None:
    columns = [
        Column("Driver", [driver.name for driver in drivers], is_text=True),
        Column("For", [driver.description or MISSING for driver in drivers], is_text=True),
        Column(
            "State",
            [NOT_READY if driver.trouble else READY for driver in drivers],
            is_text=True,
            styles=[WARNING if driver.trouble else GOOD for driver in drivers],
        ),
        Column("Package", [driver.package for driver in drivers], is_text=True, is_optional=True),
    ]
    notes = [
        f"{driver.name}: {_describe_trouble(driver)}." for driver in drivers if driver.trouble
    ]
    print_table(console, title, columns, notes)


def print_driver(console: Console, driver: SurveyedDriver) -> None:
    """Print one driver, what it finds, and the table of a rig file to copy."""
    console.print(Text(f"{driver.name}, a {driver.kind} of {driver.package}", style="bold"))
    if driver.description:
        console.print(Text(driver.description))
    if driver.trouble:
        console.print(Text(_describe_trouble(driver), style=ALARM))
    for device in driver.devices:
        console.print(Text(f"found: {device.address}  {device.identity}".rstrip()))
    if driver.example:
        console.print()
        # As it is, to be copied: no line is broken.
        console.print(Text(driver.example.strip()), soft_wrap=True)
    console.print()


def drivers_to_json(drivers: Sequence[SurveyedDriver]) -> list[dict[str, Any]]:
    """Return the drivers as plain values."""
    return [dataclasses.asdict(driver) for driver in drivers]


def _describe_trouble(driver: SurveyedDriver) -> str:
    return "; ".join(text for text in (driver.trouble, driver.advice) if text)
