"""The running stream to estimator and recorder: what is lost of it, and what it costs."""

import subprocess
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import psutil

from bench.measure import Bench, Figure, at_most, part
from bench.rig_processes import RigProcesses, Said, use_own_domain
from impact_rig.core.errors import RigError
from impact_rig.recordings.messages import head_from_msg
from impact_rig.recordings.records import RawMessage
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.schemas import SchemaDecoder

STREAM = "/acceleration/stream"
DIAGNOSTICS = "/diagnostics"
ESTIMATOR = "/estimator"
SEEN = "stream blocks"
MISSED = "stream points missing"
"""Of the estimator's diagnostics."""


@dataclass(frozen=True)
class Flow:
    """What came of a stream from one moment to another."""

    blocks: int  # in the recording
    lost: int  # that the recording lacks between them
    points: int  # per channel, from the first block to the last, lost ones included
    seen: int  # blocks that the estimator has counted
    missed: int  # points that the estimator lacked


def read_flow(recording: Path, begin: int, end: int) -> Flow:
    """Return what a recording has of the stream that was sent between two moments.

    Parameters
    ----------
    recording : Path
        With stream and diagnostics.
    begin, end : int
        Nanoseconds since the epoch.
    """
    decoder = SchemaDecoder()
    starts: list[int] = []
    size = 0
    counts = [(0, 0)]
    messages = Scan(recording).read_messages(
        lambda channel: channel.topic in (STREAM, DIAGNOSTICS)
    )
    for raw in messages:
        if raw.channel.topic == STREAM:
            if begin <= raw.publish_time <= end:
                head = head_from_msg(decoder.decode(raw.channel, raw.data))
                starts.append(head.first_sample)
                size = head.points
            continue
        for values in _read_diagnostics(decoder, raw):
            # From the last word before the beginning to the last word of all.
            if raw.publish_time < begin:
                counts.clear()
            counts.append((int(values.get(SEEN, 0)), int(values.get(MISSED, 0))))
    wanted = (starts[-1] - starts[0]) // size + 1 if starts else 0
    (seen_before, missed_before), (seen, missed) = counts[0], counts[-1]
    return Flow(
        blocks=len(starts),
        lost=wanted - len(set(starts)),
        points=wanted * size,
        seen=seen - seen_before,
        missed=missed - missed_before,
    )


def _read_diagnostics(decoder: SchemaDecoder, raw: RawMessage) -> list[dict[str, str]]:
    """Return what the estimator says of itself, if it does."""
    message = decoder.decode(raw.channel, raw.data)
    return [
        {pair.key: pair.value for pair in status.values}
        for status in message.status
        if status.name == ESTIMATOR
    ]


COMPRESSION = "lz4"
PERIOD = 0.01
"""Between two blocks [s], as asked for."""
DEPTH = 500  # blocks that may wait anywhere on their way: 5 s
FLOWING = {"/estimator": "stream blocks", "/recorder": "stream blocks"}
"""What each of these nodes counts in its diagnostics once the stream reaches it."""
WARM_UP = 2.0  # [s]: nodes that have just started import what they use first
SETUP_SOURCE = "campaign"
"""The node that tells the estimator of the rig; it does nothing else here."""


@dataclass(frozen=True)
class StreamRun:
    """What was streamed."""

    recording: Path
    begin: int  # of the measurement [ns since the epoch]
    end: int
    shares: Mapping[str, float]  # processor time of each node over that time [cores]


