"""Writing messages that are serialised already, beside `mcap.writer`."""

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
"""In one file [-], our choice: 30 MB, a tenth of a second and more."""
PERIOD = 10_000_000
"""Between two messages [ns]."""
SMALLEST_SPEED = 0.8
"""Over that of the peer [-], as asked for."""
Write = Callable[[Path, Sequence[bytes], str], None]
DEFINITION = MessageDefinition("std_msgs/msg/UInt8MultiArray", "uint8[] data\n", "")


def measure(bench: Bench) -> tuple[Figure, ...]:
    """Time both writers into files of their own, in each compression."""
    generator = np.random.default_rng(bench.extent.seed)
    # No two alike: compression must find no repetition that a digitizer would not have.
    data = [
        generator.integers(-2048, 2048, MESSAGE_SIZE // 4, dtype=np.int32).tobytes()
        for _ in range(MESSAGES)
    ]
    megabytes = sum(map(len, data)) / 1e6
    figures = []
    for number, compression in enumerate(COMPRESSIONS):
        bench.report(number, len(COMPRESSIONS))
        ours, peers = compare_times(
            _with_new_file(bench.folder / "ours.mcap", write_as_recorder, data, compression),
            _with_new_file(bench.folder / "bare.mcap", write_bare, data, compression),
            bench.extent.repeats,
        )
        figures.append(
            Figure(
                f"{compression}, speed over that of mcap.writer",
                divide(peers, ours),
                goal=at_least(SMALLEST_SPEED),
                note=f"{megabytes / min(ours):.0f} MB/s at best, of one core",
            )
        )
    return tuple(figures)


def _with_new_file(
    path: Path,
    write: Callable[[Path, Sequence[bytes], str], None],
    data: Sequence[bytes],
    compression: str,
) -> Callable[[], None]:
    def run() -> None:
        write(path, data, compression)
        path.unlink()

    return run


def write_as_recorder(path: Path, data: Sequence[bytes], compression: str) -> None:
    """Write as the recorder does."""
    writer = RecordingWriter(path, compression=compression, keep_free=0)
    channel = writer.add_channel("/acceleration", DEFINITION, (OfferedQos(),))
    for number, message in enumerate(data):
        writer.add_message(channel, message, number * PERIOD, number * PERIOD)
    writer.close()


def write_bare(path: Path, data: Sequence[bytes], compression: str) -> None:
    """Write with the library alone."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=DEFAULT_CHUNK_SIZE, compression=COMPRESSIONS[compression])
        writer.start("ros2", "bench")
        schema = writer.register_schema(DEFINITION.type_name, "ros2msg", DEFINITION.text.encode())
        channel = writer.register_channel("/acceleration", "cdr", schema)
        for number, message in enumerate(data):
            writer.add_message(channel, number * PERIOD, message, number * PERIOD, number)
        writer.finish()


PART = Part("write", "Writing serialised messages, beside mcap.writer", measure, 5.0)
