"""A disk that is really full: a small one in memory, where this process may mount it."""

import contextlib
import os
import subprocess
from pathlib import Path

import mcap.reader
import pytest

from impact_rig.core.given.errors import FileError
from impact_rig.recordings.new_file import ROOM_FOR_ENDING, DiskFullError
from impact_rig.recordings.records import HEALTH_RECORD
from impact_rig.recordings.schemas import MessageDefinition
from impact_rig.recordings.writer import RecordingWriter

BLOCK = bytes(20_000)
TEXT = MessageDefinition("std_msgs/msg/String", "string data\n")
DISK_SIZE = ROOM_FOR_ENDING + (3 << 20)


@pytest.fixture
def disk(tmp_path):
    """Return the folder of a disk of 19 MB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={DISK_SIZE}", "tmpfs", str(folder)]
    try:
        done = subprocess.run(mount, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        pytest.skip("there is no mount here")
    if done.returncode:
        pytest.skip(f"this process may not mount a disk: {done.stderr.strip()}")
    yield folder
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


def begin(output: Path) -> tuple[RecordingWriter, int]:
    writer = RecordingWriter(output, compression="none", chunk_size=100_000)
    return writer, writer.add_channel("/acceleration", TEXT, ())


def add_until_refused(writer: RecordingWriter, channel: int) -> FileError:
    """Add blocks, at most twice what the disk holds."""
    for number in range(2 * DISK_SIZE // len(BLOCK)):
        try:
            writer.add_message(channel, BLOCK, number, number)
        except FileError as error:
            return error
    raise AssertionError("the disk never filled up")


def take_all_space(folder: Path) -> None:
    """Fill the disk to the last byte, as another program may."""
    with (folder / "other").open("wb", buffering=0) as file:
        for size in (1 << 16, 1):
            with contextlib.suppress(OSError):
                while True:
                    file.write(bytes(size))
    state = os.statvfs(folder)
    assert state.f_bavail == 0


def read_times(path: Path) -> list[int]:
    with path.open("rb") as file:
        reader = mcap.reader.make_reader(file, validate_crcs=True)
        return [message.log_time for _, _, message in reader.iter_messages()]


def test_what_does_not_fit_is_refused_in_time_for_a_good_end(disk):
    writer, channel = begin(disk / "session.mcap")
    error = add_until_refused(writer, channel)
    assert isinstance(error, DiskFullError)
    assert "cannot be written: No space left on device; it keeps what was written" in str(error)

    writer.add_metadata(HEALTH_RECORD, {"end": "disk full"})
    writer.close()

    assert read_times(writer.path) == list(range(writer.messages))
    assert writer.messages > 2 * (1 << 20) // len(BLOCK)
    with writer.path.open("rb") as file:
        names = [item.name for item in mcap.reader.make_reader(file).iter_metadata()]
    assert names == [HEALTH_RECORD]


def test_a_disk_that_is_full_at_the_beginning_is_said_so(disk):
    take_all_space(disk)
    with pytest.raises(DiskFullError, match=r"cannot be begun: its disk should have .* 17 MB"):
        RecordingWriter(disk / "session.mcap")
    assert [path.name for path in disk.iterdir()] == ["other"]
