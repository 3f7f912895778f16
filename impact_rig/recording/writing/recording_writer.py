"""Writes a recording: one MCAP file, or a folder as rosbag2 writes it, split between hits."""

import contextlib
import functools
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from impact_rig.core.errors import FileError, ParameterError
from impact_rig.recording.interfaces.message_definitions import MessageDefinition
from impact_rig.recording.interfaces.qos_profiles import OfferedQos
from impact_rig.recording.reading.bag_files import SUFFIX
from impact_rig.recording.writing.bag_metadata import write_bag_metadata
from impact_rig.recording.writing.mcap_writer import DEFAULT_CHUNK_SIZE, McapWriter
from impact_rig.recording.writing.recording_folder import make_folders, refuse_existing_recording
from impact_rig.recording.writing.split_contents import SplitContents, summarize_file

DEFAULT_KEEP_FREE = 64 << 20
"""What is left free on the disk for others [byte], our choice: a computer without any space on
its disk is hard to help."""
LONGEST_SPLIT = 1e9
"""Longest time after which a recording may be split [s], our choice: thirty years."""


class RecordingWriter:
    """A recording in the making.

    Each file of a folder can be read alone: it repeats the topics, the metadata, the attachments
    and the last message of each topic that tells a state, with its number in the topic and its
    time of sending as they were, and the time of the split as its time of reception.

    Parameters
    ----------
    output : Path
        Ending in .mcap: the one file. Else: the folder; its files are <output>/<name>_0.mcap, _1
        and so on. Folders are made.
    compression : str
        One of `chunk_builder.COMPRESSIONS`.
    chunk_size : int
        Uncompressed size at which a chunk is finished [byte].
    library : str
        What wrote the files, kept in them.
    split_size : int
        Size at which the next file is begun, as soon as a hit is complete [byte]; 0: never.
    split_duration : float
        Likewise, the time from its first message to its last [s]; 0: never.
    keep_free : int
        What is left free on the disk for others [byte].
    before_split : callable, optional
        Called when a file is about to be finished for the next one; it may add metadata.

    Attributes
    ----------
    path : Path
        `output` as given.
    messages : int
        How many were added; those repeated at the beginning of a file do not count.

    Raises
    ------
    ParameterError
        If the compression is unknown, a size or duration impossible, or a bare file is to be
        split.
    FileError
        If there is such a recording already, or the first file cannot be created.
    """

    def __init__(
        self,
        output: Path,
        *,
        compression: str = "zstd",
        chunk_size: int = DEFAULT_CHUNK_SIZE,
        library: str = "impact_rig",
        split_size: int = 0,
        split_duration: float = 0.0,
        keep_free: int = DEFAULT_KEEP_FREE,
        before_split: Callable[[], None] | None = None,
    ) -> None:
        self.path = output
        self.messages = 0
        self._folder = None if output.suffix == SUFFIX else output
        _check_limits(output, split_size, split_duration)
        self._is_split = bool(split_size or split_duration)
        self._split_size = split_size
        self._split_duration = int(split_duration * 1e9)
        self._before_split = before_split
        self._open = functools.partial(
            McapWriter,
            compression=compression,
            chunk_size=chunk_size,
            library=library,
            keep_free=keep_free,
        )
        self._contents = SplitContents()
        self._finished: list[McapWriter] = []
        self._repeated = 0
        self._has_synced = False
        self._described_topics = 0
        made = make_folders(self._folder or output.parent)
        try:
            self._begin()
        except (FileError, ParameterError):
            for folder in made:
                with contextlib.suppress(OSError):
                    folder.rmdir()
            raise

    @property
    def files(self) -> tuple[Path, ...]:
        """Files so far, in the order of recording; the last is being written."""
        return tuple(file.path for file in (*self._finished, self._file))

    @property
    def size(self) -> int:
        """Bytes written so far to all files, the unfinished chunk not included."""
        return sum(file.size for file in (*self._finished, self._file))

    @property
    def closed(self) -> bool:
        """Whether the recording is finished."""
        return self._file.closed

    @property
    def free_space(self) -> int:
        """Bytes that may still be added before the disk counts as full; 0 when closed."""
        return self._file.free_space

    def count_messages(self, topic: str) -> int:
        """Return how many messages of a topic were added; repeated ones do not count."""
        return sum(item.count for item in self._contents.topics.values() if item.name == topic)

    def add_channel(
        self, topic: str, definition: MessageDefinition, offers: tuple[OfferedQos, ...]
    ) -> int:
        """Announce a topic; as `McapWriter.add_channel`, for all files to come."""
        return self._contents.add_channel(self._file, topic, definition, offers)

    def add_message(self, channel: int, data: bytes, log_time: int, publish_time: int) -> None:
        """Add a message; as `McapWriter.add_message`.

        In continuous streaming, where nobody calls `sync`, the next file is begun when a chunk
        is finished.
        """
        before = self._file.size if self._is_split else 0
        self._contents.add_message(self._file, channel, data, log_time, publish_time)
        self.messages += 1
        if self._is_split and self._file.size != before:
            self._split_stream()

    def add_metadata(self, name: str, fields: dict[str, str]) -> None:
        """Add a record of names and texts; as `McapWriter.add_metadata`.

        The last one of each name is repeated in the files to come, except `HEALTH_RECORD`.
        """
        self._contents.add_metadata(self._file, name, fields)

    def add_attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Add a file; as `McapWriter.add_attachment`; the last of each name is repeated."""
        self._contents.add_attachment(self._file, name, media_type, data)

    def flush(self) -> None:
        """Finish the chunk in progress; it is safe from the end of this process.

        As in `add_message`, the next file may be begun here.

        Raises
        ------
        FileError
            If a file could not be written: what was written before stays.
        """
        self._file.flush()
        self._keep_folder_described()
        self._split_stream()

    def sync(self) -> None:
        """Finish the chunk and return when it is on the disk, safe from a power cut.

        Between two hits: the next file is begun here if it is time.

        Raises
        ------
        FileError
            If a file could not be written: what was written before stays.
        """
        self._file.sync()
        self._has_synced = True
        self._keep_folder_described()
        if self._is_due():
            self._split()

    def close(self) -> None:
        """Finish the recording and put it on disk; safe to call twice.

        Raises
        ------
        FileError
            If its end could not be written; all chunks before are kept.
        """
        if self.closed:
            return
        try:
            self._contents.finish(self._file)
        finally:
            self._describe_folder()

    def __enter__(self) -> Self:
        """Return the writer itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Finish the recording, whatever happened."""
        self.close()

    def _begin(self) -> None:
        if self._folder is not None:
            refuse_existing_recording(self._folder)
        self._file = self._open(self._name_file(0))
        try:
            self._describe_folder()
        except FileError:
            self._file.close()
            self._file.path.unlink()
            raise

    def _name_file(self, number: int) -> Path:
        if self._folder is None:
            return self.path
        return self._folder / f"{self._folder.absolute().name}_{number}{SUFFIX}"

    def _is_due(self) -> bool:
        """Tell whether the file is full; one that only repeats what others say never is."""
        file = self._file
        if file.messages <= self._repeated:
            return False
        is_large = 0 < self._split_size <= file.size
        return is_large or 0 < self._split_duration <= file.end_time - file.start_time

    def _split_stream(self) -> None:
        """Begin the next file if it is time; where hits are synced, only between them."""
        if not self._has_synced and self._is_due():
            self._split()

    def _split(self) -> None:
        """Begin the next file, and only then finish the one before."""
        if self._before_split is not None:
            self._before_split()
        old, new = self._file, self._open(self._name_file(len(self._finished) + 1))
        self._contents.announce(new)
        self._finished.append(old)
        self._file = new
        self._has_synced = False
        try:
            self._contents.finish(old)
            self._contents.repeat(new, old.end_time)
            self._repeated = new.messages
        finally:
            self._describe_folder()

    def _keep_folder_described(self) -> None:
        """Name new topics at once: readers of a recording that was killed know no others."""
        if len(self._contents.topics) != self._described_topics:
            self._describe_folder()

    def _describe_folder(self) -> None:
        self._described_topics = len(self._contents.topics)
        if self._folder is not None:
            files = (*self._finished, self._file)
            summaries = [summarize_file(file) for file in files]
            write_bag_metadata(self._folder, summaries, self._contents.summarize(files))


def _check_limits(output: Path, split_size: int, split_duration: float) -> None:
    if split_size < 0:
        raise ParameterError(f"split_size is {split_size} byte: it must not be negative")
    if not 0 <= split_duration < LONGEST_SPLIT:
        raise ParameterError(
            f"split_duration is {split_duration} s: it must be from 0 to {LONGEST_SPLIT:g} s"
        )
    if (split_size or split_duration) and output.suffix == SUFFIX:
        raise ParameterError(
            f"{output} is to be one file, which cannot be split: name a folder, without {SUFFIX}"
        )
