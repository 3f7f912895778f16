"""Thousands of hits: what the last ones cost, and how the memory of every node grows."""

import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from statistics import median
from subprocess import Popen
from typing import Any

import psutil

from bench.campaigns import check_room
from bench.measure import Bench, Figure, at_most, part
from bench.rig_processes import RigProcesses, Said, use_own_domain
from impact_rig.core.errors import RigError
from impact_rig.core.session import Session
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.signals.record import Block, HitLabel
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings

DIFFERENT_HITS = 200
"""That are simulated, and struck in turn [-], our choice."""
COMPARED = 0.1
"""Of the hits that are compared, at the beginning and at the end [-]: a thousand of 10 000."""
LARGEST_COST = 1.1
"""Of a late hit over an early one [-], our choice: the same, within what a machine scatters."""
LARGEST_HIT = 1.0
"""By which memory may grow with each hit [kB], as asked for."""
TRACE_SIZE = 42e3
"""Of a hit in the temporary file [byte]."""
KILO = 1e3


@part("series", "Ten thousand hits on one sample: the last cost as the first", 20.0)
def measure_series(bench: Bench) -> Iterator[Figure]:
    """Judge hit after hit; in the first and the last tenth, estimate tau_p, k and c after each."""
    hits, sample = bench.extent.hits, PAPER_SETUP.samples.control_sample
    check_room(
        Path(tempfile.gettempdir()), TRACE_SIZE * hits, f"{hits} hits", "ask for fewer --hits"
    )
    strikes = _simulate(sample, min(DIFFERENT_HITS, hits), bench.extent.seed)
    session, process = Session(PAPER_SETUP), psutil.Process()
    compared = max(int(COMPARED * hits), 1)
    times: list[float] = []
    memory = 0.0
    for number in range(hits):
        if number % compared == 0:
            bench.report(number, hits)
        label = HitLabel(sample, number + 1, number + 1)
        blocks = [replace(block, label=label) for block in strikes[number % len(strikes)]]
        began = time.process_time()
        for block in blocks:
            session.feed(block)
        if not compared <= number < hits - compared:
            session.estimate_numbers(sample)
            times.append(time.process_time() - began)
        if number + 1 == compared:
            memory = process.memory_info().rss
    grown = (process.memory_info().rss - memory) / max(hits - compared, 1)
    early, late = median(times[:compared]), median(times[-compared:])
    name = f"cost of the last {compared} of {hits} hits over the first"
    note = f"{1e3 * late:.2f} over {1e3 * early:.2f} ms"
    yield Figure(name, late / early, "", at_most(LARGEST_COST), note)
    yield Figure("memory of each hit", grown / KILO, "kB", at_most(LARGEST_HIT))


def _simulate(sample: str, count: int, seed: int) -> list[tuple[Block, ...]]:
    rig = VirtualRig(PAPER_SETUP, VirtualRigSettings(seed=seed))
    size = VirtualRigSettings().digitizer.count
    return [
        rig.strike(HitLabel(sample, number + 1)).split(size, stamp=0) for number in range(count)
    ]


SAMPLE = "steel small"
"""That is struck, our choice."""
EARLY_HITS = 500
"""After which the memory is looked at first [-], our choice: by then all is loaded and full."""
SHARE = 0.3
"""Of the hits of part `series` [-], our choice: a rig of six processes strikes 80 a second."""
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


@part("memory", "Memory of each node after thousands of hits, and what a hit costs", 60.0)
def measure_memory(bench: Bench) -> Iterator[Figure]:
    """Strike one sample very often, and look at all nodes early, late and in between."""
    hits = max(int(SHARE * bench.extent.hits), 2)
    early_hits = min(EARLY_HITS, hits // 2)
    check_room(bench.folder, HIT_SIZE * hits, f"{hits} hits", "ask for fewer --hits")
    with (
        use_own_domain() as environment,
        RigProcesses(environment, bench.folder / "log.txt") as processes,
    ):
        nodes = processes.start_rig(bench.folder, OVERRIDES, visualize=True)
        campaign = processes.start_outside("campaign", SAMPLE, str(hits + FURTHER_HITS))
        early: dict[str, float] = {}
        spent: list[tuple[int, dict[str, float]]] = []
        done = 0
        while done < hits:
            before, done = done, _wait_for_hits(campaign)
            if before < early_hits <= done:
                early = read_memory(nodes)
            is_reported = before // REPORT_PERIOD < done // REPORT_PERIOD
            if is_reported:
                bench.report(done, hits)
            # The first word is that it begins.
            if not spent or is_reported or done >= hits:
                spent.append((done, read_processor_times(nodes)))
        late = read_memory(nodes)
    for name in nodes:
        yield Figure(
            f"{name}, memory of each hit from {early_hits} to {hits}",
            (late[name] - early[name]) / (hits - early_hits) / KILO,
            "kB",
            at_most(LARGEST_HIT),
            f"{late[name] / MEGA:.1f} MB after {early[name] / MEGA:.1f}",
        )
    yield compute_hit_cost(spent)


def compute_hit_cost(spent: Sequence[tuple[int, Mapping[str, float]]]) -> Figure:
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
        (sum(compare(*looks).values()) for looks in pairwise(spent)),
        "ms",
        note=", ".join(f"{name} {share:.1f}" for name, share in shares.items()),
    )


def _wait_for_hits(campaign: Said) -> int:
    """Wait for the next word of the campaign, and return how many hits there are."""
    count = campaign.wait_for("the rig does not strike")
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
