"""The processes of a rig: one list for the command line and the ROS launch files."""

import itertools
import json
import os
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from enum import Enum
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from impact_rig.configuration.parameters import CONTINUOUS, check_parameters
from impact_rig.core.given.errors import FileError, ParameterError

if TYPE_CHECKING:
    from impact_rig.configuration.rig_file import RigFile

NETWORK = "IMPACT_RIG_NETWORK"
"""1: find nodes on other computers. Otherwise everything stays on 127.0.0.1."""
DISCOVERY = "ROS_AUTOMATIC_DISCOVERY_RANGE"
TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
HERE = ("LOCALHOST", "OFF")
SOCKET_BUFFER = 4_000_000
"""Buffer of sockets between computers [bytes]: 200 ms of both channels at 2.5 MS/s. One block
fills the 0.2 MB that Linux gives by default."""


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


_COMPUTING = threading.RLock()
"""GTC is not safe in threads, and a limit on numpy's is that of the whole process."""


@contextmanager
def compute_alone() -> Iterator[None]:
    """Let other threads of this process wait, and numpy have one, as long as this one computes."""
    with _COMPUTING:
        if find_spec("threadpoolctl") is None:
            yield
            return
        import scipy.linalg  # noqa: F401 - it has a library of its own, which must be there to be asked
        from threadpoolctl import threadpool_limits

        with threadpool_limits(1, "blas"):
            yield


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
NOTICES = "IMPACT_RIG_NOTICES"
"""1: the process that started a node reads notices among what it prints."""
NOTICE_MARK = "\x1e"
"""First character of a line that is a notice; the others are for people."""


class Notice(Enum):
    """Messages of a node to the process that started it, and of the one that forked the node."""

    ACTIVE = "active"
    PAGE = "page"  # and the address of the web page that it serves
    STARTED = "started"  # a node's name and process
    ENDED = "ended"  # a node's name and exit code


def notify(notice: Notice, value: str = "") -> None:
    """Send a notice to the process that started this node, if it reads notices."""
    if os.environ.get(NOTICES):
        print(f"{NOTICE_MARK}{notice.value} {value}", flush=True)


def read_notice(line: str) -> tuple[Notice, str] | None:
    """Return the notice that a line is; None: it is for people."""
    if not line.startswith(NOTICE_MARK):
        return None
    name, _, value = line[1:].partition(" ")
    return Notice(name), value


WINDOW = "spawn"
PAGE = "web"
"""Viewers of this computer; an address names one elsewhere."""


MEASURING = ("accelerometer", "campaign", "estimator", "hammer", "recorder")
"""The nodes that a measurement rests on: a rig ends with each of them, and with no other."""


@dataclass(frozen=True)
class NodeProcess:
    """One node, which runs as one process."""

    name: str  # of the executable and the node
    parameters: Mapping[str, Any] = field(default_factory=dict)  # those that are not the default


def list_rig_processes(
    output: Path | str,
    *,
    rig: "RigFile | None" = None,
    source: Mapping[str, Any] | None = None,
    continuous: bool = False,
    record_stream: bool = False,
    notes: str = "",
    visualize: bool = True,
    page: bool = False,
    viewers: Sequence[str] = (),
    overrides: Mapping[str, Mapping[str, Any]] | None = None,
    only: Sequence[str] = (),
) -> tuple[NodeProcess, ...]:
    """Return the nodes of a rig with their parameters.

    All parameters but `only` describe the whole rig, including its part on other computers.

    Parameters
    ----------
    output : Path or str
        Folder of the run; recording and view go there.
    rig : RigFile, optional
        Without it, the paper's rig.
    source : mapping, optional
        Keys that replace those of the rig file's table [source]: seed ...; None is left out.
    continuous : bool
        Whether the accelerometers stream all the time, and not only each hit.
    record_stream : bool
        Whether the whole running stream is recorded, and not only the impacts in it.
    notes : str
        Words of the operator to keep in the recording.
    visualize : bool
        Whether model and measurement are shown.
    page : bool
        Whether a page for the person at the rig is served.
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
        rig has no such node or parameter.
    """
    further = overrides or {}
    path = str(rig.path) if rig and rig.path else ""
    stated: dict[str, dict[str, Any]] = {
        "hammer": {"rig_file": path},
        "accelerometer": {
            "rig_file": path,
            "source": format_source(source or {}),
            "mode": CONTINUOUS if continuous else "",
        },
        "estimator": {},
        "campaign": {"rig_file": path},
        "recorder": {
            "output": str(Path(output, RECORDING_NAME)),
            "notes": notes,
            "attachments": path,
            "record_stream": record_stream,
            "exclude_topics": ",".join(rig.list_topics()) if rig else "",
        },
        "visualizer": {"output": str(Path(output, VIEW_NAME)), **make_viewer_parameters(viewers)},
    }
    if not visualize:
        del stated["visualizer"]
        if viewers:
            raise ParameterError(f"a viewer ({', '.join(viewers)}) needs the visualizer")
    if page:
        stated["page"] = {}
        only = (*only, "page") if only else ()
    nodes = {
        name: {key: value for key, value in parameters.items() if value}
        for name, parameters in stated.items()
    }
    nodes["hammer"] |= rig.hammer if rig else {}
    for name in nodes:
        check_parameters(further.get(name, {}), name)
        nodes[name] |= further.get(name, {})
    if record_stream and nodes["accelerometer"].get("mode") != CONTINUOUS:
        raise ParameterError("there is no running stream to record: choose continuous mode, too")
    for name in only:
        if name not in nodes:
            raise ParameterError(f"there is no node {name!r} to start: the rig has {[*nodes]}")
    return tuple(NodeProcess(name, nodes[name]) for name in nodes if not only or name in only)


