"""The processes of a rig: one list for the command line and the ROS launch files."""

import json
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from impact_rig.core.errors import ParameterError

NETWORK = "IMPACT_RIG_NETWORK"
"""1: find nodes on other computers. Otherwise everything stays on 127.0.0.1."""
DISCOVERY = "ROS_AUTOMATIC_DISCOVERY_RANGE"
TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
HERE = ("LOCALHOST", "OFF")
SOCKET_BUFFER = 4_000_000
"""Of sockets between computers [bytes]: 200 ms of both channels at 2.5 MS/s. One block fills the
0.2 MB that Linux gives by default."""


def make_network_variables(environment: Mapping[str, str], *, network: bool) -> dict[str, str]:
    """Return the environment variables that a rig adds to `environment`.

    They are the network flag and the discovery range. With `network` also sockets that hold a
    block of a running stream (Linux grants them up to `net.core.rmem_max`). A range or transports
    that the environment has already are kept.
    """
    if not network:
        return {NETWORK: "0", DISCOVERY: "LOCALHOST"}
    variables = {NETWORK: "1"}
    if DISCOVERY not in environment:
        variables[DISCOVERY] = "SUBNET"
    is_far = {**environment, **variables}[DISCOVERY] not in HERE
    if is_far and not any(name in environment for name in (TRANSPORTS, *PROFILES)):
        variables[TRANSPORTS] = f"DEFAULT?sockets_size={SOCKET_BUFFER}B"
    return variables


def use_one_thread() -> None:
    """Keep numpy's linear algebra to one thread, unless the environment says otherwise.

    Several processes share the cores, and sums are rounded alike on every computer. Call it before
    numpy is imported.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def split_names(text: str) -> list[str]:
    """Return the names in a text that lists them by commas."""
    return [part.strip() for part in text.split(",") if part.strip()]


def open_closed_streams() -> None:
    """Put the null device behind closed standard streams.

    Otherwise the next open file would get their number, and what is printed.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            number = os.open(os.devnull, os.O_RDWR)  # the lowest that is free
            os.set_inheritable(number, True)
            stream = os.fdopen(number, mode)
            setattr(sys, name, stream)
            setattr(sys, f"__{name}__", stream)


RECORDING_NAME = "session.mcap"
VIEW_NAME = "session.rrd"
RESULTS_NAME = "results.json"
REPORT_NAME = "report.html"
LOG_NAME = "nodes.log"

ACTIVE = "this node is active"
"""Every node logs this when it becomes active."""
LAUNCHER = "IMPACT_RIG_LAUNCHER"
"""Number of the process that started a node; when that process ends, the node stops."""

CONTINUOUS = "continuous"
"""Mode of accelerometers that stream all the time."""

WINDOW = "spawn"
PAGE = "web"
"""Viewers of this host; an address names one elsewhere."""


@dataclass(frozen=True)
class NodeProcess:
    """One node, which runs as one process."""

    name: str  # of the executable and the node
    parameters: Mapping[str, Any] = field(default_factory=dict)  # those that are not the default


