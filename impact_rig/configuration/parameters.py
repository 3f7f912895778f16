"""The parameters of the nodes: what each means and may be, read wherever one is given.

A name that no node has, or a value that cannot be meant, is refused before anything starts: it may
be about safety, and ROS 2 takes any name and says nothing.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from impact_rig.core.given.errors import ParameterError

CONTINUOUS = "continuous"
"""Mode of accelerometers that stream all the time."""
TRIGGERED = "triggered"
KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}


@dataclass(frozen=True)
class Parameter:
    """A parameter of a node."""

    default: bool | int | float | str
    description: str
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    is_live: bool = False  # it takes effect at once; others are read when the node is configured
    is_read_only: bool = False  # set when the node starts

    def convert(self, name: str, value: Any) -> Any:
        """Return a value that is given; raises `ParameterError` if it cannot be meant."""
        kind = type(self.default)
        is_whole = kind is float and type(value) is int
        wanted, is_good = KINDS[kind], is_whole or type(value) is kind
        if math.isfinite(self.low):
            wanted += f" from {self.low:g}" + f" to {self.high:g}" * math.isfinite(self.high)
            is_good = is_good and self.low <= value <= self.high
        if self.choices:
            wanted, is_good = f"one of {', '.join(self.choices)}", value in self.choices
        if not is_good:
            raise ParameterError(f"{name} is {value!r}: it must be {wanted}")
        return kind(value)


COMMON: Mapping[str, Parameter] = {
    "autostart": Parameter(True, "configure and activate at start-up, without a lifecycle manager")
}
"""Those that all nodes have."""
OF_ROS = ("start_type_description_service", "use_sim_time")
"""Those that ROS 2 gives to all nodes."""
OF_RCL = "qos_overrides."
"""Begins parameters of the middleware's client library."""
_RIG_FILE = Parameter("", "path of the rig file; empty: the paper's rig, virtual")
_DEVICE = {
    "rig_file": _RIG_FILE,
    "reconnect_period": Parameter(
        1.0, "how often a missing device is looked for [s]; 0: only when the node is configured"
        " again",
        low=0.0, high=3600.0, is_live=True,
    ),
}  # fmt: skip
PARAMETERS: Mapping[str, Mapping[str, Parameter]] = {
    "accelerometer": {
        **_DEVICE,
        "source": Parameter(
            "", "lines of TOML that go before the rig file's table [source]: seed = 7"
        ),
        "mode": Parameter(
            TRIGGERED,
            f"{TRIGGERED}: blocks of each hit, on `acceleration`; {CONTINUOUS}: blocks of all that"
            " comes, on `acceleration/stream`, in which the estimator finds the impacts",
            choices=(TRIGGERED, CONTINUOUS), is_read_only=True,
        ),
        "stream_block_size": Parameter(
            25_000, "points per block of the running stream [-]", low=1, high=10_000_000
        ),
        "trigger_timeout": Parameter(
            0.5, "how long after the latest contact a trigger may come, and how long the rest of a"
            " record may take from block to block [s]",
            low=0.0, high=60.0,
        ),
    },
    "campaign": {
        "rig_file": _RIG_FILE,
        "verdict_timeout": Parameter(
            5.0, "longest time from the latest contact to the verdict [s]",
            low=0.1, high=3600.0, is_live=True,
        ),
        "pause_timeout": Parameter(
            0.0, "how long a campaign may stand still [s]; 0: for ever",
            low=0.0, high=1e6, is_live=True,
        ),
    },
    "estimator": {},
    "hammer": {
        **_DEVICE,
        "swing_time": Parameter(
            0.207, "time from release to contact [s]; the paper's 0.207",
            low=0.0, high=60.0, is_live=True,
        ),
        "return_time": Parameter(
            0.0, "from contact back into the holder [s]", low=0.0, high=60.0, is_live=True
        ),
        "confirm_return": Parameter(
            False, "after each swing, wait until a person says that the hammer is back",
            is_live=True,
        ),
        "lead_time": Parameter(
            -1.0, "notice before each release [s]; below 0: 3 s where a holder releases a hammer,"
            " else none",
            low=-1.0, high=60.0, is_live=True,
        ),
    },
    "page": {
        "address": Parameter("127.0.0.1", "where the page is served; elsewhere with a token"),
        "port": Parameter(8000, "of the page; 0: any that is free", low=0, high=65535),
        "certificate": Parameter("", "path of the server's TLS certificate; empty: no TLS"),
        "key": Parameter("", "path of the certificate's key; empty: it is in the same file"),
    },
    "recorder": {
        "output": Parameter(
            "", "the new recording, an .mcap file; empty: runs/<time>/session.mcap under the"
            " working directory",
        ),
        "compression": Parameter("zstd", "of chunks", choices=("zstd", "lz4", "none")),
        "record_stream": Parameter(
            False, "in continuous mode, whether the running stream of the accelerometers is"
            " recorded as a whole, beside the hits that are found in it; 72 GB an hour at"
            " 2.5 MS/s, uncompressed",
        ),
        "include_topics": Parameter(
            "", "topics, by commas, that are recorded though they can be computed from the others"
            " and replay makes them again: impact/trace, comparison",
        ),
        "exclude_topics": Parameter(
            "", "topics of other nodes in the rig's namespace, by commas, that are not recorded;"
            " `up` sets those that the driver topic reads, whose hits are recorded",
        ),
        "notes": Parameter("", "in the operator's words; they go into the recording"),
        "attachments": Parameter("", "files, by commas, that go into the recording"),
    },
    "replayer": {
        "file": Parameter("", "path of the recording: an .mcap file, or the folder of a run"),
        "rig_namespace": Parameter("", "of the rig to replay, where the recording holds several"),
        "rate": Parameter(
            1.0, "speed, part of the original's [-]; may be changed at any time; what comes faster"
            " than the subscribers take it is lost",
            low=0.001, high=1000.0, is_live=True,
        ),
        "loop": Parameter(1, "how often [-]; 0: without end", low=0, high=1_000_000, is_live=True),
        "required_subscribers": Parameter(
            "estimator",
            "nodes of this namespace, by commas, that must be connected before the start",
            is_live=True,
        ),
        "exit_when_done": Parameter(
            False, "end the process at the end of the recording", is_live=True
        ),
    },
    "visualizer": {
        "output": Parameter("", "path of the .rrd file to be written; empty: none"),
        "connect": Parameter(
            "", "address of a viewer elsewhere that is there already, rerun+http://HOST:9876/proxy;"
            " empty: none",
        ),
        "spawn": Parameter(False, "open a viewer on this host"),
        "web": Parameter(False, "serve a web page for this host; the log says where"),
    },
}  # fmt: skip
"""Those of each node, besides those that all have."""


