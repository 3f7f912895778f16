"""Rigs that run: how long they take to start, to measure, to answer and to stop."""

import time
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path

import numpy as np

from bench.measure import Bench, Figure, at_most, part
from bench.rig_processes import RigProcesses, use_own_domain
from impact_rig.core.errors import RigError
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.schemas import SchemaDecoder

LONGEST_CAMPAIGN = 20.0
"""Of a campaign [s], as asked for."""


@part("demo", "The paper's campaign on the virtual rig, start to tables", 20.0)
def measure_demo(bench: Bench) -> Iterator[Figure]:
    """Run campaigns one after the other."""
    campaigns = bench.campaigns.take(bench.extent.demos)
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
    """When what was published of one hit [ns since the epoch]."""

    contact: int  # the release command and the time of the swing
    block: int  # the last block of the hit
    stored: int  # the hit is on the recorder's disk
    verdict: int
    estimate: int  # the first one of the sample after the verdict


@part("latency", "From release command to published verdict and estimate", 1.0)
def measure_latency(bench: Bench) -> Iterator[Figure]:
    """Read in the recordings of campaigns when what was published."""
    count = min(CAMPAIGNS, bench.extent.demos)
    campaigns = bench.campaigns.take(count)
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


def read_chains(path: Path) -> list[Chain]:
    """Return every hit of a recording that came to an estimate, in the order of release."""
    decoder = SchemaDecoder()
    times: dict[str, dict[int, int]] = {topic: {} for topic in TOPICS}
    samples: dict[int, str] = {}
    estimates: dict[str, list[int]] = {}
    for raw in Scan(path).read_messages(lambda channel: channel.topic in TOPICS):
        message = decoder.decode(raw.channel, raw.data)
        topic, moment = raw.channel.topic, raw.publish_time
        if topic == ESTIMATE:
            estimates.setdefault(message.name, []).append(moment)
        elif topic == RELEASE:
            samples[message.record] = message.sample
            times[topic][message.record] = moment + round(1e9 * message.swing_time)
        elif topic != BLOCK or message.last:
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
LONGEST_STOP = 1.0
"""From the command's start to the disarmed hammer [s], as the README says."""
SAMPLE = "steel small"
HITS = "10000"
"""More than are struck meanwhile."""


@part("stop", "From the command to stop to the disarmed hammer", 12.0)
def measure_stop(bench: Bench) -> Iterator[Figure]:
    """Stop a campaign again and again."""
    delays: list[float] = []
    with (
        use_own_domain() as environment,
        RigProcesses(environment, bench.folder / "log.txt") as processes,
    ):
        processes.start_rig(bench.folder, {}, visualize=False)
        hammer = processes.start_outside("hammer")
        processes.start_outside("campaign", SAMPLE, HITS)
        for _ in range(STOPS):
            hammer.wait_for("the hammer is not released", itemgetter("released"))
            started = time.time()
            stopper = processes.start_command("hammer", "stop")
            state = hammer.wait_for("the hammer is not stopped", itemgetter("stopped"))
            delays.append(state["time"] - started)
            if stopper.wait():
                raise RigError(f"a stop has failed: {processes.read_log()}")
    note = "a campaign runs; from the command's start to the stamp of the hammer's state"
    yield Figure("impact-rig hammer stop", delays, "s", at_most(LONGEST_STOP), note)