def format_source(source: Mapping[str, Any]) -> str:
    """Return keys of the table [source] as the accelerometers' parameter `source`, which is TOML.

    TOML writes texts, numbers, booleans and lists of them as JSON does. None is left out.
    """
    return "\n".join(
        f"{key} = {json.dumps(value, ensure_ascii=False)}"
        for key, value in source.items()
        if value is not None
    )


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
        elif viewer.startswith("rerun") and parameters.get("connect", viewer) == viewer:
            parameters["connect"] = viewer
        else:
            raise ParameterError(
                f"viewer is {viewer!r}: it must be {WINDOW}, {PAGE}, or one address such as"
                " rerun+http://HOST:9876/proxy"
            )
    return parameters


def choose_run_folder(output: Path | None = None) -> Path:
    """Return the given folder of a run, or a new one, ``runs/<time>``."""
    if output:
        return output
    time = datetime.now().astimezone().strftime("%Y-%m-%dT%H-%M-%S")
    # Two rigs may start in one second.
    names = itertools.chain([time], (f"{time}-{number}" for number in itertools.count(2)))
    return next(folder for name in names if not (folder := Path("runs", name)).exists())


SOURCE = "source"
"""Name of the rig file's table [source] in settings."""


def parse_parameters(settings: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """Read ``NODE.PARAMETER=VALUE`` texts into parameters by node.

    ``source.KEY=VALUE`` is a key of the rig file's table [source].

    Raises
    ------
    ParameterError
        If a text has another form, or the rig has no such node.
    """
    nodes = [process.name for process in list_rig_processes("", page=True)]
    parsed: dict[str, dict[str, Any]] = {}
    for text in settings:
        place, equals, value = text.partition("=")
        node, dot, parameter = place.partition(".")
        if not (equals and dot and parameter):
            raise ParameterError(
                f"--set {text!r}: write NODE.PARAMETER=VALUE, for example hammer.swing_time=0.3"
            )
        if node not in (*nodes, SOURCE):
            raise ParameterError(f"--set {text!r}: the rig has no node {node!r}, it has {nodes}")
        of_node = parsed.setdefault(node, {})
        try:
            of_node[parameter] = json.loads(value)
        except json.JSONDecodeError:
            of_node[parameter] = value
    return parsed


def choose_view(wanted: str, executable: Path) -> bool:
    """Return whether to start the visualizer: as wanted, or where it can show anything.

    Parameters
    ----------
    wanted : str
        `true`, `false`, or `auto`: where rerun-sdk is installed.
    executable : Path
        The visualizer's; it begins with the Python that runs it, which may be another than this.

    Raises
    ------
    FileError
        If it is wanted, and that Python has no rerun-sdk.
    """
    if wanted == "false":
        return False
    import shlex  # here: the help of the command line does not wait for them
    import subprocess

    python = executable.read_text("utf-8").splitlines()[0].removeprefix("#!")
    search = "import importlib.util, sys; sys.exit(importlib.util.find_spec('rerun') is None)"
    has_rerun = subprocess.run([*shlex.split(python), "-c", search], check=False).returncode == 0
    if wanted == "true" and not has_rerun:
        raise FileError(f"visualizer:=true: rerun-sdk is not installed for {python}")
    return has_rerun


def make_run_folder(output: Path | None) -> Path:
    """Make the folder of a run, and refuse one that already holds a run.

    Raises
    ------
    FileError
        If the folder holds a run, or cannot be made or written.
    """
    folder = choose_run_folder(output)
    for name in (RECORDING_NAME, VIEW_NAME, RESULTS_NAME):
        if (folder / name).exists():
            raise FileError(
                f"the folder {folder} already holds a run ({name}): choose another output folder"
            )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"the folder {folder} cannot be made: {error.strerror}") from None
    if not os.access(folder, os.W_OK):
        raise FileError(f"the folder {folder} cannot be written: choose another output folder")
    return folder
