"""Writing messages that are serialised already, beside `mcap.writer`."""

import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer

from impact_rig.bench.figures import Figure
from impact_rig.bench.part import Bench, Part
from impact_rig.bench.timing import compare_times, divide
from impact_rig.recording.interfaces.message_definitions import MessageDefinition
from impact_rig.recording.interfaces.qos_profiles import OfferedQos
from impact_rig.recording.writing.mcap_writer import DEFAULT_CHUNK_SIZE
from impact_rig.recording.writing.recording_writer import RecordingWriter

MESSAGE_SIZE = 200_000
"""Of 25 000 points of two channels [byte]."""
MESSAGES = 300
PERIOD = 10_000_000
"""Between two messages [ns]."""
DEFINITION = MessageDefinition("std_msgs/msg/UInt8MultiArray", "uint8[] data\n", "")


def measure(bench: Bench) -> tuple[Figure, ...]:
    """Time both writers into files of their own, with lz4."""
    noise = np.random.default_rng(bench.extent.seed).integers(-2048, 2048, MESSAGE_SIZE // 4)
    data = noise.astype(np.int32).tobytes()
    numbers = itertools.count()

    def with_new_file(write: Callable[[Path, bytes], None]) -> Callable[[], None]:
        def run() -> None:
            path = bench.folder / f"{next(numbers)}.mcap"
            write(path, data)
            bench.report(next(numbers) // 2, 2 * (bench.extent.repeats + 1))
            path.unlink()

        return run

    ours, peers = compare_times(
        with_new_file(write_as_recorder), with_new_file(write_bare), bench.extent.repeats
    )
    megabytes = MESSAGES * len(data) / 1e6
    return (
        Figure(
            "lz4, speed over that of mcap.writer",
            divide(peers, ours),
            note=f"{megabytes / min(ours):.0f} MB/s at best, of one core",
        ),
    )


def write_as_recorder(path: Path, data: bytes) -> None:
    """Write as the recorder does."""
    writer = RecordingWriter(path, compression="lz4", keep_free=0)
    channel = writer.add_channel("/acceleration", DEFINITION, (OfferedQos(),))
    for number in range(MESSAGES):
        writer.add_message(channel, data, number * PERIOD, number * PERIOD)
    writer.close()


def write_bare(path: Path, data: bytes) -> None:
    """Write with the library alone."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=DEFAULT_CHUNK_SIZE, compression=CompressionType.LZ4)
        writer.start("ros2", "bench")
        schema = writer.register_schema(DEFINITION.type_name, "ros2msg", DEFINITION.text.encode())
        channel = writer.register_channel("/acceleration", "cdr", schema)
        for number in range(MESSAGES):
            writer.add_message(channel, number * PERIOD, data, number * PERIOD, number)
        writer.finish()


PART = Part("write", "Writing serialised messages, beside mcap.writer", measure)
