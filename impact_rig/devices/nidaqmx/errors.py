"""NI-DAQmx's errors as one sentence each."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.errors import DeviceError, RigError

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
