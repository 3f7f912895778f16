"""Continuous recording of two channels: not a block lost, and what it costs."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import psutil

from impact_rig.bench.figures import Figure, at_most
from impact_rig.bench.part import Bench, Part
from impact_rig.bench.rig_processes import RigProcesses, use_own_domain
from impact_rig.bench.stream_plan import BLOCK_POINTS, BLOCK_SIZE, PERIOD
from impact_rig.core.errors import RigError
from impact_rig.recording.interfaces.schema_decoder import SchemaDecoder
from impact_rig.recording.reading.mcap_file import McapFile
from impact_rig.recording.reading.mcap_reader import BLOCK_TYPE

COMPRESSION = "lz4"
LARGEST_SHARE = 0.5
"""Of a core that the recorder may take [-], as asked for."""
PUBLISHER = "impact_rig.bench.stream_process"
RECORDER = "recorder"
SPARE_ROOM = 1.2
"""Disk that is asked for over what is streamed [-], our choice."""


def measure(bench: Bench) -> tuple[Figure, ...]:
    """Stream into the recorder node, and count in its file what arrived."""
    seconds = bench.extent.seconds
    _check_room(bench.folder, seconds)
    path = bench.folder / "stream.mcap"
    with (
        use_own_domain() as environment,
        RigProcesses(environment, bench.folder / "log.txt") as processes,
    ):
        recorder = processes.start_node(
            RECORDER,
            output=str(path),
            compression=COMPRESSION,
            sync="chunk",
            required_topics="acceleration",
        )
        publisher = processes.start_module(PUBLISHER, [str(seconds)], listen=True)
        if _read_line(publisher) != "begin":
            raise RigError(f"nothing could be streamed: {processes.read_log()}")
        try:
            told, share, memory = _watch(bench, recorder, publisher)
        except (psutil.NoSuchProcess, json.JSONDecodeError):
            raise RigError(f"the stream broke off: {processes.read_log()}") from None
        if processes.stop(RECORDER):
            raise RigError(f"the recorder did not end well: {processes.read_log()}")
    found = read_first_samples(path)
    sent = {number * BLOCK_POINTS for number in range(told["blocks"])}
    return (
        Figure(
            "blocks lost",
            (float(len(sent - set(found))),),
            goal=at_most(0),
            note=f"of {len(sent)}, counted in the file, in {told['seconds']:.1f} s",
        ),
        Figure("blocks twice", (float(len(found) - len(set(found))),), goal=at_most(0)),
        Figure(
            "recorder, share of a core", (share,), goal=at_most(LARGEST_SHARE), note=COMPRESSION
        ),
        Figure("recorder, memory", (memory,), "MB"),
        Figure("longest delay of a block", (1e3 * told["longest_delay_s"],), "ms"),
        Figure("size over that of the counts", (path.stat().st_size / len(sent) / BLOCK_SIZE,)),
    )


def _check_room(folder: Path, seconds: float) -> None:
    needed = SPARE_ROOM * BLOCK_SIZE * seconds / PERIOD
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise RigError(
            f"{seconds:g} s of recording may take {needed / 1e9:.1f} GB, and {folder} has"
            f" {free / 1e9:.1f} GB: set TMPDIR to another disk, or give fewer --seconds"
        )


def _watch(
    bench: Bench, recorder: subprocess.Popen[str], publisher: subprocess.Popen[str]
) -> tuple[dict[str, Any], float, float]:
    """Return what the publisher says at its end, and the recorder's share of a core and memory."""
    process = psutil.Process(recorder.pid)
    before = process.cpu_times()
    seconds = round(bench.extent.seconds)
    for second in range(seconds):
        bench.report(second, seconds)
        try:
            publisher.wait(1.0)
        except subprocess.TimeoutExpired:
            continue
        break
    told = json.loads(_read_line(publisher))
    after = process.cpu_times()
    used = after.user + after.system - before.user - before.system
    return told, used / told["seconds"], process.memory_info().rss / 1e6


def _read_line(process: subprocess.Popen[str]) -> str:
    return process.stdout.readline().strip() if process.stdout else ""


def read_first_samples(path: Path) -> list[int]:
    """Return `first_sample` of every block in a recording."""
    decoder = SchemaDecoder()
    messages = McapFile(path).read_messages(lambda channel: channel.type_name == BLOCK_TYPE)
    return [int(decoder.decode(raw.channel, raw.data).first_sample) for raw in messages]


PART = Part("stream", "Continuous recording, two channels of 2.5 MS/s", measure, 40.0)
