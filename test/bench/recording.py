"""Recordings written and read, beside the library `mcap`, and analysed by two Dask workers."""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap.writer import Writer

from bench.campaigns import COMPRESSIONS, compress_anew
from bench.measure import Bench, Figure, at_least, at_most, compare_times, divide, part
from impact_rig.analysis.batch import BatchTask
from impact_rig.core.errors import RigError
from impact_rig.recordings.qos import OfferedQos
from impact_rig.recordings.reader import read_recording
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
Write = Callable[[Path, Sequence[bytes], str], None]
DEFINITION = MessageDefinition("std_msgs/msg/UInt8MultiArray", "uint8[] data\n", "")


@part("write", "Writing serialised messages, beside mcap.writer", 7.0)
def measure_writing(bench: Bench) -> Iterator[Figure]:
    """Time both writers into files of their own, in each compression."""
    generator = np.random.default_rng(bench.extent.seed)
    # No two alike in a chunk: compression must find no repetition that a digitizer does not have.
    different = [
        generator.integers(-2048, 2048, MESSAGE_SIZE // 4, dtype=np.int32).tobytes()
        for _ in range(DIFFERENT)
    ]
    data = [different[number % DIFFERENT] for number in range(MESSAGES)]
    megabytes = sum(map(len, data)) / 1e6
    for number, compression in enumerate(COMPRESSIONS):
        bench.report(number, len(COMPRESSIONS))
        run, run_peer = (
            _with_new_file(bench.folder / "new.mcap", write, data, compression)
            for write in (write_as_recorder, write_bare)
        )
        ours, peers = compare_times(run, run_peer, bench.extent.repeats)
        name = f"{compression}, speed over that of mcap.writer"
        note = (
            f"{megabytes / min(ours):.0f} MB/s at best, of one core;"
            f" {run() / run_peer():.3f} of the peer's size"
        )
        yield Figure(name, divide(peers, ours), "", at_least(SMALLEST_SPEED), note)


def _with_new_file(
    path: Path, write: Write, data: Sequence[bytes], compression: str
) -> Callable[[], int]:
    def run() -> int:
        """Return the size of the file [byte]."""
        write(path, data, compression)
        size = path.stat().st_size
        path.unlink()
        return size

    return run


def write_as_recorder(path: Path, data: Sequence[bytes], compression: str) -> None:
    """Write as the recorder does."""
    writer = RecordingWriter(path, compression=compression, keep_free=0)
    channel = writer.add_channel("/acceleration", DEFINITION, (OfferedQos(),))
    for number, message in enumerate(data):
        writer.add_message(channel, message, number * PERIOD, number * PERIOD)
    writer.close()


def write_bare(path: Path, data: Sequence[bytes], compression: str) -> None:
    """Write with the library alone, until the file is on the disk.

    The recorder's is, in the end: what that costs must not be charged to one of them.
    """
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=DEFAULT_CHUNK_SIZE, compression=COMPRESSIONS[compression])
        writer.start("ros2", "bench")
        schema = writer.register_schema(DEFINITION.type_name, "ros2msg", DEFINITION.text.encode())
        channel = writer.register_channel("/acceleration", "cdr", schema)
        for number, message in enumerate(data):
            writer.add_message(channel, number * PERIOD, message, number * PERIOD, number)
        writer.finish()
        file.flush()
        os.fdatasync(file.fileno())


LARGEST_RATIO = 2.0
"""Time of reading over that of the peer [-]: half its speed is asked for."""


@part("read", "Reading a recording, beside mcap.reader doing nothing", 3.0)
def measure_reading(bench: Bench) -> Iterator[Figure]:
    """Time all set-ups and blocks of a campaign, as `analyze` gets them, in each compression."""
    original = bench.campaigns.take(1)[0].recording
    for number, compression in enumerate(COMPRESSIONS):
        bench.report(number, len(COMPRESSIONS))
        path = compress_anew(original, bench.folder / f"{compression}.mcap", compression)
        ours, peers = compare_times(
            partial(read_events, path), partial(read_messages, path), bench.extent.repeats
        )
        name = f"{compression}, time over that of mcap.reader"
        note = f"{path.stat().st_size / 1e6:.1f} MB in {1e3 * min(ours):.0f} ms at best"
        yield Figure(name, divide(ours, peers), "", at_most(LARGEST_RATIO), note)


def read_events(path: Path) -> int:
    """Read as `impact-rig analyze` does, with the estimation switched off; return how many."""
    return sum(1 for _ in read_recording(path).events())


def read_messages(path: Path) -> int:
    """Read all messages with the library alone; return how many."""
    with path.open("rb") as file:
        return sum(1 for _ in make_reader(file).iter_messages())


VERDICTS = 15
"""In each recording [-], our choice."""
RECORDINGS = 8
"""In one batch [-]: four for each of two workers."""
WARM_UP = 2
"""Recordings for each worker before that [-], our choice: it imports what it needs."""
REPEATS = 2
"""Batches on each cluster [-], our choice: one takes up to ten seconds."""
SMALLEST_GAIN = 1.7
"""Speed of two workers over that of one [-], as asked for."""
WORKERS = (1, 2)


@part("batch", "Many recordings on two Dask workers, beside one", 11.0)
def measure_batch(bench: Bench) -> Iterator[Figure]:
    """Time the same batch on one and on two workers that have been at work before."""
    from impact_rig.analysis.dask_workers import start_workers

    if len(os.sched_getaffinity(0)) < WORKERS[-1]:
        raise RigError("two workers are measured on two cores, and there is only one")
    whole = bench.campaigns.take(1)[0].recording
    path = compress_anew(whole, bench.folder / "part.mcap", "zstd", VERDICTS)
    times: dict[int, list[float]] = {count: [] for count in WORKERS}
    starts: dict[int, float] = {}
    with ExitStack() as stack:
        clients = {}
        for count in WORKERS:
            started = time.perf_counter()
            clients[count] = stack.enter_context(start_workers(count))
            _analyze(clients[count], path, WARM_UP * count)
            starts[count] = time.perf_counter() - started
        for turn in range(REPEATS):
            bench.report(turn, REPEATS)
            # By turns, so that other work on the machine meets both.
            for count, client in clients.items():
                started = time.perf_counter()
                _analyze(client, path, RECORDINGS)
                times[count].append(time.perf_counter() - started)
    one, two = (times[count] for count in WORKERS)
    gains = (slow / fast for slow, fast in zip(one, two, strict=True))
    note = f"{RECORDINGS} recordings of {VERDICTS} hits, workers warm"
    yield Figure("speed of two workers over one", gains, "", at_least(SMALLEST_GAIN), note)
    yield Figure("one recording on one worker", (item / RECORDINGS for item in one), "s")
    note = "with their first recordings"
    yield Figure("start of two workers", starts[WORKERS[-1]], "s", note=note)


def _analyze(client: Any, path: Path, count: int) -> None:
    from impact_rig.analysis.dask_workers import run_on_workers

    tasks = [BatchTask(path, {}) for _ in range(count)]
    for outcome in run_on_workers(client, tasks, lambda _: None):
        if outcome.recording is None:
            raise RigError(outcome.error)
