"""Rigs that run: how long they take to start, to measure, to answer and to stop."""

import importlib.util
import subprocess
import sys
import time
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path

import numpy as np

from bench.measure import Bench, Figure, at_most, part
from bench.rig_processes import RigProcesses, use_own_domain
from impact_rig.configuration.processes import list_rig_processes
from impact_rig.core.errors import RigError
from impact_rig.recordings.schemas import SchemaDecoder
from impact_rig.recordings.source import RecordingSource

LONGEST_HELP = 0.3
"""Of `impact-rig --help` [s], as asked for."""
IMPORTS = 1
"""Starts of each node, by turns [-], our choice: half a second each, and no goal."""
EMPTY = ("-c", "pass")
HELP = ("-m", "impact_rig.cli.main", "--help")


@part("start", "Start of the command line and of each node", 7.0)
def measure_start(bench: Bench) -> Iterator[Figure]:
    """Time processes that end as soon as they have imported what they need."""
    if importlib.util.find_spec("rclpy") is None:
        raise ModuleNotFoundError("the nodes need rclpy", name="rclpy")
    helps, empties = [], []
    run_python(HELP)
    for _ in range(bench.extent.repeats):
        helps.append(run_python(HELP))
        empties.append(run_python(EMPTY))
    imports = {
        process.name: ("-c", f"import impact_rig.nodes.{process.name}")
        for process in list_rig_processes(bench.folder)
    }
    # Once all together: whoever comes first reads the files that the others need, too.
    run_python(("-c", "; ".join(statement for _, statement in imports.values())))
    times: dict[str, list[float]] = {name: [] for name in imports}
    for turn in range(IMPORTS):
        bench.report(turn, IMPORTS)
        for name, words in imports.items():
            times[name].append(run_python(words))
    yield Figure("impact-rig --help", helps, "s", at_most(LONGEST_HELP))
    yield Figure("python -c pass", empties, "s", note="in turns with it")
    for name, found in times.items():
        yield Figure(f"{name}, its imports", found, "s")


def run_python(words: Sequence[str]) -> float:
    """Run Python with arguments, and return how long that took [s]."""
    started = time.perf_counter()
    subprocess.run([sys.executable, *words], stdout=subprocess.DEVNULL, check=True)
    return time.perf_counter() - started


LONGEST_CAMPAIGN = 20.0
"""Of a campaign [s], as asked for."""


@part("demo", "The paper's campaign on the virtual rig, start to tables", 20.0)
def measure_demo(bench: Bench) -> Iterator[Figure]:
    """Run campaigns one after the other."""
    campaigns = bench.campaigns.take(bench.extent.demos, bench.report)
    times = (campaign.seconds for campaign in campaigns)
    note = "120 hits on twelve samples, seven processes, from the command to its end"
    yield Figure("impact-rig demo", times, "s", at_most(LONGEST_CAMPAIGN), note)


CAMPAIGNS = 2
"""That are looked at [-]: 240 hits, and 200 are asked for."""
LONGEST_MEDIAN = 15.0
LONGEST_TAIL = 40.0
"""Of median and 99th percentile [ms], as asked for."""
PERCENTILE = 99
MILLI = 1e-6
"""Nanoseconds to milliseconds."""
RELEASE = "/release"
BLOCK = "/acceleration"
STORED = "/recorder/stored"
VERDICT = "/impact"
ESTIMATE = "/estimate"
TOPICS = (RELEASE, BLOCK, STORED, VERDICT, ESTIMATE)


@dataclass(frozen=True)
class Chain:
    """When what was published of one hit, nanoseconds since the epoch.

    Attributes
    ----------
    contact : int
        The release command and the time of the swing after it.
    block : int
        The last block of the hit.
    stored : int
        The recorder's word that the hit is on its disk.
    verdict : int
        On this hit.
    estimate : int
        Of the sample, the first one after the verdict.
    """

    contact: int
    block: int
    stored: int
    verdict: int
    estimate: int


STEPS = (
    ("release to last block", "contact", "block"),
    ("last block to stored", "block", "stored"),
    ("stored to verdict", "stored", "verdict"),
    ("verdict to estimate", "verdict", "estimate"),
)
"""From which attribute of a chain to which."""


