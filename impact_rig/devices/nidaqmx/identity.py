"""Which devices NI-DAQmx knows, and whether one is the right one."""

from typing import TYPE_CHECKING

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.errors import DeviceError
from impact_rig.devices.found_device import FoundDevice
from impact_rig.devices.nidaqmx.errors import report_errors
from impact_rig.devices.nidaqmx.session import Session

if TYPE_CHECKING:
    from nidaqmx.system import System
    from nidaqmx.system.device import Device


def find_devices() -> tuple[FoundDevice, ...]:
    """Return the devices that this computer's NI-DAQmx knows.

    Raises
    ------
    DeviceError
        If NI-DAQmx is not installed.
    ModuleNotFoundError
        If the Python package `nidaqmx` is not.
    """
    session = Session("NI-DAQmx", "", 0.0)
    with report_errors(session.subject):
        return tuple(
            FoundDevice(device.name, describe_device(device))
            for device in session.find_system().devices
        )


def describe_device(device: "Device") -> str:
    """Return maker, model and serial number."""
    kind = ", simulated" if device.is_simulated else ""
    return f"NI {device.product_type} {device.serial_num:08X}{kind}"


def find_device(system: "System", terminal: str, key: str, table: TomlTable) -> "Device":
    """Return the device of a channel or line.

    Parameters
    ----------
    system : System
        NI-DAQmx.
    terminal : str
        As the rig file has it: "Dev1/ai0".
    key : str
        Where the rig file has it.
    table : TomlTable
        That has the key.

    Raises
    ------
    ParameterError
        If this is no name of a terminal.
    DeviceError
        If NI-DAQmx knows no such device: it may come.
    """
    name, slash, rest = terminal.partition("/")
    if not (name and slash and rest) or "," in terminal:
        raise table.make_error(
            key, f"{key} of {table.place} is {terminal!r}: give device and terminal, like Dev1/ai0"
        )
    known = system.devices.device_names
    if name not in known:
        listed = ", ".join(known) or "none"
        raise DeviceError(
            str(table.make_error(key, f"NI-DAQmx knows no device {name!r}: known are {listed}"))
        )
    return system.devices[name]


def check_serial_number(device: "Device", options: TomlTable) -> None:
    """Require the serial number that the rig file names, if it does.

    Raises
    ------
    ParameterError
        If the rig file's is no number.
    DeviceError
        If the device has another one.
    """
    wanted = options.take_text("serial_number")
    if not wanted:
        return
    try:
        number = int(wanted, 16)
    except ValueError:
        raise options.refuse(
            "serial_number", 'the hexadecimal number on the device, like "01A2B3C4"'
        ) from None
    if device.serial_num != number:
        raise DeviceError(
            str(
                options.make_error(
                    "serial_number",
                    f"{device.name} has the serial number {device.serial_num:08X}, not"
                    f" {number:08X}: it is another device",
                )
            )
        )
