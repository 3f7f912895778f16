"""Recordings written and read, beside the library `mcap`."""

import os
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from statistics import median

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from bench.measure import Bench, Figure, compare_times, divide
from bench.rig_processes import run_campaign
from impact_rig.api import VirtualRig
from impact_rig.core.session import Session
from impact_rig.recordings.records import OfferedQos
from impact_rig.recordings.run import Run
from impact_rig.recordings.schemas import MessageDefinition
from impact_rig.recordings.writer import DEFAULT_CHUNK_SIZE, RecordingWriter

MESSAGE_SIZE = 200_000
"""Of 25 000 points of two channels [byte]."""
MESSAGES = 150
"""In one file [-], our choice: 30 MB, some hundredths of a second and more."""
DIFFERENT = 12
"""How many of them differ [-], our choice: those of two chunks. They stay in the processor's
cache, like what a recorder has just been given: 30 MB would be read from memory, which takes more
time than writing them."""
PERIOD = 10_000_000
"""Between two messages [ns]."""
SMALLEST_SPEED = 0.8
"""Over that of the peer [-], as asked for."""
COMPRESSIONS = ("zstd", "lz4", "none")
DEFINITION = MessageDefinition("std_msgs/msg/UInt8MultiArray", "uint8[] data\n", "")


def measure_write(bench: Bench) -> Iterator[Figure]:
    """Time both writers into files of their own, in each compression."""
    generator = np.random.default_rng(bench.extent.seed)
    # No two alike in a chunk: compression must find no repetition that a digitizer does not have.
    different = [
        generator.integers(-2048, 2048, MESSAGE_SIZE // 4, dtype=np.int32).tobytes()
        for _ in range(DIFFERENT)
    ]
    data = [different[number % DIFFERENT] for number in range(MESSAGES)]
    megabytes = sum(map(len, data)) / 1e6
    path = bench.folder / "new.mcap"
    for compression in COMPRESSIONS:
        ours, peers = compare_times(
            partial(write_as_recorder, path, data, compression),
            partial(write_bare, path, data, compression),
            bench.extent.repeats,
        )
        name = f"recorder, {compression}, speed over mcap.writer"
        note = f"{megabytes / min(ours):.0f} MB/s at best, of one core"
        yield Figure(name, divide(peers, ours), note=note, least=SMALLEST_SPEED)


def write_as_recorder(path: Path, data: Sequence[bytes], compression: str) -> None:
    """Write as the recorder does."""
    path.unlink(missing_ok=True)
    writer = RecordingWriter(path, compression=compression)
    channel = writer.add_channel("/acceleration", DEFINITION, (OfferedQos(),))
    for number, message in enumerate(data):
        writer.add_message(channel, message, number * PERIOD, number * PERIOD)
    writer.close()


def write_bare(path: Path, data: Sequence[bytes], compression: str) -> None:
    """Write with the library alone, until the file is on the disk.

    The recorder's is, in the end: what that costs must not be charged to one of them.
    """
    with path.open("wb") as file:
        kind = CompressionType[compression.upper()]
        writer = Writer(file, chunk_size=DEFAULT_CHUNK_SIZE, compression=kind)
        writer.start("ros2", "bench")
        schema = writer.register_schema(DEFINITION.type_name, "ros2msg", DEFINITION.text.encode())
        channel = writer.register_channel("/acceleration", "cdr", schema)
        for number, message in enumerate(data):
            writer.add_message(channel, number * PERIOD, message, number * PERIOD, number)
        writer.finish()
        file.flush()
        os.fdatasync(file.fileno())


LARGEST_RATIO = 1.5
"""Time of reading over that of the peer [-], as asked for."""


def measure_read(bench: Bench) -> Iterator[Figure]:
    """Time all set-ups and blocks of a campaign, as `analyze` gets them."""
    path = run_campaign(bench.campaigns / "0").recording
    ours, peers = compare_times(
        partial(read_events, path), partial(read_messages, path), bench.extent.repeats
    )
    note = f"{path.stat().st_size / 1e6:.1f} MB in {1e3 * min(ours):.0f} ms at best"
    yield Figure(
        "reading, time over mcap.reader", divide(ours, peers), note=note, most=LARGEST_RATIO
    )
    yield Figure("size of 120 hits over b061bfb's", path.stat().st_size / OLD_SIZE, most=1.1)


OLD_SIZE = 2.9e6
"""Of the recording of a demo by b061bfb [byte]."""


def measure_growth(bench: Bench) -> Iterator[Figure]:
    """Time hits on one sample as the estimator takes them: early ones, and late ones."""
    rig, times = VirtualRig(seed=bench.extent.seed), []
    session = Session(rig.setup)
    for _ in range(2000):
        block = rig.strike("steel small").block
        started = time.process_time()
        for hit in session.feed(block):
            session.estimate_numbers(hit.label.sample)
        times.append(time.process_time() - started)
    growth = median(times[-100:]) / median(times[25:75])
    yield Figure("hit at 2000 on one sample over one at 50, time", growth, most=1.3)


def read_events(path: Path) -> int:
    """Read as `impact-rig analyze` does, with the estimation switched off; return how many."""
    return sum(1 for _ in Run(path).events())


def read_messages(path: Path) -> int:
    """Read all messages with the library alone; return how many."""
    with path.open("rb") as file:
        return sum(1 for _ in make_reader(file).iter_messages())
