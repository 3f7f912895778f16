"""From a record that is complete in an instrument to its last block in another process."""

import contextlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bench.digitizer import SENSITIVITY
from bench.measure import Bench, Figure, at_most, part
from bench.rig_processes import RigProcesses, Said, use_own_domain
from impact_rig.configuration.rig_file import read_template
from impact_rig.core.errors import RigError

HITS = 100
"""That are struck [-], our choice."""
WARM_UP = 3
"""Hits before them that do not count [-], our choice: what is used first is imported then."""
LONGEST = 10.0
"""From the complete record to the published block [ms], as asked for."""
PERCENTILE = 99
ARMER = "armer"
"""The node that arms the accelerometers."""
NO_RECORDS = "the records do not come"
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


@part("devices", "From an instrument's complete record to its published block", 4.0)
def measure_devices(bench: Bench) -> Iterator[Figure]:
    """Strike hits at an instrument of this computer, and see when their records are there."""
    times = measure_scpi(bench.folder, HITS, bench)
    note = "2 x 5000 points; instrument, accelerometers and observer are processes"
    yield Figure("SCPI record to published block", times, "ms", at_most(LONGEST), note)
    yield Figure(f"{PERCENTILE}th percentile of it", np.percentile(times, PERCENTILE), "ms")


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
        instrument = Said(peer, processes.read_log)
        rig_file = folder / "rig.toml"
        address = instrument.wait_for(NO_RECORDS)["address"]
        source = SOURCE.format(address=address, sensitivity=SENSITIVITY)
        rig_file.write_text(read_template() + source, "utf-8")
        processes.start_node("accelerometer", rig_file=str(rig_file), required_subscribers=ARMER)
        observer = processes.start_outside("arm")
        times = []
        for hit in range(WARM_UP + hits):
            bench.report(hit, WARM_UP + hits)
            record = observer.wait_for(NO_RECORDS)["armed"]
            tell(peer, "strike")
            complete = instrument.wait_for(NO_RECORDS)["complete"]
            block = observer.wait_for(NO_RECORDS)
            if complete is None or block["record"] != record:
                raise RigError(f"hit {hit} is not in record {record}: {processes.read_log()}")
            times.append(1e3 * (block["time"] - complete))
    return times[WARM_UP:]


@contextlib.contextmanager
def start_peer() -> Iterator[subprocess.Popen[str]]:
    """Lend an instrument that is a process, and a hammer at its inputs."""
    words = [sys.executable, "-m", "bench.digitizer"]
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