@part("latency", "From release command to published verdict and estimate", 1.0)
def measure_latency(bench: Bench) -> Iterator[Figure]:
    """Read in the recordings of campaigns when what was published."""
    count = min(CAMPAIGNS, bench.extent.demos)
    campaigns = bench.campaigns.take(count, bench.report)
    chains = [chain for item in campaigns for chain in read_chains(item.recording)]
    if not chains:
        raise RigError(
            "no hit of the recorded campaigns has release, blocks, verdict and estimate"
        )
    whole = [MILLI * (chain.estimate - chain.contact) for chain in chains]
    tail = np.percentile(whole, PERCENTILE)
    note = "the swing left out; publish times in the recording, seven processes"
    name = "release to verdict and estimate"
    yield Figure(name, whole, "ms", at_most(LONGEST_MEDIAN), note)
    yield Figure(f"{PERCENTILE}th percentile of it", tail, "ms", at_most(LONGEST_TAIL))
    for name, begin, end in STEPS:
        times = (MILLI * (getattr(chain, end) - getattr(chain, begin)) for chain in chains)
        yield Figure(name, times, "ms")


def read_chains(path: Path) -> list[Chain]:
    """Return every hit of a recording that came to an estimate, in the order of release."""
    decoder = SchemaDecoder()
    times: dict[str, dict[int, int]] = {topic: {} for topic in TOPICS}
    samples: dict[int, str] = {}
    estimates: dict[str, list[int]] = {}
    for raw in RecordingSource(path).read_messages(lambda channel: channel.topic in TOPICS):
        message = decoder.decode(raw.channel, raw.data)
        topic, moment = raw.channel.topic, raw.publish_time
        if topic == ESTIMATE:
            estimates.setdefault(message.name, []).append(moment)
        elif topic == RELEASE:
            samples[message.record] = message.sample
            times[topic][message.record] = moment + round(1e9 * message.swing_time)
        elif (topic != BLOCK or message.last) and (topic != STORED or message.complete):
            times[topic][message.record] = moment
    chains = []
    for record, sample in samples.items():
        first, block, stored, verdict = (
            times[topic].get(record) for topic in (RELEASE, BLOCK, STORED, VERDICT)
        )
        if first is None or block is None or stored is None or verdict is None:
            continue
        estimate = find_first(sorted(estimates.get(sample, [])), verdict)
        if estimate is not None:
            chains.append(Chain(first, block, stored, verdict, estimate))
    return chains


def find_first(moments: Sequence[int], least: int) -> int | None:
    """Return the first of rising moments that is not before another; None: there is none."""
    place = bisect_left(moments, least)
    return moments[place] if place < len(moments) else None


STOPS = 5
"""Of each kind, by turns [-], our choice: each takes half a second."""
LONGEST_STOP = 1.0
"""From the command's start to the disarmed hammer [s], as the README says."""
SAMPLE = "steel small"
HITS = "10000"
"""More than are struck meanwhile."""


@part("stop", "From the command to stop to the disarmed hammer", 12.0)
def measure_stop(bench: Bench) -> Iterator[Figure]:
    """Stop a campaign again and again, by the command and by rclpy alone."""
    delays: tuple[list[float], list[float]] = ([], [])
    with (
        use_own_domain() as environment,
        RigProcesses(environment, bench.folder / "log.txt") as processes,
    ):
        processes.start_rig(bench.folder, {}, visualize=False)
        hammer = processes.start_outside("hammer")
        processes.start_outside("campaign", SAMPLE, HITS)
        for turn in range(STOPS):
            for number, found in enumerate(delays):
                bench.report(2 * turn + number, 2 * STOPS)
                hammer.wait_for("the hammer is not released", itemgetter("released"))
                started = time.time()
                stopper = (
                    processes.start_command("hammer", "stop")
                    if number == 0
                    else processes.start_outside("stop").process
                )
                state = hammer.wait_for("the hammer is not stopped", itemgetter("stopped"))
                found.append(state["time"] - started)
                if stopper.wait():
                    raise RigError(f"a stop has failed: {processes.read_log()}")
    ours, bare = delays
    note = (
        "a campaign runs; from the start of the command's process to the stamp of the hammer's"
        " state"
    )
    name = "impact-rig hammer stop, to the disarmed hammer"
    yield Figure(name, ours, "s", at_most(LONGEST_STOP), note)
    yield Figure("a process with rclpy alone", bare, "s", note="by turns with it")
