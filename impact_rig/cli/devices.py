"""`impact-rig devices`: drivers, the devices that they find, and those that a rig file names."""

import contextlib
import dataclasses
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import click
from rich.console import Console
from rich.text import Text

from impact_rig.cli.libraries import describe_missing
from impact_rig.configuration.rig_file import RigFile, list_rig_warnings, read_rig_file
from impact_rig.core.errors import DeviceError, ParameterError, RigError
from impact_rig.devices.drivers import (
    HOLDERS,
    SOURCES,
    Driver,
    find_drivers,
    make_device,
    read_driver_name,
)
from impact_rig.devices.protocols import (
    FoundDevice,
    HammerHolder,
    HolderState,
    SourceChannel,
)
from impact_rig.devices.source_table import make_source
from impact_rig.present.terminal.console import (
    ALARM,
    GOOD,
    make_console,
    print_facts,
    print_table,
    print_text,
)
from impact_rig.results.numbers import MISSING
from impact_rig.results.results_file import format_json
from impact_rig.results.tables import Column, make_table, make_text_column

KINDS = {SOURCES: "source", HOLDERS: "holder"}


@dataclass(frozen=True)
class SurveyedDriver:
    """A driver, and the devices that it finds."""

    kind: str  # "source" or "holder"
    name: str  # in the rig file
    package: str  # the distribution that brings it
    description: str = ""
    example: str = ""
    devices: tuple[FoundDevice, ...] = ()
    trouble: str = ""  # why it cannot work or search, and what to do


def survey_drivers(name: str = "") -> list[SurveyedDriver]:
    """Search for devices with the drivers of a name, or with all.

    Raises
    ------
    DeviceError
        If two packages bring drivers of the same name.
    """
    return [
        _survey(KINDS[group], driver)
        for group in KINDS
        for driver in find_drivers(group).values()
        if name in ("", driver.name)
    ]


def _survey(kind: str, driver: Driver) -> SurveyedDriver:
    found = SurveyedDriver(kind, driver.name, driver.package)
    try:
        loaded = driver.load()
        found = replace(found, description=loaded.description, example=loaded.example)
        with contextlib.redirect_stdout(sys.stderr):  # a vendor's library may print
            return replace(found, devices=tuple(loaded.find_devices()))
    except ModuleNotFoundError as error:
        return replace(found, trouble=_describe_missing(error))
    except RigError as error:
        return replace(found, trouble=str(error))
    except Exception as error:  # noqa: BLE001 - a driver of others may raise anything
        trouble = f"its search for devices failed: {type(error).__name__}: {error}"
        return replace(found, trouble=trouble)


Facts = dict[str, str]
"""Facts about a device, by name; an error is the fact `TROUBLE`."""
TROUBLE = "trouble"
SAME_RATE = 1e-6
"""Part by which two equal rates may differ [-]: rounding."""


def _check(rig: RigFile, path: Path, attempt: Callable[[RigFile], Facts]) -> Facts:
    """Open a device of a rig file, and close it again; the hammer stays held."""
    try:
        return attempt(rig)
    except ParameterError as error:
        return {TROUBLE: f"rig file {path}: {error}"}
    except RigError as error:
        return {TROUBLE: str(error)}
    except ModuleNotFoundError as error:
        return {TROUBLE: _describe_missing(error)}


def _try_source(rig: RigFile) -> Facts:
    source, plan = make_source(rig.source, rig.setup)
    with contextlib.closing(source):
        acquisition = source.configure(plan)
    kept = f"{plan.pre_trigger * 1e3:g} ms of it before the trigger"
    specimen = plan.specimen
    return {
        "driver": read_driver_name(rig.source),
        "device": acquisition.identity,
        "rate": _describe_rate(plan.sampling_rate, acquisition.sampling_rate),
        "record": f"{plan.record_duration * 1e3:g} ms, {kept}",
        "trigger": f"{plan.trigger_level:.4g} m/s² of the hammer, either sign",
        "hammer": _describe_channel(plan.hammer),
        "specimen": _describe_channel(specimen) if specimen else "not measured",
    }


def _try_holder(rig: RigFile) -> Facts:
    holder: HammerHolder = make_device(HOLDERS, rig.holder)
    with contextlib.closing(holder):
        identity = holder.configure()
        if holder.read_state() is not HolderState.HOLDING:
            raise DeviceError(f"the holder {identity} does not hold: check its wiring")
    how = "an operator releases the hammer" if holder.is_by_hand else "it holds"
    return {"driver": read_driver_name(rig.holder), "device": identity, "state": how}


def _describe_rate(wanted: float, real: float) -> str:
    text = f"{real * 1e-3:.9g} kHz"
    if abs(real - wanted) > SAME_RATE * wanted:
        text += f", not {wanted * 1e-3:.9g} kHz as requested"
    return text


