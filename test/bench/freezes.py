"""A node stands still in a campaign: the hammer must not swing before a person has armed it."""

import signal
import time
from collections.abc import Iterator
from pathlib import Path

from bench.measure import Bench, Figure
from bench.rig_processes import RigProcesses
from impact_rig.core.given.errors import RigError
from impact_rig.nodes.interfaces import RELEASE
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.schemas import decode_message
from impact_rig.recordings.source import find_recordings

HAMMER = {"hammer": {"swing_time": 0.2}}
CAMPAIGN = ("campaign", "--sample", "steel small", "--impacts", "10000")
ALL = "all"
NODES = ("hammer", "accelerometer", "recorder", "campaign", ALL)
"""On whom the enable rests, each alone, and with everybody else."""
LONG = 20.0
"""Longer than a campaign waits for a verdict [s]: it pauses for the estimator, too."""
WATCH = 8.0  # [s], after the freeze; without the rule the first swing came after 2.5 to 3.1 s


def count_swings(folder: Path, since: int) -> int:
    """Return how many releases the recordings have after a time [ns since the epoch]."""
    return sum(
        message.header.stamp.sec * 10**9 + message.header.stamp.nanosec > since
        for path in find_recordings(folder)
        for message in map(
            decode_message,
            Scan(path).read_messages(lambda channel: channel.topic == f"/{RELEASE.name}"),
        )
    )


def freeze(folder: Path, node: str, seconds: float) -> int:
    """Freeze a node, or all, in a campaign of a rig of its own; return the swings after that."""
    log = folder / "campaign.log"
    with RigProcesses(folder / "log.txt") as processes:
        running = processes.start_rig(folder, HAMMER)
        processes.start_command(*CAMPAIGN, "--wait", "1 min", log=log)
        processes.wait_until(
            lambda: log.exists() and "sample 1 of" in log.read_text(),
            "the campaign does not begin",
        )
        time.sleep(3.0)  # some hits
        frozen = list(running.values()) if node == ALL else [running[node]]
        for process in frozen:
            process.send_signal(signal.SIGSTOP)
        time.sleep(seconds)
        woken = time.time_ns()
        for process in frozen:
            process.send_signal(signal.SIGCONT)
        time.sleep(WATCH)
    if not count_swings(folder, 0):
        raise RigError(f"there was no hit before the freeze: see {log}")
    return count_swings(folder, woken)


def measure_freezes(bench: Bench) -> Iterator[Figure]:
    """Freeze each node alone, and all together, and look for swings without an arming."""
    cases = [(node, 3.0) for node in NODES]
    if bench.extent.long_freezes:
        cases += [(node, LONG) for node in (*NODES, "estimator")]
    swings: dict[str, int] = {}
    for node, seconds in cases:
        folder = bench.folder / f"frozen_{node}_{seconds:g}"
        folder.mkdir()
        swings[f"{node} {seconds:g} s"] = freeze(folder, node, seconds)
    note = ", ".join(f"{case}: {count}" for case, count in swings.items())
    yield Figure(
        "swings without an arming, after a freeze", sum(swings.values()), note=note, most=0
    )
