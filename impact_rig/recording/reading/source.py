"""Finds the recording that a person names, and opens it: one file, or a folder of them."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Protocol

from impact_rig.core.errors import FileError
from impact_rig.recording.interfaces.channel import Channel
from impact_rig.recording.reading.bag_files import SUFFIX, is_bag_folder
from impact_rig.recording.reading.bag_folder import BagFolder
from impact_rig.recording.reading.mcap_file import McapFile
from impact_rig.recording.reading.mcap_records import MAGIC
from impact_rig.recording.reading.raw_records import Attachment, MetadataRecord, RawMessage

__all__ = [
    "SUFFIX",
    "RecordingSource",
    "find_recording",
    "is_recording",
    "open_source",
]

RUN_NAME = "session"
"""What a run's folder calls its recording: a file of this name and `.mcap`, or a folder."""


class RecordingSource(Protocol):
    """A recording as it stands on the disk, whether it is one file or several.

    Every method raises FileError, with one sentence, if a file is damaged other than cut off at
    its end, or cannot be read.
    """

    @property
    def path(self) -> Path:
        """The file, or the folder."""

    @property
    def files(self) -> tuple[Path, ...]:
        """Its files, in their order."""

    @property
    def size(self) -> int:
        """Of all files together [byte]."""

    @property
    def is_complete(self) -> bool:
        """Whether the recording was closed and nothing of it is missing."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the reader should know, in words; empty: nothing."""

    def read_channels(self) -> tuple[Channel, ...]:
        """Return all topics; a topic has one number in all files."""

    def read_messages(
        self,
        wanted: Callable[[Channel], bool] = ...,
        *,
        start_time: int | None = None,
        end_time: int | None = None,
        report: Callable[[int], None] | None = None,
    ) -> Iterator[RawMessage]:
        """Yield the wanted channels' messages in file order; see `McapFile.read_messages`."""

    def read_metadata(self) -> tuple[MetadataRecord, ...]:
        """Return what was noted beside the messages."""

    def read_attachments(self) -> tuple[Attachment, ...]:
        """Return the files kept inside the recording."""


def find_recording(path: Path) -> Path:
    """Return the recording that a path means.

    Parameters
    ----------
    path : Path
        An `.mcap` file, a folder as rosbag2 writes it, a run's folder with `session.mcap` or a
        folder `session` in it, or any folder with one `.mcap` file.

    Returns
    -------
    Path
        The file, or the folder as rosbag2 writes it.

    Raises
    ------
    FileError
        If there is nothing of that name, or it is a folder without a recording, or with several.
    """
    try:
        if not path.is_dir():
            if not path.exists():
                raise FileError(f"there is no file {path}")
            return path
        for candidate in (path / f"{RUN_NAME}{SUFFIX}", path, path / RUN_NAME):
            if candidate.is_file() or is_bag_folder(candidate):
                return candidate
        files = sorted(path.glob(f"*{SUFFIX}"))
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror}") from None
    if len(files) == 1:
        return files[0]
    if files:
        raise FileError(f"{path} is a folder with {len(files)} recordings: name one of them")
    raise FileError(f"{path} is a folder without a recording: there is no {SUFFIX} file in it")


def is_recording(path: Path) -> bool:
    """Return whether a path means a recording, and not a file of traces.

    A name that ends with `.mcap` does, whatever is in the file: opening it tells what is wrong.
    """
    if path.suffix == SUFFIX:
        return True
    try:
        if path.is_dir():
            find_recording(path)
            return True
        with path.open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except (FileError, OSError):
        return False


def open_source(path: Path) -> RecordingSource:
    """Open a recording.

    Parameters
    ----------
    path : Path
        As `find_recording` takes it.

    Raises
    ------
    FileError
        If there is none, or it is none of ROS 2 in MCAP.
    """
    found = find_recording(path)
    return BagFolder(found) if found.is_dir() else McapFile(found)
