"""Whether the devices that a rig file names are there and do what it asks of them."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from impact_rig.cli.checks.software_checks import find_library
from impact_rig.configuration.rig_file import RigFile
from impact_rig.core.errors import DeviceError, ParameterError, RigError
from impact_rig.devices.acceleration_source import (
    AccelerationSource,
    Acquisition,
    AcquisitionPlan,
    SimulatedSource,
    SourceChannel,
)
from impact_rig.devices.drivers import HOLDERS, SOURCES, make_device, read_driver_name
from impact_rig.devices.hammer_holder import HammerHolder, HolderState
from impact_rig.devices.source_table import make_plan
from impact_rig.devices.virtual.digitizer import DigitizerSettings
from impact_rig.devices.virtual.source import make_virtual_plan

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


def plan_source(
    rig: RigFile, *, continuous: bool = False
) -> tuple[AccelerationSource, AcquisitionPlan]:
    """Return the source of a rig file, not yet configured, and what it is asked to do.

    Raises
    ------
    RigError
        If the rig file cannot be meant, or the driver cannot be loaded.
    """
    stream: dict[str, Any] = {
        "continuous": continuous,
        "block_size": AcquisitionPlan.block_size,
        "depth": AcquisitionPlan.depth,
    }
    source: AccelerationSource = make_device(SOURCES, rig.source)
    if isinstance(source, SimulatedSource):
        return source, make_virtual_plan(DigitizerSettings(), **stream)
    return source, make_plan(rig.source, rig.setup, **stream)


def _try_source(rig: RigFile, *, continuous: bool) -> Facts:
    source, plan = plan_source(rig, continuous=continuous)
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
