"""The parameters of a recorder."""

from impact_rig.configuration.processes import RECORDING_NAME
from impact_rig.nodes import interfaces
from impact_rig.nodes.recording.record_storage import SYNC_CHUNK, SYNC_HIT
from impact_rig.nodes.rig_node import RigNode
from impact_rig.recording.writing.chunk_builder import COMPRESSIONS
from impact_rig.recording.writing.mcap_writer import DEFAULT_CHUNK_SIZE
from impact_rig.recording.writing.recording_writer import DEFAULT_KEEP_FREE, LONGEST_SPLIT

LOW_SPACE = 2 << 30
"""Room below which the disk counts as nearly full [byte], our choice: 100 s of two channels at
2.5 MS/s, uncompressed."""
LARGEST_SIZE = 2**62
"""[byte]"""


def declare_parameters(node: RigNode) -> None:
    """Declare them all."""
    _declare_file(node)
    _declare_content(node)


def _declare_file(node: RigNode) -> None:
    node.declare(
        "output", "",
        "the new recording: an .mcap file, or else a folder as rosbag2 writes it; empty:"
        f" runs/<time>/{RECORDING_NAME} under the working directory",
    )  # fmt: skip
    node.declare("compression", "zstd", f"of chunks: {', '.join(COMPRESSIONS)}")
    node.declare(
        "chunk_size", DEFAULT_CHUNK_SIZE, "size at which a chunk is finished [byte]",
        low=1000, high=2**28,
    )  # fmt: skip
    node.declare(
        "flush_period", 1.0,
        "how long a message may wait to be written to disk [s]; 0: until its chunk is full",
        low=0.0, high=3600.0,
    )  # fmt: skip
    node.declare(
        "sync", SYNC_HIT,
        f"{SYNC_HIT}: a record is stored when it is on the disk, safe from a power cut;"
        f" {SYNC_CHUNK}: when its chunk has been written, at the latest after flush_period,"
        " safe from the end of the recorder alone, and nothing waits for the disk",
    )  # fmt: skip
    node.declare(
        "split_size", 0, "of a file, at which the next one is begun [byte]; 0: never",
        low=0, high=LARGEST_SIZE,
    )  # fmt: skip
    node.declare(
        "split_duration", 0.0, "of a file, at which the next one is begun [s]; 0: never",
        low=0.0, high=LONGEST_SPLIT,
    )  # fmt: skip
    node.declare(
        "low_space_warning", LOW_SPACE, "room on the disk below which to warn [byte]",
        low=0, high=LARGEST_SIZE,
    )  # fmt: skip
    node.declare(
        "keep_free", DEFAULT_KEEP_FREE, "left on the disk for others [byte]",
        low=0, high=LARGEST_SIZE,
    )  # fmt: skip


def _declare_content(node: RigNode) -> None:
    node.declare(
        "required_topics", "acceleration, release, impact",
        "topics, by commas, that must be connected before the recorder calls itself"
        " recording, and a release is possible",
    )  # fmt: skip
    node.declare(
        "record_stream", False,
        "in continuous mode, whether the running stream of the accelerometers is recorded as a"
        " whole, beside the hits that are found in it; 72 GB an hour at 2.5 MS/s, uncompressed",
    )  # fmt: skip
    node.declare(
        "stream_depth", 10 * interfaces.STREAM_DEPTH,
        "how many blocks of the running stream may wait to be written; more are lost",
        low=interfaces.STREAM_DEPTH, high=100_000,
    )  # fmt: skip
    node.declare("notes", "", "in the operator's words; they go into the recording")
    node.declare("attachments", "", "files, by commas, that go into the recording")
