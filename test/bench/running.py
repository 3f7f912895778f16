"""Rigs that run: how long they take to start, to measure, to answer and to stop."""

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bench.measure import Bench, Figure
from bench.rig_processes import RigProcesses, run_campaign
from impact_rig.core.given.errors import RigError
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.schemas import decode_message

LONGEST_CAMPAIGN = 20.0  # [s], as asked for


def measure_demo(bench: Bench) -> Iterator[Figure]:
    """Run campaigns one after the other."""
    times = (run_campaign(bench.campaigns / str(n)).seconds for n in range(bench.extent.demos))
    note = "120 hits on twelve samples, seven processes, from the command to its end"
    yield Figure("impact-rig demo", times, "s", note, most=LONGEST_CAMPAIGN)


CAMPAIGNS = 2  # that are looked at: 240 hits, and 200 are asked for
LONGEST_MEDIAN, LONGEST_TAIL = 15.0, 40.0  # [ms], median and 99th percentile, as asked for
PERCENTILE = 99
RELEASE, VERDICT, ESTIMATE = "/release", "/impact", "/estimate"


def measure_latency(bench: Bench) -> Iterator[Figure]:
    """Read in the recordings of campaigns when what was published."""
    recordings = [run_campaign(bench.campaigns / str(n)).recording for n in range(CAMPAIGNS)]
    delays = [1e-6 * delay for path in recordings for delay in read_delays(path)]
    if not delays:
        raise RigError("no hit of the recorded campaigns has release, verdict and estimate")
    tail = np.percentile(delays, PERCENTILE)
    note = "the swing left out; publish times in the recording, seven processes"
    name = "release to verdict and estimate"
    yield Figure(name, delays, "ms", note, most=LONGEST_MEDIAN)
    yield Figure(f"{PERCENTILE}th percentile of it", tail, "ms", most=LONGEST_TAIL)


def read_delays(path: Path) -> list[int]:
    """Return the time from each contact to the sample's first estimate after its verdict [ns]."""
    contacts: dict[int, int] = {}  # by record; the release command and the time of the swing
    verdicts: dict[str, list[tuple[int, int]]] = {}  # times and records of a sample's
    estimates: dict[str, list[int]] = {}  # times of a sample's
    for raw in Scan(path).read_messages(
        lambda channel: channel.topic in (RELEASE, VERDICT, ESTIMATE)
    ):
        message, moment = decode_message(raw), raw.publish_time
        if raw.channel.topic == RELEASE:
            contacts[message.record] = moment + round(1e9 * message.swing_time)
        elif raw.channel.topic == VERDICT:
            verdicts.setdefault(message.sample, []).append((moment, message.record))
        else:
            estimates.setdefault(message.name, []).append(moment)
    return [
        min(later) - contacts[record]
        for sample, found in verdicts.items()
        for verdict, record in found
        if record in contacts
        and (later := [moment for moment in estimates.get(sample, []) if moment >= verdict])
    ]


STOPS = 5
LONGEST_STOP = 1.0  # [s], as the README says
ENDLESS = ("--sample", "steel small", "--impacts", "10000")  # more than are struck meanwhile


def measure_stop(bench: Bench) -> Iterator[Figure]:
    """Stop a campaign again and again."""
    delays: list[float] = []
    with RigProcesses(bench.folder / "log.txt") as processes:

        def do(action: str) -> bool:
            return processes.start_command("hammer", action).wait() == 0

        processes.start_rig(bench.folder, {})
        processes.start_command("campaign", *ENDLESS, "--output", str(bench.folder / "results"))
        for _ in range(STOPS):
            processes.wait_until(lambda: do("arm"), "the hammer cannot be armed")
            started = time.perf_counter()
            if not do("stop"):
                raise RigError(f"a stop has failed: {processes.read_log()}")
            delays.append(time.perf_counter() - started)
            do("reset")
    note = "a campaign runs; from the command's start to its end"
    yield Figure("impact-rig hammer stop", delays, "s", note, most=LONGEST_STOP)
