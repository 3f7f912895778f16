"""From a record that is complete in an instrument to its last block in another process."""

import contextlib
import json
import queue
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from impact_rig.bench.figures import Figure, at_most
from impact_rig.bench.part import Bench, Part
from impact_rig.bench.rig_processes import RigProcesses, listen, use_own_domain
from impact_rig.configuration.rig_file import read_template
from impact_rig.core.errors import RigError

HITS = 100
"""That are struck [-], our choice."""
SETTLING = 3
"""Hits before them that do not count [-], our choice: what is used first is imported then."""
LONGEST = 10.0
"""From the complete record to the published block [ms], as asked for."""
PERCENTILE = 99
PATIENCE = 60.0
"""How long processes may take to say what comes next [s]."""
PEER = "impact_rig.devices.peers.scpi_digitizer"
ARMING = "impact_rig.bench.arming_process"
ARMER = "armer"
"""The node of this process."""
SENSITIVITY = "4 mV/g"
SOURCE = """
[source]
driver = "scpi"
sampling_rate = "2.5 MHz"
record_duration = "2 ms"
trigger_level = "5 g"
address = "{address}"
[source.hammer]
channel = 1
sensitivity = "{sensitivity}"
[source.specimen]
channel = 2
sensitivity = "{sensitivity}"
"""
"""Two channels of 5000 points."""


def measure(bench: Bench) -> tuple[Figure, ...]:
    """Strike hits at an instrument of this computer, and see when their records are there."""
    times = measure_scpi(bench.folder, HITS, bench)
    return (
        Figure(
            "SCPI record to published block",
            tuple(times),
            "ms",
            at_most(LONGEST),
            note="2 x 5000 points; instrument, accelerometers and observer are processes",
        ),
        Figure(
            f"{PERCENTILE}th percentile of it", (float(np.percentile(times, PERCENTILE)),), "ms"
        ),
    )


def measure_scpi(folder: Path, hits: int, bench: Bench) -> list[float]:
    """Return how long each record took [ms].

    Raises
    ------
    RigError
        If a process does not do its part.
    """
    with (
        start_peer() as peer,
        use_own_domain() as environment,
        RigProcesses(environment, folder / "log.txt") as processes,
    ):
        said = listen(peer)
        rig_file = folder / "rig.toml"
        address = hear(said, processes)["address"]
        source = SOURCE.format(address=address, sensitivity=SENSITIVITY)
        rig_file.write_text(read_template() + source, "utf-8")
        processes.start_node("accelerometer", rig_file=str(rig_file), required_subscribers=ARMER)
        seen = listen(processes.start_module(ARMING, listen=True))
        times = []
        for hit in range(SETTLING + hits):
            bench.report(hit, SETTLING + hits)
            record = hear(seen, processes)["armed"]
            tell(peer, "strike")
            complete = hear(said, processes)["complete"]
            block = hear(seen, processes)
            if complete is None or block["record"] != record:
                raise RigError(f"hit {hit} is not in record {record}: {processes.read_log()}")
            times.append(1e3 * (block["time"] - complete))
    return times[SETTLING:]


@contextlib.contextmanager
def start_peer() -> Iterator[subprocess.Popen[str]]:
    """Lend an instrument that is a process, and a hammer at its inputs."""
    words = [sys.executable, "-m", PEER, "--hammer", SENSITIVITY, "--specimen", SENSITIVITY]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as peer:
        try:
            yield peer
        finally:
            peer.kill()


def tell(peer: subprocess.Popen[str], word: str) -> None:
    """Say a word to the instrument's process."""
    if peer.stdin is None:
        raise RigError("the instrument's process takes no words")
    peer.stdin.write(f"{word}\n")
    peer.stdin.flush()


def hear(lines: "queue.Queue[str]", processes: RigProcesses) -> dict[str, Any]:
    """Return what a process says next."""
    try:
        line = lines.get(timeout=PATIENCE)
    except queue.Empty:
        line = ""
    if not line:
        raise RigError(f"the records do not come: {processes.read_log()}")
    said: dict[str, Any] = json.loads(line)
    return said


PART = Part("devices", "From an instrument's complete record to its published block", measure, 4.0)
