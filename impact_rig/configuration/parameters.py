"""Which parameters the nodes have: a name that none has is refused wherever it is given.

It may be about safety, and ROS 2 takes any name and says nothing.
"""

from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from impact_rig.core.errors import ParameterError

_COMMON = ("autostart", "start_type_description_service", "use_sim_time")
_DEVICE = ("rig_file", "reconnect_period")
PARAMETERS: Mapping[str, tuple[str, ...]] = {
    "accelerometer": (*_DEVICE, "mode", "stream_block_size", "trigger_timeout", "source"),
    "campaign": ("rig_file", "verdict_timeout", "pause_timeout"),
    "estimator": (),
    "hammer": (*_DEVICE, "swing_time", "return_time", "confirm_return"),
    "page": ("address", "port", "certificate", "key"),
    "recorder": ("output", "compression", "record_stream", "notes", "attachments"),
    "replayer": (
        "file", "rate", "loop", "rig_namespace", "required_subscribers", "exit_when_done",
    ),
    "visualizer": ("output", "connect", "spawn", "web"),
}  # fmt: skip
"""Those of each node, besides those that all have."""
OF_RCL = "qos_overrides."
"""Begins parameters of the middleware's client library."""


def check_parameters(names: Iterable[str], node: str = "") -> None:
    """Raise a `ParameterError` for a name that a node has not; without a node: that none has."""
    nodes = [node] if node else [*PARAMETERS]
    known = sorted({*_COMMON, *(name for each in nodes for name in PARAMETERS[each])})
    for name in names:
        if name not in known and not name.startswith(OF_RCL):
            near = get_close_matches(name, known, 1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}"
            who = f"the node {node} has no" if node else "no node of the rig has a"
            raise ParameterError(f"{who} parameter {name!r}: {hint}")


def check_parameter_file(path: Path) -> None:
    """Raise a `ParameterError` if a file with ROS parameters is not one of this rig's nodes."""
    import yaml  # here: only launch files read one

    try:
        content = yaml.safe_load(path.read_text("utf-8"))
    except OSError as error:
        raise ParameterError(f"params_file {path} cannot be read: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ParameterError(f"params_file {path} is not YAML: {error}") from None
    try:
        for node, names in _find_sections("", content):
            check_parameters(names, node)
    except ParameterError as error:
        raise ParameterError(f"params_file {path}: {error}") from None


def _find_sections(name: str, content: Any) -> Iterator[tuple[str, Iterable[str]]]:
    """Yield the sections of a file: the node, empty if any node of a name is meant, and names."""
    if not isinstance(content, dict):
        raise ParameterError("it must have sections NODE: {ros__parameters: {NAME: VALUE}}")
    for key, value in content.items():
        if key != "ros__parameters":
            yield from _find_sections(f"{name}/{key}", value)
            continue
        node = name.rpartition("/")[2]
        if node not in (*PARAMETERS, "*", "**"):
            raise ParameterError(f"the rig has no node {node!r}: it has {', '.join(PARAMETERS)}")
        yield ("" if "*" in node else node), _list_names("", value or {})


def _list_names(prefix: str, values: Mapping[str, Any]) -> Iterator[str]:
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _list_names(f"{prefix}{name}.", value)
        else:
            yield f"{prefix}{name}"
