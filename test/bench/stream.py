"""The running stream to estimator and recorder: what is lost of it, and what it costs."""

import subprocess
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import psutil

from bench.measure import Bench, Figure
from bench.rig_processes import RigProcesses, use_own_domain
from impact_rig.core.errors import RigError
from impact_rig.recordings.messages import count_points
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.schemas import SchemaDecoder

STREAM = "/acceleration/stream"
DIAGNOSTICS = "/diagnostics"
ESTIMATOR = "/estimator"
SEEN, MISSED = "stream blocks", "stream points missing"  # of the estimator's diagnostics
COMPRESSION = "lz4"
PERIOD = 0.01  # [s], between two blocks, as asked for
FLOWING = 1_000_000  # [byte], of a recording that the stream has reached
WARM_UP = 4.0  # [s]: nodes that have just started import what they use first
SAMPLING_RATE = 2.5e6  # [Hz], of each channel: the paper's
FAST = 8  # times `SAMPLING_RATE` that must be held, as asked for
SLOW_PART = 0.25  # of the time at the fastest rate
LARGEST_SHARE = 0.6  # of one core, for all three processes at the paper's rate, as asked for
SETUP_SOURCE = "campaign"
"""The node that tells the estimator of the rig; it does nothing else here."""


def measure_stream(bench: Bench) -> Iterator[Figure]:
    """Stream at the paper's rate and at a multiple of it, and count in the recordings."""
    seconds = bench.extent.seconds
    yield from _measure_rate(bench, 1, SLOW_PART * seconds)
    yield from _measure_rate(bench, FAST, seconds)


def _measure_rate(bench: Bench, multiple: int, seconds: float) -> Iterator[Figure]:
    """Stream at a multiple of the paper's rate."""
    recording = bench.folder / "stream.mcap"
    run = run_stream(recording, multiple * SAMPLING_RATE, seconds)
    flow = read_flow(recording, run.begin, run.end)
    size = recording.stat().st_size
    recording.unlink()
    taken = 1e-9 * (run.end - run.begin)
    name = f"{multiple} x"
    note = (
        f"of {flow.blocks} in {taken:.1f} s, {flow.points / 1e6:.0f} million points"
        f" of two channels, {size / 1e9:.1f} GB on the disk"
    )
    yield Figure(f"{name}, blocks lost in the recording", flow.lost, note=note, most=0)
    note = f"it has seen {flow.seen} blocks"
    yield Figure(f"{name}, points missed by the estimator", flow.missed, note=note, most=0)
    rate = flow.points / taken / SAMPLING_RATE
    yield Figure(f"{name}, rate over 2.5 MS/s per channel", rate)
    shares = ", ".join(f"{node} {share:.2f}" for node, share in run.shares.items())
    most = LARGEST_SHARE if multiple == 1 else None
    whole, note = sum(run.shares.values()), f"{COMPRESSION}; {shares}"
    yield Figure(f"{name}, processor time of all three", whole, "cores", note, most=most)


@dataclass(frozen=True)
class StreamRun:
    """What was streamed."""

    begin: int  # of the measurement [ns since the epoch]
    end: int
    shares: Mapping[str, float]  # processor time of each node over that time [cores]


def run_stream(recording: Path, sampling_rate: float, seconds: float) -> StreamRun:
    """Let three processes stream, search and record for a while.

    Raises
    ------
    RigError
        If a process ends by itself, or nothing is recorded.
    """
    with (
        use_own_domain() as environment,
        RigProcesses(environment, recording.with_name("log.txt")) as processes,
    ):
        processes.start_node(SETUP_SOURCE)
        nodes = {
            "recorder": processes.start_node(
                "recorder",
                output=str(recording),
                compression=COMPRESSION,
                record_stream=True,
            ),
            "estimator": processes.start_node("estimator"),
            "accelerometer": processes.start_node(
                "accelerometer",
                mode="continuous",
                source=f'sampling_rate = "{sampling_rate} Hz"',
                stream_block_size=round(PERIOD * sampling_rate),
            ),
        }
        processes.wait_until(
            lambda: recording.exists() and recording.stat().st_size > FLOWING,
            "the stream does not reach the recorder",
        )
        time.sleep(WARM_UP)
        before, begin = _read_times(nodes, processes), time.time_ns()
        time.sleep(seconds)
        after, end = _read_times(nodes, processes), time.time_ns()
        # The source first: what it has sent is still written.
        for name in ("accelerometer", "recorder"):
            processes.stop(name)
    shares = {name: (after[name] - before[name]) * 1e9 / (end - begin) for name in nodes}
    return StreamRun(begin, end, shares)


def _read_times(
    nodes: Mapping[str, subprocess.Popen[bytes]], processes: RigProcesses
) -> dict[str, float]:
    """Return the processor time of each node so far [s]."""
    try:
        times = {name: psutil.Process(node.pid).cpu_times() for name, node in nodes.items()}
    except psutil.Error:
        raise RigError(f"the stream broke off: {processes.read_log()}") from None
    return {name: item.user + item.system for name, item in times.items()}


@dataclass(frozen=True)
class Flow:
    """What came of a stream from one moment to another."""

    blocks: int  # sent, by the numbers of the first and the last in the recording
    lost: int  # of these, not in the recording
    points: int  # per channel, of all these blocks
    seen: int  # blocks that the estimator has counted
    missed: int  # points that the estimator lacked


def read_flow(recording: Path, begin: int, end: int) -> Flow:
    """Return what a recording has of the stream that was sent between two moments [ns].

    Raises
    ------
    RigError
        If the estimator had not seen the stream by then.
    """
    decoder = SchemaDecoder()
    starts: set[int] = set()
    size = 0
    before, after = (0, 0), (0, 0)  # blocks seen, points missed
    messages = Scan(recording).read_messages(
        lambda channel: channel.topic in (STREAM, DIAGNOSTICS)
    )
    for raw in messages:
        message = decoder.decode(raw.channel, raw.data)
        if raw.channel.topic == DIAGNOSTICS:
            for status in message.status:
                if status.name == ESTIMATOR:
                    values = {pair.key: pair.value for pair in status.values}
                    after = int(values.get(SEEN, 0)), int(values.get(MISSED, 0))
                    before = after if raw.publish_time < begin else before
        elif begin <= raw.publish_time <= end:
            starts.add(message.first_sample)
            size = count_points(message)
    if not (starts and before[0]):
        raise RigError("the stream does not reach recorder and estimator")
    blocks = (max(starts) - min(starts)) // size + 1
    return Flow(
        blocks=blocks,
        lost=blocks - len(starts),
        points=blocks * size,
        seen=after[0] - before[0],
        missed=after[1] - before[1],
    )
