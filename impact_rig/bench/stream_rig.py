"""Accelerometers that stream all the time, an estimator and a recorder, as processes."""

import json
import queue
import subprocess
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import psutil

from impact_rig.bench.rig_processes import RigProcesses, listen, use_own_domain
from impact_rig.core.errors import RigError

COMPRESSION = "lz4"
POINT_SIZE = 8
"""Of a point of both channels [byte]."""
PERIOD = 0.01
"""Between two blocks [s], as asked for."""
DEPTH = 500
"""Blocks that may wait anywhere on their way [-], our choice: for 5 s a busy computer may do
something else."""
FLOWING = {"/estimator": "stream blocks", "/recorder": "stream blocks"}
"""What each of these nodes counts in its diagnostics once the stream reaches it."""
START_TIMEOUT = 60.0
"""How long that may take [s]."""
LISTENER = "impact_rig.bench.diagnostics_process"
SETTLING = 2.0
"""From then on to the beginning of the measurement [s], our choice: nodes that have just started
find each other, and import what they use first."""
SETUP_SOURCE = "campaign"
"""The node that tells the estimator of the rig; it does nothing else here."""


@dataclass(frozen=True)
class StreamRun:
    """What was streamed.

    Attributes
    ----------
    recording : Path
        Of it.
    begin, end : int
        Between which it was measured, nanoseconds since the epoch.
    shares : mapping of str to float
        Processor time of each node meanwhile over that time [cores].
    """

    recording: Path
    begin: int
    end: int
    shares: Mapping[str, float]


def run_stream(folder: Path, sampling_rate: float, seconds: float) -> StreamRun:
    """Let three processes stream, search and record for a while.

    Parameters
    ----------
    folder : Path
        Of the recording.
    sampling_rate : float
        Of each of two channels [Hz].
    seconds : float
        That are measured [s].

    Raises
    ------
    RigError
        If a process ends by itself, or nothing is recorded.
    """
    recording = folder / "stream.mcap"
    with (
        use_own_domain() as environment,
        RigProcesses(environment, folder / "log.txt") as processes,
    ):
        told = listen(processes.start_module(LISTENER, listen=True))
        processes.start_node(SETUP_SOURCE)
        nodes = {
            "recorder": processes.start_node(
                "recorder",
                output=str(recording),
                compression=COMPRESSION,
                record_stream=True,
                stream_depth=DEPTH,
                sync="chunk",
            ),
            "estimator": processes.start_node("estimator", stream_depth=DEPTH),
            "accelerometer": processes.start_node(
                "accelerometer",
                mode="continuous",
                sampling_rate=sampling_rate,
                stream_block_size=round(PERIOD * sampling_rate),
                stream_depth=DEPTH,
            ),
        }
        _await_flow(told, processes)
        processes.kill([LISTENER])
        time.sleep(SETTLING)
        before, begin = _read_times(nodes, processes), time.time_ns()
        time.sleep(seconds)
        after, end = _read_times(nodes, processes), time.time_ns()
        # The source first: what it has sent is still written.
        for name in ("accelerometer", "recorder"):
            if processes.stop(name):
                raise RigError(f"the {name} node did not end well: {processes.read_log()}")
    shares = {name: (after[name] - before[name]) * 1e9 / (end - begin) for name in nodes}
    return StreamRun(recording, begin, end, shares)


def _await_flow(told: "queue.Queue[str]", processes: RigProcesses) -> None:
    """Wait until every node that listens to the stream gets it."""
    missing = dict(FLOWING)
    deadline = time.monotonic() + START_TIMEOUT
    while missing:
        try:
            line = told.get(timeout=max(deadline - time.monotonic(), 0.0))
        except queue.Empty:
            line = ""
        if not line:
            raise RigError(
                f"the stream does not reach {' and '.join(missing)}: {processes.read_log()}"
            )
        status = json.loads(line)
        if int(status["values"].get(missing.get(status["node"]), 0)) > 0:
            del missing[status["node"]]


def _read_times(
    nodes: Mapping[str, subprocess.Popen[str]], processes: RigProcesses
) -> dict[str, float]:
    """Return the processor time of each node so far [s]."""
    try:
        times = {name: psutil.Process(node.pid).cpu_times() for name, node in nodes.items()}
    except psutil.Error:
        raise RigError(f"the stream broke off: {processes.read_log()}") from None
    return {name: item.user + item.system for name, item in times.items()}
