"""Rigs that run: how long they take to start, to measure, to answer and to stop."""

import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from statistics import median

import numpy as np
import psutil
from impact_rig_msgs.msg import Channel

from bench.measure import Bench, Figure
from bench.rig_processes import RigProcesses, run_campaign
from impact_rig.core.given.errors import RigError
from impact_rig.nodes.interfaces import ACCELERATION, IMPACT
from impact_rig.nodes.listener import BackgroundNode
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.schemas import decode_message
from impact_rig.testing import use_own_domain
from impact_rig.testing.running import QUICK, run_virtual_rig

HITS = 120, 12  # of the paper's campaign, and of one with a single hit of each sample
SMALL = ("--impacts", "1")
NAME = "impact-rig demo"


def measure_demo(bench: Bench) -> Iterator[Figure]:
    """Run campaigns, in turn with those of another checkout if one is named."""
    turns = range(bench.extent.demos)
    ours, others = [], []
    for turn in turns:
        ours.append(run_campaign(bench.campaigns / str(turn)))
        if bench.beside is not None:
            others.append(run_campaign(bench.campaigns / f"beside {turn}", beside=bench.beside))
    small = [run_campaign(bench.campaigns / f"small {turn}", *SMALL) for turn in turns]
    note = "120 hits on twelve samples, seven processes, from the command to its end"
    yield Figure(NAME, [it.seconds for it in ours], "s", note, most=7.0)
    releases = [(read_release(it.recording) - it.began) * 1e-9 for it in ours]
    yield Figure("first release after the start", releases, "s", most=2.5)
    used = median(it.processor_time for it in ours)
    of_small = median(it.processor_time for it in small)
    yield Figure(f"{NAME}, processor time", used, "s", "all processes")
    hit = 1e3 * (used - of_small) / (HITS[0] - HITS[1])
    yield Figure("processor time of a hit", hit, "ms", "all processes", most=28.0)
    if others:
        ratios = [a.processor_time / b.processor_time for a, b in zip(ours, others, strict=True)]
        note = f"that of {bench.beside}, in turn"
        yield Figure(f"{NAME}, processor time over", ratios, note=note, most=1.05)


def read_release(recording: Path) -> int:
    """Return when the first hammer was released [ns since the epoch]."""
    found = Scan(recording).read_messages(lambda channel: channel.topic == RELEASE)
    return min(raw.publish_time for raw in found)


def measure_commands(bench: Bench) -> Iterator[Figure]:
    """Time commands on the recording of a campaign."""
    path = str(run_campaign(bench.campaigns / "0").recording)
    with RigProcesses(bench.folder / "log.txt") as processes:
        for most, *words, suffix in (
            (0.08, "--help", ""), (0.3, "info", path, ""), (0.9, "analyze", path, ""),
            (2.2, "report", path, ".html"), (1.4, "view", path, ".rrd"),
        ):  # fmt: skip
            times = []
            for turn in range(bench.extent.repeats // 2):
                written = ["--output", str(bench.folder / f"{turn}{suffix}")] * bool(suffix)
                times.append(processes.time_command(*words, *written))
            yield Figure(f"impact-rig {words[0]}", times, "s", "processor time", most=most)


def measure_headless(bench: Bench) -> Iterator[Figure]:
    """Run a test's rig, and three hits on one sample."""
    times = []
    for turn in range(bench.extent.demos):
        folder = bench.folder / str(turn)
        folder.mkdir()
        started = time.perf_counter()
        with run_virtual_rig(folder) as rig:
            rig.campaign("steel small", impacts=3)
            times.append(time.perf_counter() - started)
    yield Figure("fixture `virtual_rig`, three hits", times, "s", most=2.5)


FEW, MANY = 50, 150  # hits of a sample


def measure_memory(bench: Bench) -> Iterator[Figure]:
    """Weigh the estimator after some hits of a sample, and after a hundred more."""
    log = bench.folder / "campaign.txt"
    with RigProcesses(bench.folder / "log.txt") as processes:
        number = processes.start_rig(bench.folder, QUICK)["estimator"].pid
        processes.start_command("campaign", *ENDLESS, "--wait", "1 min", log=log)
        sizes = []
        for hits in (FEW, MANY):
            word = f"hit {hits}.1 "
            processes.wait_until(partial(_is_in, word, log), "no hits are struck")
            sizes.append(psutil.Process(number).memory_info().rss * 1e-6)
    yield Figure("estimator's memory for a hundred hits", sizes[1] - sizes[0], "MB", most=1.5)


def _is_in(word: str, log: Path) -> bool:
    return word in log.read_text("utf-8")


def measure_clone(bench: Bench) -> Iterator[Figure]:
    """Clone the repository, set it up and run a campaign."""
    root = Path(__file__).resolve().parents[2]
    clone = bench.folder / "clone"
    started = time.perf_counter()
    subprocess.run(["git", "clone", "-q", root, clone], check=True)
    script = clone / "launch_scripts" / "rig.py"
    words = [sys.executable, str(script), "demo", "-o", str(bench.folder / "run")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RigError(f"no campaign in a fresh clone: {done.stderr[-300:]}")
    note = "with the campaign of 120 hits; packages from the network"
    yield Figure("clone to tables", time.perf_counter() - started, "s", note, most=40.0)


CAMPAIGNS = 2  # that are looked at: 240 hits, and 200 are asked for
LONGEST_MEDIAN, LONGEST_TAIL = 10.0, 18.0  # [ms], median and 99th percentile, as asked for
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
    yield Figure("a record there, a verdict back, by bare rclpy", list(time_rclpy()), "ms")


def time_rclpy() -> Iterator[float]:
    """Yield how long a record's points to another node and its answer take [ms]."""
    came, points = threading.Event(), Channel(counts=range(1000), scale=1.0)
    block = partial(ACCELERATION.type, hammer=points, specimen=points)
    with (
        use_own_domain() as domain,
        closing(BackgroundNode("here", domain)) as here,
        closing(BackgroundNode("echo", domain)) as echo,
    ):
        back = echo.node.create_publisher(IMPACT.type, "back", IMPACT.qos)
        there = here.node.create_publisher(ACCELERATION.type, "there", ACCELERATION.qos)
        for node, kind, name, take in (
            (echo.node, ACCELERATION, "there", lambda it: it.last and back.publish(IMPACT.type())),
            (here.node, IMPACT, "back", lambda _: came.set()),
        ):
            node.create_subscription(kind.type, name, take, kind.qos)
        for _ in range(HITS[0]):
            time.sleep(0.05)  # the first ones find each other meanwhile
            came.clear()
            started = time.perf_counter()
            for last in (False, False, False, False, True):
                there.publish(block(last=last))
            if came.wait(1.0):
                yield 1e3 * (time.perf_counter() - started)


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
LONGEST_STOP = 0.45  # [s], as asked for
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
