"""NI-DAQmx as the drivers reach it: locally or by gRPC, its errors as sentences, its devices."""

import os
import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.errors import DeviceError, RigError
from impact_rig.devices.protocols import FoundDevice

if TYPE_CHECKING:
    from nidaqmx import Task
    from nidaqmx.system import System
    from nidaqmx.system.device import Device

UNKNOWN_PROPERTY = "ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT"
"""The device does not have the property that was asked for."""
OVERWRITTEN = "SAMPLES_NO_LONGER_AVAILABLE"
"""The samples that were to be read are overwritten already."""
NOT_YET = "SAMPLES_NOT_YET_AVAILABLE"
"""The samples that were to be read do not exist yet."""
NOT_DONE = "WAIT_UNTIL_DONE_DOES_NOT_INDICATE_DONE"
"""The task has not ended in the time that was waited for."""
RESERVED = (
    "DIG_LINES_RESERVED_OR_UNAVAILABLE",
    "NETWORK_DEVICE_IN_USE",
    "NETWORK_DEVICE_RESERVED_BY_ANOTHER_HOST",
    "PAL_RESOURCE_RESERVED",
    "RESOURCE_ALREADY_RESERVED",
    "RESOURCE_RESERVED_WITH_CONFLICTING_SETTINGS",
)
"""Another task or program has the device, or the line."""
WRONG_SETTINGS = (
    "AI_CONV_RATE_TOO_HIGH",
    "INT_EXCIT_SRC_NOT_AVAILABLE",
    "INVALID_ATTRIBUTE_VALUE",
    "INVALID_COUPLING_FOR_MEASUREMENT_TYPE",
    "MIN_NOT_LESS_THAN_MAX",
    "PHYSICAL_CHAN_DOES_NOT_EXIST",
    "REF_TRIG_TYPE_NOT_SUPPORTED_GIVEN_TIMING_TYPE",
    "SAMPLE_RATE_NUM_CHANS_CONVERT_PERIOD_COMBO",
    "SAMPLE_RATE_TOO_HIGH_FOR_ADC_TIMING_MODE",
    "SAMP_RATE_TOO_HIGH",
    "SAMP_RATE_TOO_LOW",
    "TOO_MANY_PRETRIG_PLUS_MIN_POST_TRIG_SAMPS",
)
"""A value of the rig file is not possible. All names are those of `nidaqmx.error_codes`."""
STOPPED_EARLY = 200010
"""Number of the warning that a task was stopped before all its samples came."""
_KEYS = {
    "AI.Excit": "iepe_current",
    "AI.Max": "range",
    "AI.Min": "range",
    "AI.Coupling": "coupling",
    "SampClk.Rate": "sampling_rate",
}
"""Which key of the rig file a property of NI-DAQmx comes from."""
_FACT = re.compile(r"(?!Task Name|Status Code)[A-Z][\w. ]*: *\S.*")
"""A line that says what it is about, in the long texts of NI-DAQmx."""


@contextmanager
def report_errors(subject: str, options: TomlTable | None = None, key: str = "") -> Iterator[None]:
    """Turn what `nidaqmx` raises into errors of the rig.

    Parameters
    ----------
    subject : str
        What is talked to, for the message.
    options, key : TomlTable, str
        Where the rig file says what is now set, if it does.

    Raises
    ------
    ParameterError
        If the device cannot do what it is asked.
    DeviceError
        If it is not there, held by another program, silent, or anything else is wrong; or if
        NI-DAQmx is not installed.
    """
    from nidaqmx.errors import (
        DaqError,
        DaqFunctionNotSupportedError,
        DaqNotFoundError,
        DaqNotSupportedError,
        RpcError,
    )

    try:
        yield
    except (DaqNotFoundError, DaqNotSupportedError):
        raise DeviceError(
            "NI-DAQmx is not installed on this computer, or does not know its operating system:"
            ' install it from ni.com, or name with server = "host:31763" a computer that runs'
            " NI's gRPC device server"
        ) from None
    except DaqFunctionNotSupportedError as error:
        raise DeviceError(f"{subject}: this NI-DAQmx is too old: {_shorten(error)}") from None
    except RpcError as error:
        raise _make_server_error(subject, error) from None
    except DaqError as error:
        table = TomlTable({}) if options is None else options
        raise _make_device_error(subject, error, table, key) from None


def _make_device_error(subject: str, error: Any, options: TomlTable, key: str) -> RigError:
    told = _shorten(error)
    if error.error_type.name in RESERVED:
        return DeviceError(
            f"{subject} is held by another program or a connection that was lost: end it, or"
            f" restart NI's server ({told})"
        )
    if error.error_type.name in WRONG_SETTINGS:
        named = [place for name, place in _KEYS.items() if name in told and place in options]
        return options.make_error((*named, key)[0], f"{subject}: NI-DAQmx says: {told}")
    return DeviceError(f"{subject}: NI-DAQmx says: {told}")


