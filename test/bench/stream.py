"""The running stream to estimator and recorder: what is lost of it, and what it costs."""

import subprocess
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

import psutil

from bench.measure import Bench, Figure
from bench.rig_processes import RigProcesses
from impact_rig.core.given.errors import RigError
from impact_rig.recordings.messages import count_points
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.schemas import decode_message

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
LARGEST_SHARES = {1: 0.2, FAST: 1.0}  # [cores], of all three processes, as asked for
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
    begin, end, shares = run_stream(recording, multiple * SAMPLING_RATE, seconds)
    starts, size, seen, missed = read_flow(recording, begin, end)
    recording.unlink()
    blocks = (max(starts) - min(starts)) // size + 1
    rate = 1e9 * blocks * size / (end - begin) / SAMPLING_RATE
    name, note = f"{multiple} x", f"of {blocks}, at {rate:.3f} x 2.5 MS/s of two channels"
    yield Figure(f"{name}, blocks lost in the recording", blocks - len(starts), note=note, most=0)
    note = f"it has seen {seen} blocks"
    yield Figure(f"{name}, points missed by the estimator", missed, note=note, most=0)
    note = ", ".join(f"{node} {share:.2f}" for node, share in shares.items())
    whole, most = sum(shares.values()), LARGEST_SHARES[multiple]
    yield Figure(f"{name}, processor time of all three", whole, "cores", note, most=most)


def run_stream(
    recording: Path, sampling_rate: float, seconds: float
) -> tuple[int, int, dict[str, float]]:
    """Let three processes stream, search and record for a while.

    Returns
    -------
    tuple of int, int and dict
        Begin and end of the measurement [ns since the epoch], and each node's processor time over
        that [cores].

    Raises
    ------
    RigError
        If a process ends by itself, or nothing is recorded.
    """
    with RigProcesses(recording.with_name("log.txt")) as processes:
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
    return begin, end, shares


def _read_times(
    nodes: Mapping[str, subprocess.Popen[bytes]], processes: RigProcesses
) -> dict[str, float]:
    """Return the processor time of each node so far [s]."""
    try:
        times = {name: psutil.Process(node.pid).cpu_times() for name, node in nodes.items()}
    except psutil.Error:
        raise RigError(f"the stream broke off: {processes.read_log()}") from None
    return {name: item.user + item.system for name, item in times.items()}


def read_flow(recording: Path, begin: int, end: int) -> tuple[set[int], int, int, int]:
    """Return what a recording has of the stream that was sent between two moments [ns].

    Returns
    -------
    tuple of set and int
        First points of the blocks, the points of each, the blocks that the estimator has counted,
        and the points that it lacked.

    Raises
    ------
    RigError
        If the estimator had not seen the stream by then.
    """
    starts: set[int] = set()
    size = 0
    before, after = (0, 0), (0, 0)  # blocks seen, points missed
    messages = Scan(recording).read_messages(
        lambda channel: channel.topic in (STREAM, DIAGNOSTICS)
    )
    for raw in messages:
        message = decode_message(raw)
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
    return starts, size, after[0] - before[0], after[1] - before[1]
