"""Memory of every node over thousands of hits, and the processor time that a hit takes."""

import json
import queue
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from subprocess import Popen
from typing import Any

import psutil

from impact_rig.bench.disk import check_room
from impact_rig.bench.figures import Figure, at_most
from impact_rig.bench.part import Bench, Part
from impact_rig.bench.rig_processes import RigProcesses, listen, use_own_domain
from impact_rig.core.errors import RigError

SAMPLE = "steel small"
"""That is struck, our choice."""
CAMPAIGN = "impact_rig.bench.campaign_process"
EARLY_HITS = 100
"""After which the memory is looked at first [-], as asked for."""
LARGEST_GROWTH = 1.05
"""Memory at the end over that after `EARLY_HITS` [-], as asked for."""
FURTHER_HITS = 100
"""Which the campaign goes on [-], our choice: its end asks for all results at once."""
OVERRIDES = {
    "hammer": {"swing_time": 0.0},
    "accelerometer": {"trigger_timeout": 0.1, "block_size": 5000},
}
"""Nobody waits for a simulated swing, and a hit is one block: the more hits in the time."""
HIT_SIZE = 300e3
"""Of recording and view on the disk [byte], at most."""
REPORT_PERIOD = 50
"""Hits from one report to the next [-]."""
MEGA = 1e6
MILLI = 1e3


def measure(bench: Bench) -> tuple[Figure, ...]:
    """Strike one sample very often, and look at all nodes early, late and in between."""
    hits = bench.extent.hits
    early_hits = min(EARLY_HITS, hits)
    check_room(bench.folder, HIT_SIZE * hits, f"{hits} hits", "ask for fewer --hits")
    with (
        use_own_domain() as environment,
        RigProcesses(environment, bench.folder / "log.txt") as processes,
    ):
        nodes = processes.start_rig(bench.folder, OVERRIDES, visualize=True)
        words = [SAMPLE, str(hits + FURTHER_HITS)]
        lines = listen(processes.start_module(CAMPAIGN, words, listen=True))
        early: dict[str, float] = {}
        spent: list[tuple[int, dict[str, float]]] = []
        done = 0
        while done < hits:
            before, done = done, _await_hits(lines, processes)
            if before < early_hits <= done:
                early = read_memory(nodes)
            is_reported = before // REPORT_PERIOD < done // REPORT_PERIOD
            if is_reported:
                bench.report(done, hits)
            # The first word is that it begins.
            if not spent or is_reported or done >= hits:
                spent.append((done, read_processor_times(nodes)))
        late = read_memory(nodes)
    memory = [
        Figure(
            f"{name}, after {hits} hits over after {early_hits}",
            (late[name] / early[name],),
            goal=at_most(LARGEST_GROWTH),
            note=f"{late[name] / MEGA:.1f} over {early[name] / MEGA:.1f} MB",
        )
        for name in nodes
    ]
    return (*memory, find_hit_cost(spent))


def find_hit_cost(spent: Sequence[tuple[int, Mapping[str, float]]]) -> Figure:
    """Return what a hit costs in all nodes together, from one look at them to the next.

    Parameters
    ----------
    spent : sequence of tuple
        Hits so far, and the processor time of each node so far [s]; at least two.
    """

    def compare(
        before: tuple[int, Mapping[str, float]], after: tuple[int, Mapping[str, float]]
    ) -> dict[str, float]:
        hits = after[0] - before[0]
        return {name: MILLI * (after[1][name] - before[1][name]) / hits for name in after[1]}

    shares = compare(spent[0], spent[-1])
    return Figure(
        "processor time of all nodes per hit",
        tuple(sum(compare(*looks).values()) for looks in pairwise(spent)),
        "ms",
        note=", ".join(f"{name} {share:.1f}" for name, share in shares.items()),
    )


def _await_hits(lines: "queue.Queue[str]", processes: RigProcesses) -> int:
    """Wait for the next word of the campaign, and return how many hits there are."""
    line = lines.get()
    if not line:
        raise RigError(f"the rig does not strike: {processes.read_log()}")
    count = json.loads(line)
    if count["rejected"]:
        raise RigError(f"{count['rejected']} good hits of {count['hits']} were rejected")
    return int(count["hits"])


def read_processor_times(processes: Mapping[str, Popen[str]]) -> dict[str, float]:
    """Return the processor time that processes have taken so far [s]; errors as `read_memory`."""
    return {
        name: times.user + times.system
        for name, times in _look(processes, lambda process: process.cpu_times()).items()
    }


def read_memory(processes: Mapping[str, Popen[str]]) -> dict[str, float]:
    """Return the resident memory of processes [byte].

    What they share with others is counted in full: a part of it, or none, would change with
    whatever else is started or ended on the machine.

    Raises
    ------
    RigError
        If one of them has ended.
    """
    return {
        name: float(memory.rss)
        for name, memory in _look(processes, lambda process: process.memory_info()).items()
    }


def _look(
    processes: Mapping[str, Popen[str]], read: Callable[[psutil.Process], Any]
) -> dict[str, Any]:
    found = {}
    for name, process in processes.items():
        try:
            found[name] = read(psutil.Process(process.pid))
        except psutil.Error as error:
            raise RigError(f"the {name} node cannot be looked at: {error}") from None
    return found


PART = Part(
    "memory", "Memory of each node after thousands of hits, and what a hit costs", measure, 140.0
)
