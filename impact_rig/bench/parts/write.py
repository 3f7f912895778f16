"""Writing messages that are serialised already, beside `mcap.writer`."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from mcap.writer import Writer

from impact_rig.bench.figures import Figure, at_least
from impact_rig.bench.part import Bench, Part
from impact_rig.bench.recordings import COMPRESSIONS
from impact_rig.bench.timing import compare_times, divide
from impact_rig.recording.interfaces.message_definitions import MessageDefinition
from impact_rig.recording.interfaces.qos_profiles import OfferedQos
from impact_rig.recording.writing.mcap_writer import DEFAULT_CHUNK_SIZE
from impact_rig.recording.writing.recording_writer import RecordingWriter

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


def measure(bench: Bench) -> tuple[Figure, ...]:
    """Time both writers into files of their own, in each compression."""
    generator = np.random.default_rng(bench.extent.seed)
    # No two alike in a chunk: compression must find no repetition that a digitizer does not have.
    different = [
        generator.integers(-2048, 2048, MESSAGE_SIZE // 4, dtype=np.int32).tobytes()
        for _ in range(DIFFERENT)
    ]
    data = [different[number % DIFFERENT] for number in range(MESSAGES)]
    megabytes = sum(map(len, data)) / 1e6
    figures = []
    for number, compression in enumerate(COMPRESSIONS):
        bench.report(number, len(COMPRESSIONS))
        run, run_peer = (
            _with_new_file(bench.folder / "new.mcap", write, data, compression)
            for write in (write_as_recorder, write_bare)
        )
        ours, peers = compare_times(run, run_peer, bench.extent.repeats)
        figures.append(
            Figure(
                f"{compression}, speed over that of mcap.writer",
                divide(peers, ours),
                goal=at_least(SMALLEST_SPEED),
                note=f"{megabytes / min(ours):.0f} MB/s at best, of one core;"
                f" {run() / run_peer():.3f} of the peer's size",
            )
        )
    return tuple(figures)


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


PART = Part("write", "Writing serialised messages, beside mcap.writer", measure, 7.0)
