"""`impact-rig devices`: drivers, the devices that they find, and those that a rig file names."""

import dataclasses
import functools
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.text import Text

from impact_rig.cli import options
from impact_rig.cli.libraries import find_library
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
    Acquisition,
    AcquisitionPlan,
    FoundDevice,
    HammerHolder,
    HolderState,
    SourceChannel,
)
from impact_rig.devices.source_table import make_source
from impact_rig.present.terminal.console import (
    ALARM,
    GOOD,
    WARNING,
    make_console,
    print_facts,
    print_table,
    print_text,
)
from impact_rig.results.numbers import MISSING
from impact_rig.results.results_file import format_json
from impact_rig.results.tables import Column

SEARCH_TIMEOUT = 15.0
"""How long a driver may search [s], our choice: some ask a network."""
KINDS = {SOURCES: "source", HOLDERS: "holder"}
ENDLESS = "its search for devices did not come to an end"


@dataclass(frozen=True)
class SurveyedDriver:
    """A driver, and what its search has found.

    Attributes
    ----------
    kind : str
        "source" or "holder".
    name, package : str
        As the rig file names it, and the distribution that brings it.
    description, example : str
        In its own words; empty where it could not be loaded.
    devices : tuple of FoundDevice
        Those that it could use.
    trouble : str
        Why it cannot work, or could not search; empty: it can.
    advice : str
        What to do about that, where it is known.
    """

    kind: str
    name: str
    package: str
    description: str = ""
    example: str = ""
    devices: tuple[FoundDevice, ...] = ()
    trouble: str = ""
    advice: str = ""


_Search = tuple[Callable[..., SurveyedDriver], subprocess.Popen[str]]
"""A driver, and the process of its own in which it searches: it may hang, or end that process."""


def survey_drivers(name: str = "", timeout: float = SEARCH_TIMEOUT) -> list[SurveyedDriver]:
    """Let every driver search for its devices, all at the same time.

    Parameters
    ----------
    name : str
        Only the drivers of this name; empty: all.
    timeout : float
        For each of them [s]; who has not answered then is ended.

    Raises
    ------
    DeviceError
        If two packages bring drivers of the same name.
    """
    searches = [
        _start(group, driver)
        for group in KINDS
        for driver in find_drivers(group).values()
        if name in ("", driver.name)
    ]
    with ThreadPoolExecutor(max(1, len(searches))) as pool:
        try:
            return list(
                pool.map(lambda search: _await_answer(search[0], search[1], timeout), searches)
            )
        finally:
            for _, process in searches:
                _end(process)


def _start(group: str, driver: Driver) -> _Search:
    words = [sys.executable, "-P", "-m", "impact_rig.cli.device_search", group, driver.name]
    process = subprocess.Popen(
        words,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )
    return functools.partial(SurveyedDriver, KINDS[group], driver.name, driver.package), process


def _await_answer(
    describe: Callable[..., SurveyedDriver], process: subprocess.Popen[str], timeout: float
) -> SurveyedDriver:
    try:
        output, _ = process.communicate(timeout=timeout)
        answer = json.loads(output)
    except subprocess.TimeoutExpired:
        _end(process)
        process.communicate()
        return describe(trouble=ENDLESS)
    except ValueError:
        code = process.returncode
        ended = f"signal {signal.Signals(-code).name}" if code < 0 else f"code {code}"
        return describe(trouble=f"it crashed while it searched for devices ({ended})")
    library = find_library(answer["missing"])
    return describe(
        description=answer["description"],
        example=answer["example"],
        devices=tuple(FoundDevice(*device) for device in answer["devices"]),
        trouble=answer["trouble"],
        advice=library.advice if library else "",
    )


