"""What a small file costs to read is bounded, in messages as in bytes."""

import subprocess
import sys
from pathlib import Path

import pytest
from mcap.writer import CompressionType, IndexType, Writer

from impact_rig.core.given.errors import FileError
from impact_rig.recordings.contents import MOST_NOTES, inspect_run
from impact_rig.recordings.run import Run
from impact_rig.recordings.scan import Scan

TINY = b"\0\1\0\0\1\0\0\0\0"
PROMISED = 500e6
"""Memory that reading any small file takes at most [byte]."""


def write_texts(path: Path, count: int, topic: str, data: bytes = TINY) -> Path:
    """Write the same text again and again, without an index, as another tool may."""
    with path.open("wb") as file:
        writer = Writer(
            file,
            chunk_size=1 << 30,
            compression=CompressionType.ZSTD,
            index_types=IndexType.NONE,
        )
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channel = writer.register_channel(topic, "cdr", schema)
        for _ in range(count):
            writer.add_message(channel, 1, data, 1)
        writer.finish()
    return path


@pytest.mark.parametrize("topic", ["/note", "/chatter"])
def test_messages_without_number_in_a_small_file_are_refused(tmp_path, topic):
    path = write_texts(tmp_path / "many.mcap", 100_000, topic)
    told = "its chunks hold more than a message for every 4 byte of the file"
    with pytest.raises(FileError, match=f"is damaged: {told}"):
        list(Scan(path).read_messages())
    contents = inspect_run(Run(path))
    assert any(told in problem for problem in contents.problems)
    assert contents.messages <= 10_000 + path.stat().st_size / 4
    assert len(contents.notes) <= MOST_NOTES


def test_one_long_message_in_a_small_file_takes_no_more_memory_than_promised(tmp_path):
    text = 100_000_000
    data = b"\0\1\0\0" + text.to_bytes(4, "little") + bytes(text)
    path = write_texts(tmp_path / "long.mcap", 1, "/note", data)
    script = (
        "import sys; from pathlib import Path\n"
        "from impact_rig.recordings.contents import inspect_run\n"
        "from impact_rig.recordings.run import Run\n"
        "inspect_run(Run(Path(sys.argv[1])))\n"
        # The peak in rusage is at least that of the process which started this one.
        "peak = Path('/proc/self/status').read_text().partition('VmHWM:')[2]\n"
        "print(peak.split()[0])\n"
    )
    words = [sys.executable, "-c", script, path]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert float(done.stdout) * 1024 < PROMISED