def list_rig_processes(
    output: Path | str,
    *,
    rig_file: str = "",
    source: Mapping[str, Any] | None = None,
    swing: Mapping[str, Any] | None = None,
    continuous: bool = False,
    record_stream: bool = False,
    notes: str = "",
    visualize: bool = True,
    viewers: Sequence[str] = (),
    overrides: Mapping[str, Mapping[str, Any]] | None = None,
    only: Sequence[str] = (),
) -> tuple[NodeProcess, ...]:
    """Return the nodes of a rig with their parameters.

    All but `only` describes the whole rig, also what of it runs on other computers.

    Parameters
    ----------
    output : Path or str
        Folder of the run; recording and view go there.
    rig_file : str
        Path of the rig file; empty: the paper's rig.
    source : mapping, optional
        What goes before the rig file's table [source], by keys of that table: seed ...
    swing : mapping, optional
        Parameters of the hammer that the rig file gives: swing_time ...
    continuous : bool
        Whether the accelerometers stream all the time, and not only each hit.
    record_stream : bool
        Whether the whole running stream is recorded, and not only the impacts in it.
    notes : str
        Words of the operator to keep in the recording.
    visualize : bool
        Whether model and measurement are shown.
    viewers : sequence of str
        Where, beside the file in the folder; see `make_viewer_parameters`.
    overrides : mapping, optional
        Further parameters by node; they go before all others.
    only : sequence of str
        Nodes that this computer starts; empty: all.

    Returns
    -------
    tuple of NodeProcess
        In any order: each node waits for the others.

    Raises
    ------
    ParameterError
        If a viewer is unknown or has no visualizer, if there is no stream to record, or if the
        rig has no such node.
    """
    further = overrides or {}
    folder = Path(output)
    described = {"rig_file": str(rig_file)} if rig_file else {}
    hammer: dict[str, Any] = {**described, **(swing or {})}
    accelerometer: dict[str, Any] = dict(described)
    if source:
        accelerometer["source"] = format_source(source)
    if continuous:
        accelerometer["mode"] = CONTINUOUS
    given = {**accelerometer, **further.get("accelerometer", {})}
    if record_stream and given.get("mode") != CONTINUOUS:
        raise ParameterError(
            "there is no running stream to record: choose continuous mode as well"
        )
    processes = [
        NodeProcess("hammer", hammer),
        NodeProcess("accelerometer", accelerometer),
        NodeProcess("estimator"),
        NodeProcess("campaign", described),
    ]
    content = {"notes": notes, "attachments": str(rig_file), "record_stream": record_stream}
    given = {name: value for name, value in content.items() if value}
    processes.append(NodeProcess("recorder", {"output": str(folder / RECORDING_NAME), **given}))
    if visualize:
        view = {"output": str(folder / VIEW_NAME), **make_viewer_parameters(viewers)}
        processes.append(NodeProcess("visualizer", view))
    elif viewers:
        raise ParameterError(
            f"a viewer ({', '.join(viewers)}) needs the visualizer: do not leave it out"
        )
    return tuple(
        NodeProcess(process.name, {**process.parameters, **further.get(process.name, {})})
        for process in _choose(processes, only)
    )


def format_source(source: Mapping[str, Any]) -> str:
    """Return keys of the table [source] as the accelerometers' parameter `source`, which is TOML.

    Texts, numbers, true and false, and lists of them are written in TOML as in JSON.
    """
    return "\n".join(
        f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in source.items()
    )


def _choose(processes: Sequence[NodeProcess], only: Sequence[str]) -> list[NodeProcess]:
    """Return the processes that are named, in their order; all if none is."""
    names = [process.name for process in processes]
    for name in only:
        if name not in names:
            raise ParameterError(f"there is no node {name!r} to start: the rig has {names}")
    return [process for process in processes if not only or process.name in only]


def make_viewer_parameters(viewers: Sequence[str]) -> dict[str, Any]:
    """Return the visualizer's parameters for viewers.

    Parameters
    ----------
    viewers : sequence of str
        `WINDOW`, `PAGE` and the address of a viewer elsewhere, each once at most.

    Raises
    ------
    ParameterError
        If one is something else, or there are two addresses.
    """
    parameters: dict[str, Any] = {}
    for viewer in viewers:
        if viewer in (WINDOW, PAGE):
            parameters[viewer] = True
        elif not viewer.startswith("rerun"):
            raise ParameterError(
                f"viewer is {viewer!r}: it must be {WINDOW}, {PAGE}, or an address such as"
                " rerun+http://HOST:9876/proxy"
            )
        elif parameters.setdefault("connect", viewer) != viewer:
            raise ParameterError(
                f"two viewers elsewhere, {parameters['connect']} and {viewer}: name one of them"
            )
    return parameters


def choose_run_folder(output: Path | None = None) -> Path:
    """Return the given folder of a run, or ``runs/<time>``."""
    now = datetime.now().astimezone()
    return output or Path("runs") / now.strftime("%Y-%m-%dT%H-%M-%S")