def _end(process: subprocess.Popen[str]) -> None:
    """End a search that goes on, with whatever it has started."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)


Facts = tuple[tuple[str, str], ...]
"""Names and what there is to say."""
SAME_RATE = 1e-6
"""Part by which the device's rate may differ from the one asked for without a word [-], our
choice: it is rounding."""


@dataclass(frozen=True)
class DeviceCheck:
    """What was found of one device of a rig file.

    Attributes
    ----------
    part : str
        "source" or "holder".
    facts : tuple of (str, str)
        What the device is and does; empty where it could not be opened.
    trouble : str
        What is wrong, in one sentence; empty: nothing.
    """

    part: str
    facts: Facts = ()
    trouble: str = ""


def check_rig(rig: RigFile, path: Path, *, continuous: bool) -> tuple[DeviceCheck, DeviceCheck]:
    """Open source and holder of a rig file, and close them again; the hammer stays held.

    Parameters
    ----------
    rig : RigFile
        What the file says.
    path : Path
        Of the file, for messages.
    continuous : bool
        Whether the source must be able to stream.
    """
    return (
        _check("source", path, lambda: _try_source(rig, continuous=continuous)),
        _check("holder", path, lambda: _try_holder(rig)),
    )


def _check(part: str, path: Path, attempt: Callable[[], Facts]) -> DeviceCheck:
    try:
        return DeviceCheck(part, attempt())
    except ParameterError as error:
        trouble = f"rig file {path}: {error}"
    except RigError as error:
        trouble = str(error)
    except ModuleNotFoundError as error:
        trouble = _describe_missing(error)
    return DeviceCheck(part, trouble=trouble)


def _try_source(rig: RigFile, *, continuous: bool) -> Facts:
    source, plan = make_source(rig.source, rig.setup, continuous=continuous)
    try:
        return _list_source_facts(rig, plan, source.configure(plan))
    finally:
        source.close()


def _list_source_facts(rig: RigFile, plan: AcquisitionPlan, acquisition: Acquisition) -> Facts:
    facts = [
        ("driver", read_driver_name(rig.source)),
        ("device", acquisition.identity),
        ("rate", _describe_rate(plan.sampling_rate, acquisition.sampling_rate)),
    ]
    if not plan.continuous:
        kept = f"{plan.pre_trigger * 1e3:g} ms of it before the trigger"
        facts += [
            ("record", f"{plan.record_duration * 1e3:g} ms, {kept}"),
            ("trigger", f"{plan.trigger_level:.4g} m/s² of the hammer, either sign"),
        ]
    specimen = plan.specimen
    return (
        *facts,
        ("hammer", _describe_channel(plan.hammer)),
        ("specimen", _describe_channel(specimen) if specimen else "not measured"),
    )


def _try_holder(rig: RigFile) -> Facts:
    name = read_driver_name(rig.holder)
    holder: HammerHolder = make_device(HOLDERS, rig.holder)
    try:
        identity = holder.configure()
        if holder.read_state() is not HolderState.HOLDING:
            raise DeviceError(f"the holder {identity} does not hold: look at its wiring")
    finally:
        holder.close()
    how = "an operator lets the hammer go" if holder.is_by_hand else "it holds"
    return ("driver", name), ("device", identity), ("state", how)


def _describe_rate(wanted: float, real: float) -> str:
    text = f"{real * 1e-3:.9g} kHz"
    if abs(real - wanted) > SAME_RATE * wanted:
        text += f", where {wanted * 1e-3:.9g} kHz are asked for"
    return text


def _describe_channel(channel: SourceChannel) -> str:
    sensor = channel.sensor.describe()
    return f"channel {channel.name}: {sensor}" if channel.name else sensor


def _describe_missing(error: ModuleNotFoundError) -> str:
    library = find_library(error.name or "")
    text = f"the Python package {error.name!r} is not installed"
    return f"{text}: {library.advice}" if library else text


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


def _describe_trouble(driver: SurveyedDriver) -> str:
    return "; ".join(text for text in (driver.trouble, driver.advice) if text)


FAULT = "fault"
OK = "ok"


def print_checks(console: Console, checks: Sequence[DeviceCheck], warnings: Sequence[str]) -> None:
    """Print what was found of each device, then what is to be known of the sensors."""
    for check in checks:
        state = Text(FAULT, ALARM) if check.trouble else Text(OK, GOOD)
        console.print(Text.assemble(state, f"  {check.part}"))
        facts = [(f"  {name}", text) for name, text in check.facts]
        print_facts(console, [*facts, ("", check.trouble)] if check.trouble else facts)
    for text in warnings:
        print_text(console, Text.assemble(("warning: ", ALARM), text))


def checks_to_json(checks: Sequence[DeviceCheck], warnings: Sequence[str]) -> dict[str, Any]:
    """Return the same as plain values."""
    content: dict[str, Any] = {
        check.part: {**dict(check.facts), "trouble": check.trouble} for check in checks
    }
    return {**content, "warnings": list(warnings)}


EXIT_FAULT = 1
"""A device of the rig file is not there, or cannot do what it is asked."""


@click.command(
    "devices",
    epilog="""
    \b
    Examples:
      impact-rig devices                       all drivers, and what they find
      impact-rig devices scpi                  one driver, with a table to copy
      impact-rig devices --check my-rig.toml   try what a rig file names
      impact-rig devices --json

    \b
    Any package may bring drivers: it names their classes by the entry points
    impact_rig.acceleration_sources and impact_rig.hammer_holders.
    Exit code: 1 if a device of the rig file is not there or cannot do what it is asked.
    """,
)
@click.argument("name", required=False, metavar="[DRIVER]")
@click.option(
    "--check",
    "rig_file",
    type=click.Path(path_type=Path),
    metavar="RIG_FILE",
    help="Open source and holder of a rig file, and close them again. The hammer stays held.",
)
@options.continuous_option
@options.json_option
def command(name: str | None, rig_file: Path | None, continuous: bool, as_json: bool) -> None:
    """See which drivers there are, whether they can work, and which devices they find.

    A driver whose library is missing says how to get it. The search changes no setting of any
    device.
    """
    if rig_file is None:
        if continuous:
            raise ParameterError("--continuous is for --check: the search opens no device")
        _show_drivers(name or "", as_json=as_json)
        return
    if name is not None:
        raise ParameterError(f"--check takes a rig file alone: leave {name!r} out")
    _check_file(rig_file, continuous=continuous, as_json=as_json)


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


def _check_file(rig_file: Path, *, continuous: bool, as_json: bool) -> None:
    rig = read_rig_file(rig_file)
    checks = check_rig(rig, rig_file, continuous=continuous)
    warnings = list_rig_warnings(rig.setup)
    if as_json:
        click.echo(format_json(checks_to_json(checks, warnings)), nl=False)
    else:
        print_checks(make_console(), checks, warnings)
    if any(check.trouble for check in checks):
        raise SystemExit(EXIT_FAULT)