def _shorten(error: Any) -> str:
    """Return the first line of NI-DAQmx's text, what it names, and the code."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    facts = [line for line in lines[1:] if _FACT.fullmatch(line)]
    if hasattr(error, "error_code"):
        facts.append(f"error {error.error_code}")
    text = lines[0].rstrip(".") if lines else "nothing"
    return f"{text} ({'; '.join(facts)})" if facts else text


def _make_server_error(subject: str, error: Any) -> DeviceError:
    code = getattr(error.rpc_code, "name", str(error.rpc_code))
    gone = "cannot be reached: is NI's gRPC device server running there?"
    reasons = {
        "UNAVAILABLE": gone,
        # Of a call that was under way when the server went.
        "CANCELLED": gone,
        "DEADLINE_EXCEEDED": "does not answer in time",
        "UNIMPLEMENTED": "does not know this call: NI's gRPC device server must be newer",
        "RESOURCE_EXHAUSTED": "has sent or got too much at once",
    }
    reason = reasons.get(code, " ".join(str(error.description).split()))
    return DeviceError(f"{subject} {reason} ({code})")


_ADDRESS = re.compile(r"(?P<host>\[[0-9a-fA-F:.]+\]|[^\s:/\[\]]+):(?P<port>\d{1,5})")
HIGHEST_PORT = 65535
_CHANNEL_OPTIONS = (
    # A server that comes back is seen at once: no memory of failures shared with old channels.
    ("grpc.use_local_subchannel_pool", 1),
    # It is on the laboratory's own network.
    ("grpc.enable_http_proxy", 0),
    ("grpc.max_receive_message_length", -1),
)


def take_server(options: TomlTable) -> str:
    """Return "host:port" of NI's gRPC device server, empty for this computer.

    Raises
    ------
    ParameterError
        If it is no such text.
    """
    server = options.take_text("server")
    match = _ADDRESS.fullmatch(server)
    if server and not (match and 0 < int(match["port"]) <= HIGHEST_PORT):
        raise options.refuse("server", 'host and port of NI\'s server, like "192.168.1.30:31763"')
    return server


class Session:
    """A connection to NI-DAQmx, and at most one task there.

    Parameters
    ----------
    subject : str
        What the task is of, for messages: "NI device Dev1".
    server : str
        "host:port" of a gRPC device server; empty: NI-DAQmx of this computer.
    patience : float
        Longest time for an answer of the server, beyond what a call itself waits [s].
    """

    def __init__(self, subject: str, server: str, patience: float) -> None:
        self.subject = f"{subject} at {server}" if server else subject
        self._server = server
        self._patience = patience
        self._channel: Any = None
        self._task: Any = None

    def find_system(self) -> "System":
        """Return the devices' names and what they are."""
        from nidaqmx.system import System

        return System(self._make_options("") if self._server else None)

    def open_task(self, purpose: str) -> "Task":
        """Return a new task.

        Sessions of a server outlive their connection: a task of this process for the same purpose
        that a lost connection has left behind still holds the device, and is ended first.

        Parameters
        ----------
        purpose : str
            Different for each device and kind of task.
        """
        from nidaqmx import Task

        if not self._server:
            self._task = Task()
            return self._task
        owner = f"impact_rig_{socket.gethostname()}_{os.getpid()}_{purpose}"
        name = re.sub(r"\W", "_", owner)
        self._task = Task(name, grpc_options=self._make_options(name))
        if self._task.number_of_channels > 0:
            self._task.close()
            self._task = Task(name, grpc_options=self._make_options(name))
        return self._task

    def close(self) -> None:
        """End the task and the connection; never raises, safe to call twice."""
        task, self._task = self._task, None
        channel, self._channel = self._channel, None
        if task is not None:
            try:
                with report_errors(self.subject):
                    task.close()
            except RigError:
                # The device is gone: there is nothing left to end.
                pass
        if channel is not None:
            channel.close()

    def _make_options(self, name: str) -> Any:
        from nidaqmx import GrpcSessionOptions

        if self._channel is None:
            self._channel = _open_channel(self._server, self._patience)
        return GrpcSessionOptions(self._channel, name)


def _open_channel(server: str, patience: float) -> Any:
    """Return a gRPC channel all of whose calls end in time."""
    import grpc

    class Deadline(grpc.UnaryUnaryClientInterceptor):
        """Gives each call the time that it waits itself, and the server's patience."""

        def intercept_unary_unary(self, continuation: Any, details: Any, request: Any) -> Any:
            waits = getattr(request, "timeout", 0.0) or getattr(request, "time_to_wait", 0.0)
            return continuation(details._replace(timeout=waits + patience), request)

    return grpc.intercept_channel(
        grpc.insecure_channel(server, options=_CHANNEL_OPTIONS), Deadline()
    )


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