def _describe_channel(channel: SourceChannel) -> str:
    sensor = channel.sensor.describe()
    return f"channel {channel.name}: {sensor}" if channel.name else sensor


def _describe_missing(error: ModuleNotFoundError) -> str:
    unknown = f"the Python package {error.name!r} is not installed"
    return describe_missing(error.name or "") or unknown


TITLES = {"source": "Acceleration sources", "holder": "Hammer holders"}


def print_drivers(console: Console, drivers: Sequence[SurveyedDriver]) -> None:
    """Print all drivers, then the devices that they have found."""
    for kind, title in TITLES.items():
        _print_kind(console, title, [driver for driver in drivers if driver.kind == kind])
    found = [(driver, device) for driver in drivers for device in driver.devices]
    if not found:
        console.print("No device was found.")
        return
    columns = [
        make_text_column("Driver", [driver.name for driver, _ in found]),
        make_text_column("Kind", [driver.kind for driver, _ in found]),
        make_text_column("Address", [device.address for _, device in found]),
        make_text_column("Device", [device.identity or MISSING for _, device in found]),
    ]
    print_table(console, make_table(f"Devices found: {len(found)}", columns))


def _print_kind(console: Console, title: str, drivers: Sequence[SurveyedDriver]) -> None:
    columns = [
        make_text_column("Driver", [driver.name for driver in drivers]),
        make_text_column("For", [driver.description or MISSING for driver in drivers]),
        make_text_column(
            "State", ["not ready" if driver.trouble else "ready" for driver in drivers]
        ),
        Column("Package", [driver.package for driver in drivers], is_text=True, is_optional=True),
    ]
    notes = [f"{driver.name}: {driver.trouble}." for driver in drivers if driver.trouble]
    marked = [place for place, driver in enumerate(drivers) if driver.trouble]
    print_table(console, make_table(title, columns, notes, marked))


def print_driver(console: Console, driver: SurveyedDriver) -> None:
    """Print one driver, what it finds, and the table of a rig file to copy."""
    console.print(Text(f"{driver.name}, a {driver.kind} of {driver.package}", style="bold"))
    if driver.description:
        console.print(Text(driver.description))
    if driver.trouble:
        console.print(Text(driver.trouble, style=ALARM))
    for device in driver.devices:
        console.print(Text(f"found: {device.address}  {device.identity}".rstrip()))
    if driver.example:
        console.print()
        # As it is, to be copied: no line is broken.
        console.print(Text(driver.example.strip()), soft_wrap=True)
    console.print()


def print_checks(console: Console, checks: Mapping[str, Facts], warnings: Sequence[str]) -> None:
    """Print the result for each device, then warnings about the sensors."""
    for part, facts in checks.items():
        state = Text("fault", ALARM) if TROUBLE in facts else Text("ok", GOOD)
        console.print(Text.assemble(state, f"  {part}"))
        print_facts(console, [(f"  {name}", text) for name, text in facts.items()])
    for text in warnings:
        print_text(console, Text.assemble(("warning: ", ALARM), text))


EXIT_FAULT = 1  # a device of the rig file is missing, or cannot do what the file says


def run(name: str | None, rig_file: Path | None, as_json: bool) -> None:
    """Run the command; its options are declared in `commands.py`."""
    if rig_file is None:
        _show_drivers(name or "", as_json=as_json)
        return
    if name is not None:
        raise ParameterError(f"--check takes a rig file alone: leave {name!r} out")
    _check_file(rig_file, as_json=as_json)


def _show_drivers(name: str, *, as_json: bool) -> None:
    known = [*find_drivers(SOURCES), *find_drivers(HOLDERS)]
    if name and name not in known:
        raise DeviceError(
            f"there is no driver {name!r}: installed are {', '.join(dict.fromkeys(known))}"
        )
    drivers = survey_drivers(name)
    console = make_console()
    if as_json:
        click.echo(format_json(list(map(dataclasses.asdict, drivers))), nl=False)
    elif name:
        for driver in drivers:
            print_driver(console, driver)
    else:
        print_drivers(console, drivers)


def _check_file(rig_file: Path, *, as_json: bool) -> None:
    rig = read_rig_file(rig_file)
    checks = {
        "source": _check(rig, rig_file, _try_source),
        "holder": _check(rig, rig_file, _try_holder),
    }
    warnings = list_rig_warnings(rig.setup)
    if as_json:
        click.echo(format_json({**checks, "warnings": warnings}), nl=False)
    else:
        print_checks(make_console(), checks, warnings)
    if any(TROUBLE in facts for facts in checks.values()):
        raise SystemExit(EXIT_FAULT)
