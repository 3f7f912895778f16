"""The processes that make a rig: one list, for the command line and for ROS launch files."""

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
"""1: nodes on other computers are looked for. All else stays on 127.0.0.1."""
DISCOVERY = "ROS_AUTOMATIC_DISCOVERY_RANGE"
TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
HERE = ("LOCALHOST", "OFF")
SOCKET_BUFFER = 4_000_000
"""Of sockets between computers [bytes], our choice: 200 ms of both channels at 2.5 MS/s. A block
of 10 ms comes at once, and fills the 0.2 MB that Linux gives by itself."""


def make_network_variables(environment: Mapping[str, str], *, network: bool) -> dict[str, str]:
    """Return the environment variables that a rig adds to those which are set.

    Parameters
    ----------
    environment : mapping of str to str
        That goes first.
    network : bool
        Whether nodes on other computers are looked for.

    Returns
    -------
    dict of str to str
        Whether a rig leaves this computer, and how far ROS looks then, unless somebody has chosen
        that; and, where nobody has chosen the transports, sockets that hold a block of a running
        stream. Linux grants them up to `net.core.rmem_max`.
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

    Processes that run side by side share the host's cores: libraries that start a thread for each
    core, and let them spin, take the time from each other. And sums are rounded alike wherever
    they are computed. Call it before numpy is imported, which reads it once.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def split_names(text: str) -> list[str]:
    """Return the names in a text that lists them by commas."""
    return [part.strip() for part in text.split(",") if part.strip()]


def open_closed_streams() -> None:
    """Put the null device behind standard streams that are closed.

    Else the next files that are opened get their numbers, and what is printed.
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
"""What every node logs when it has become so."""
LAUNCHER = "IMPACT_RIG_LAUNCHER"
"""Names the process that started a node, whose death, however sudden, stops the node."""

CONTINUOUS = "continuous"
"""Mode of accelerometers that stream all the time."""

WINDOW = "spawn"
PAGE = "web"
"""Viewers of this host, beside which there may be one elsewhere, at an address."""


@dataclass(frozen=True)
class NodeProcess:
    """One node, to be started as a process of its own.

    Attributes
    ----------
    name : str
        Executable, and node name, of package impact_rig.
    parameters : mapping
        ROS parameters that differ from their defaults.
    """

    name: str
    parameters: Mapping[str, Any] = field(default_factory=dict)


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
        In no particular order: each node waits for the others.

    Raises
    ------
    ParameterError
        If a viewer is none, or there is nobody to feed it; if there is no stream to record; if
        the rig has no such node.
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
            "there is no running stream to be recorded: choose continuous mode as well"
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
            f"a viewer ({', '.join(viewers)}) is fed by the visualizer: do not leave it out"
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


def make_run_folder_name(now: datetime) -> str:
    """Return ``runs/<time>`` for a run that starts `now`."""
    return str(Path("runs") / now.strftime("%Y-%m-%dT%H-%M-%S"))