def run_stream(folder: Path, sampling_rate: float, seconds: float) -> StreamRun:
    """Let three processes stream, search and record for a while.

    Parameters
    ----------
    folder : Path
        Of the recording.
    sampling_rate : float
        Of each of two channels [Hz].
    seconds : float
        That are measured [s].

    Raises
    ------
    RigError
        If a process ends by itself, or nothing is recorded.
    """
    recording = folder / "stream.mcap"
    with (
        use_own_domain() as environment,
        RigProcesses(environment, folder / "log.txt") as processes,
    ):
        told = processes.start_outside("diagnostics")
        processes.start_node(SETUP_SOURCE)
        nodes = {
            "recorder": processes.start_node(
                "recorder",
                output=str(recording),
                compression=COMPRESSION,
                record_stream=True,
                stream_depth=DEPTH,
            ),
            "estimator": processes.start_node("estimator", stream_depth=DEPTH),
            "accelerometer": processes.start_node(
                "accelerometer",
                mode="continuous",
                source=f'sampling_rate = "{sampling_rate} Hz"',
                stream_block_size=round(PERIOD * sampling_rate),
                stream_depth=DEPTH,
            ),
        }
        _wait_for_flow(told)
        processes.kill(["outside diagnostics"])
        time.sleep(WARM_UP)
        before, begin = _read_times(nodes, processes), time.time_ns()
        time.sleep(seconds)
        after, end = _read_times(nodes, processes), time.time_ns()
        # The source first: what it has sent is still written.
        for name in ("accelerometer", "recorder"):
            if processes.stop(name):
                raise RigError(f"the {name} node did not end well: {processes.read_log()}")
    shares = {name: (after[name] - before[name]) * 1e9 / (end - begin) for name in nodes}
    return StreamRun(recording, begin, end, shares)


def _wait_for_flow(told: Said) -> None:
    """Wait until every node that listens to the stream gets it."""
    missing = dict(FLOWING)
    while missing:
        status = told.wait_for(f"the stream does not reach {' and '.join(missing)}")
        if int(status["values"].get(missing.get(status["node"]), 0)) > 0:
            del missing[status["node"]]


def _read_times(
    nodes: Mapping[str, subprocess.Popen[str]], processes: RigProcesses
) -> dict[str, float]:
    """Return the processor time of each node so far [s]."""
    try:
        times = {name: psutil.Process(node.pid).cpu_times() for name, node in nodes.items()}
    except psutil.Error:
        raise RigError(f"the stream broke off: {processes.read_log()}") from None
    return {name: item.user + item.system for name, item in times.items()}


SAMPLING_RATE = 2.5e6
"""Of each channel [Hz]: the paper's."""
FAST = 8
"""Times `SAMPLING_RATE` that must be held [-], as asked for."""
SLOW_PART = 0.25  # of the time at the fastest rate
LARGEST_SHARE = 0.6
"""Of one core, for all three processes at the paper's rate [-], as asked for."""
NANO = 1e-9


@part("stream", "The running stream through three processes, two channels", 39.0)
def measure_stream(bench: Bench) -> Iterator[Figure]:
    """Stream at the paper's rate and at a multiple of it, and count in the recordings."""
    seconds = bench.extent.seconds
    yield from _measure_rate(bench, 1, SLOW_PART * seconds)
    yield from _measure_rate(bench, FAST, seconds)


def _measure_rate(bench: Bench, multiple: int, seconds: float) -> Iterator[Figure]:
    """Stream at a multiple of the paper's rate."""
    run = run_stream(bench.folder, multiple * SAMPLING_RATE, seconds)
    flow = read_flow(run.recording, run.begin, run.end)
    size = run.recording.stat().st_size
    run.recording.unlink()
    taken = NANO * (run.end - run.begin)
    name = f"{multiple} x"
    note = (
        f"of {flow.blocks + flow.lost} in {taken:.1f} s, {flow.points / 1e6:.0f} million points"
        f" of two channels, {size / 1e9:.1f} GB on the disk"
    )
    yield Figure(f"{name}, blocks lost in the recording", flow.lost, "", at_most(0), note)
    note = f"it has seen {flow.seen} blocks"
    yield Figure(f"{name}, points missed by the estimator", flow.missed, "", at_most(0), note)
    rate = flow.points / taken / SAMPLING_RATE
    yield Figure(f"{name}, rate over 2.5 MS/s per channel", rate)
    shares = ", ".join(f"{node} {share:.2f}" for node, share in run.shares.items())
    goal = at_most(LARGEST_SHARE) if multiple == 1 else None
    whole, note = sum(run.shares.values()), f"{COMPRESSION}; {shares}"
    yield Figure(f"{name}, processor time of all three", whole, "cores", goal, note)