def check_parameters(values: Mapping[str, Any], node: str = "") -> None:
    """Raise a `ParameterError` for a name that a node has not, or a value that cannot be meant.

    Without a node it may be any of the rig's.
    """
    nodes = [PARAMETERS[node]] if node else [*PARAMETERS.values()]
    known = sorted({*COMMON, *OF_ROS, *(name for each in nodes for name in each)})
    for name, value in values.items():
        if name not in known and not name.startswith(OF_RCL):
            near = get_close_matches(name, known, 1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}"
            who = f"the node {node} has no" if node else "no node of the rig has a"
            raise ParameterError(f"{who} parameter {name!r}: {hint}")
        for parameters in (COMMON, *nodes):
            if name in parameters:
                parameters[name].convert(name, value)


def check_parameter_file(path: Path) -> None:
    """Raise a `ParameterError` if a file with ROS parameters is not one of this rig's nodes."""
    import yaml  # here: only launch files read one

    try:
        for node, values in _find_sections("", yaml.safe_load(path.read_text("utf-8"))):
            check_parameters(values, node)
    except OSError as error:
        raise ParameterError(f"params_file {path} cannot be read: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ParameterError(f"params_file {path} is not YAML: {error}") from None
    except ParameterError as error:
        raise ParameterError(f"params_file {path}: {error}") from None


def _find_sections(name: str, content: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the sections of a file: the node, empty if any node of a name is meant, and values."""
    if not isinstance(content, dict):
        raise ParameterError("it must have sections NODE: {ros__parameters: {NAME: VALUE}}")
    for key, value in content.items():
        if key != "ros__parameters":
            yield from _find_sections(f"{name}/{key}", value)
            continue
        node = name.rpartition("/")[2]
        if node not in (*PARAMETERS, "*", "**"):
            raise ParameterError(f"the rig has no node {node!r}: it has {', '.join(PARAMETERS)}")
        if not isinstance(value, dict | None):
            raise ParameterError(
                f"ros__parameters of {name} is {value!r:.80}: it must be a section"
            )
        yield ("" if "*" in node else node), dict(_list_values("", value or {}))


def _list_values(prefix: str, values: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _list_values(f"{prefix}{name}.", value)
        else:
            yield f"{prefix}{name}", value
