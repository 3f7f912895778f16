"""From the release command to the published estimate, and where the time goes."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from impact_rig.bench.figures import Figure, at_most
from impact_rig.bench.part import Bench, Part
from impact_rig.core.errors import RigError
from impact_rig.recording.interfaces.schema_decoder import SchemaDecoder
from impact_rig.recording.reading.mcap_file import McapFile

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


def measure(bench: Bench) -> tuple[Figure, ...]:
    """Read in the recordings of campaigns when what was published."""
    count = min(CAMPAIGNS, bench.extent.demos)
    campaigns = bench.campaigns.take(count, bench.report)
    chains = [chain for item in campaigns for chain in read_chains(item.recording)]
    if not chains:
        raise RigError(
            "no hit of the recorded campaigns has release, blocks, verdict and estimate"
        )
    whole = [MILLI * (chain.estimate - chain.contact) for chain in chains]
    steps = {
        "release to last block": [chain.block - chain.contact for chain in chains],
        "last block to stored": [chain.stored - chain.block for chain in chains],
        "stored to verdict": [chain.verdict - chain.stored for chain in chains],
        "verdict to estimate": [chain.estimate - chain.verdict for chain in chains],
    }
    return (
        Figure(
            "release to verdict and estimate",
            tuple(whole),
            "ms",
            at_most(LONGEST_MEDIAN),
            note="the swing left out; publish times in the recording, seven processes",
        ),
        Figure(
            f"{PERCENTILE}th percentile of it",
            (float(np.percentile(whole, PERCENTILE)),),
            "ms",
            at_most(LONGEST_TAIL),
        ),
        *(
            Figure(name, tuple(MILLI * time for time in times), "ms")
            for name, times in steps.items()
        ),
    )


def read_chains(path: Path) -> list[Chain]:
    """Return every hit of a recording that came to an estimate, in the order of release."""
    decoder = SchemaDecoder()
    times: dict[str, dict[int, int]] = {topic: {} for topic in TOPICS}
    samples: dict[int, str] = {}
    estimates: dict[str, list[int]] = {}
    for raw in McapFile(path).read_messages(lambda channel: channel.topic in TOPICS):
        message = decoder.decode(raw.channel, raw.data)
        topic, moment = raw.channel.topic, raw.publish_time
        if topic == ESTIMATE:
            estimates.setdefault(message.sample, []).append(moment)
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


PART = Part("latency", "From release command to published verdict and estimate", measure, 1.0)
