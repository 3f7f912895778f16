"""`impact-rig devices`: drivers, the devices that they find, and those that a rig file names."""

import contextlib
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.text import Text

from impact_rig.cli.libraries import describe_missing
from impact_rig.configuration.rig_checks import check_rig
from impact_rig.configuration.rig_file import RigFile, read_rig_file
from impact_rig.core.given.errors import DeviceError, ParameterError, RigError
from impact_rig.devices.drivers import (
    HOLDERS,
    SOURCES,
    Driver,
    find_drivers,
    make_device,
    read_driver_name,
)
from impact_rig.devices.protocols import FoundDevice, HammerHolder, HolderState, SourceChannel
from impact_rig.devices.source_table import make_source
from impact_rig.present.console import (
    ALARM,
    GOOD,
    TITLE,
    make_console,
    print_facts,
    print_table,
    print_text,
)
from impact_rig.results.numbers import MISSING
from impact_rig.results.table import Column, make_table, make_text_column

KINDS = {SOURCES: "source", HOLDERS: "holder"}
EXIT_FAULT = 1  # a device of the rig file is missing, or cannot do what the file says
TROUBLE = "trouble"

Facts = dict[str, str]
"""Facts about a device, by name; an error is the fact `TROUBLE`."""


@dataclass
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
        If there is no such driver.
    """
    known = [(KINDS[group], driver) for group in KINDS for driver in find_drivers(group).values()]
    chosen = [(kind, driver) for kind, driver in known if name in ("", driver.name)]
    if not chosen:
        names = ", ".join(dict.fromkeys(driver.name for _, driver in known))
        raise DeviceError(f"there is no driver {name!r}: installed are {names}")
    return [_survey(kind, driver) for kind, driver in chosen]


def _survey(kind: str, driver: Driver) -> SurveyedDriver:
    found = SurveyedDriver(kind, driver.name, driver.package)
    try:
        loaded = driver.load()
        found.description, found.example = loaded.description, loaded.example
        with contextlib.redirect_stdout(sys.stderr):  # a vendor's library may print
            found.devices = tuple(loaded.find_devices())
    except (ModuleNotFoundError, RigError) as error:
        found.trouble = _describe_trouble(error)
    except Exception as error:  # noqa: BLE001 - a driver of others may raise anything
        found.trouble = f"its search for devices failed: {type(error).__name__}: {error}"
    return found


def _describe_trouble(error: ModuleNotFoundError | RigError) -> str:
    if not isinstance(error, ModuleNotFoundError):
        return str(error)
    unknown = f"the Python package {error.name!r} is not installed"
    return describe_missing(error.name or "") or unknown


def _try_device(rig: RigFile, attempt: Callable[[RigFile], Facts]) -> Facts:
    """Open a device of a rig file, and close it again; the hammer stays held."""
    try:
        return attempt(rig)
    except ParameterError as error:
        return {TROUBLE: f"rig file {rig.path}: {error}"}
    except (ModuleNotFoundError, RigError) as error:
        return {TROUBLE: _describe_trouble(error)}


def _try_source(rig: RigFile) -> Facts:
    source, plan = make_source(rig.source, rig.setup)
    with contextlib.closing(source):
        acquisition = source.configure(plan)
    kept = f"{plan.pre_trigger * 1e3:g} ms of it before the trigger"
    specimen = plan.specimen
    return {
        "driver": read_driver_name(rig.source),
        "device": acquisition.identity,
        "rate": f"{acquisition.sampling_rate * 1e-3:.9g} kHz,"
        f" {plan.sampling_rate * 1e-3:.9g} kHz requested",
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


def _describe_channel(channel: SourceChannel) -> str:
    sensor = channel.sensor.describe()
    return f"channel {channel.name}: {sensor}" if channel.name else sensor


def run(name: str | None, rig_file: Path | None) -> None:
    """Run the command; its options are declared in `commands.py`."""
    if rig_file is not None:
        if name is not None:
            raise ParameterError(f"--check takes a rig file alone: leave {name!r} out")
        _check(read_rig_file(rig_file))
        return
    drivers = survey_drivers(name or "")
    _print_drivers(drivers)
    if name is not None:
        for driver in drivers:
            # To be copied: no line is broken.
            make_console().print(Text(driver.example.strip()), soft_wrap=True)


def _print_drivers(drivers: Sequence[SurveyedDriver]) -> None:
    """Print the drivers, then the devices that they have found."""
    console = make_console()
    columns = [
        make_text_column("Driver", [driver.name for driver in drivers]),
        make_text_column("Kind", [driver.kind for driver in drivers]),
        make_text_column("For", [driver.description or MISSING for driver in drivers]),
        make_text_column("State", ["not ready" if item.trouble else "ready" for item in drivers]),
        Column("Package", [driver.package for driver in drivers], is_text=True, is_optional=True),
    ]
    troubles = (f"{driver.name}: {driver.trouble}." for driver in drivers if driver.trouble)
    notes = list(dict.fromkeys(troubles))
    marked = [place for place, driver in enumerate(drivers) if driver.trouble]
    print_table(console, make_table("Drivers", columns, notes, marked))
    found = [
        (driver.name, driver.kind, device.address, device.identity)
        for driver in drivers
        for device in driver.devices
    ]
    print_text(console, f"Devices found: {len(found)}", TITLE)
    print_facts(console, found)


def _check(rig: RigFile) -> None:
    """Check a rig file as a whole, then try its devices; print the result for each."""
    checks = {"source": _try_device(rig, _try_source), "holder": _try_device(rig, _try_holder)}
    console = make_console()
    for part, facts in checks.items():
        state = Text("fault", ALARM) if TROUBLE in facts else Text("ok", GOOD)
        console.print(Text.assemble(state, f"  {part}"))
        print_facts(console, [(f"  {name}", text) for name, text in facts.items()])
    notes = check_rig(rig)
    for note in notes:
        kind = "fault: " if note.is_fault else "warning: "
        print_text(console, Text.assemble((kind, ALARM), note.text))
    if any(TROUBLE in facts for facts in checks.values()) or any(item.is_fault for item in notes):
        raise SystemExit(EXIT_FAULT)
