"""Writes a recording: one MCAP file, or a folder as rosbag2 writes it, split between hits."""

import contextlib
import functools
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from mcap.writer import CompressionType, Writer

from impact_rig.core.errors import FileError, ParameterError
from impact_rig.recordings.bag import (
    METADATA_NAME,
    SUFFIX,
    FileSummary,
    TopicSummary,
    format_bag_metadata,
    write_bag_metadata,
)
from impact_rig.recordings.new_file import DiskFile, make_folders
from impact_rig.recordings.qos import OfferedQos, format_offered_qos
from impact_rig.recordings.records import Channel
from impact_rig.recordings.schemas import MessageDefinition

COMPRESSIONS = ("zstd", "lz4", "none")
"""How chunks may be compressed."""
DEFAULT_CHUNK_SIZE = 1 << 20
"""Uncompressed size at which a chunk is finished [byte]; what other MCAP writers use."""
MESSAGE_OVERHEAD = 64
"""What a message takes beside its own bytes [byte]: 31 in its record, 16 in the chunk's index."""


class McapWriter:
    """A recording of one file in the making, written by `mcap.writer.Writer`.

    Finished chunks are safe from the end of the process; before the disk is full the file is
    refused more, so that it can still be finished.

    Parameters
    ----------
    path : Path
        Of the new file; it must not exist, its folder must.
    compression : str
        One of `COMPRESSIONS`.
    chunk_size : int
        Uncompressed size at which a chunk is finished [byte].
    library : str
        What wrote the file, kept in it.
    keep_free : int
        What is left free on the disk for others [byte].

    Attributes
    ----------
    path : Path
        As given.
    messages : int
        How many were added.
    start_time, end_time : int
        Earliest and latest time of reception of a message [ns]; 0 as long as there is none.

    Raises
    ------
    FileError
        If the file exists already or cannot be created.
    """

    def __init__(
        self,
        path: Path,
        *,
        compression: str = "zstd",
        chunk_size: int = DEFAULT_CHUNK_SIZE,
        library: str = "impact_rig",
        keep_free: int = 0,
    ) -> None:
        self.path = path
        self.messages = 0
        self.start_time = 0
        self.end_time = 0
        self._schemas: dict[tuple[str, str], int] = {}
        self._channels: dict[str, int] = {}
        self._counts: Counter[int] = Counter()
        self._file = DiskFile(path, keep_free)
        self._writer = Writer(
            self._file,  # type: ignore[arg-type]  # it needs no more of a file than this has
            chunk_size=chunk_size,
            compression=CompressionType[compression.upper()],
        )
        try:
            self._writer.start("ros2", library)
        except FileError:
            self._file.close()
            path.unlink(missing_ok=True)
            raise

    @property
    def size(self) -> int:
        """Bytes written so far, the unfinished chunk not included."""
        return self._file.size

    @property
    def closed(self) -> bool:
        """Whether the file is finished."""
        return self._file.closed

    @property
    def has_failed(self) -> bool:
        """Whether it takes nothing more, since something could not be written."""
        return self._file.failure is not None and not self.closed

    @property
    def free_space(self) -> int:
        """Bytes that may still be added before the disk counts as full; 0 of a closed file."""
        return self._file.free_space

    def count_messages(self, topic: str) -> int:
        """Return how many messages of a topic were added."""
        return self.count_of(self._channels.get(topic, 0))

    def count_of(self, channel: int) -> int:
        """Return how many messages of a channel were added."""
        return self._counts[channel]

    def add_channel(
        self, topic: str, definition: MessageDefinition, qos: tuple[OfferedQos, ...]
    ) -> int:
        """Announce a topic.

        Parameters
        ----------
        topic : str
            Full name.
        definition : MessageDefinition
            Of its type.
        qos : tuple of OfferedQos
            What its publishers offer.

        Returns
        -------
        int
            Number of the channel, for `add_message`; they are counted from 1.

        Raises
        ------
        FileError
            If a chunk could not be written, now or before.
        """
        metadata = {
            "offered_qos_profiles": format_offered_qos(qos),
            "topic_type_hash": definition.type_hash,
        }
        return self.announce(Channel(0, topic, definition.type_name, definition.text, metadata))

    def announce(self, channel: Channel) -> int:
        """Announce a topic as it stands in a file; otherwise as `add_channel`."""
        self._file.plan(len(channel.schema))
        key, encoding = (channel.type_name, channel.schema), channel.encoding
        if key not in self._schemas:
            self._schemas[key] = (
                self._writer.register_schema(key[0], encoding[1], key[1].encode()) if key[0] else 0
            )
        number = self._writer.register_channel(
            channel.topic, encoding[0], self._schemas[key], dict(channel.metadata)
        )
        self._channels[channel.topic] = number
        return number

    def add_message(
        self,
        channel: int,
        data: bytes,
        log_time: int,
        publish_time: int,
        sequence: int | None = None,
    ) -> None:
        """Add a message; it reaches the disk when its chunk is finished.

        Parameters
        ----------
        channel : int
            As returned by `add_channel`.
        data : bytes
            Serialised message.
        log_time, publish_time : int
            When it was received and sent, nanoseconds since the epoch.
        sequence : int, optional
            Its number in its channel; by default they are counted from 0.

        Raises
        ------
        DiskFullError
            If the disk is about to be full: the message is not taken, and the file can still be
            closed well.
        FileError
            If a chunk could not be written, now or before: the chunks before it stay.
        """
        file = self._file
        file.plan(len(data) + MESSAGE_OVERHEAD)
        count = self._counts[channel]
        number = (count if sequence is None else sequence) & 0xFFFFFFFF
        before = file.size
        self._writer.add_message(channel, log_time, data, publish_time, number)
        if file.size != before:
            file.flush()
        self.start_time = min(self.start_time, log_time) if self.messages else log_time
        self.end_time = max(self.end_time, log_time)
        self._counts[channel] += 1
        self.messages += 1

    def add_metadata(self, name: str, fields: dict[str, str]) -> None:
        """Add a record of names and texts; it may take of the room that is left for the ending.

        Raises
        ------
        FileError
            If it could not be written.
        """
        self._file.check()
        self._writer.add_metadata(name, fields)

    def add_attachment(
        self, name: str, media_type: str, data: bytes, log_time: int | None = None
    ) -> None:
        """Add a file.

        Parameters
        ----------
        name : str
            Of the file.
        media_type : str
            What it is, for example "text/plain".
        data : bytes
            All of it.
        log_time : int, optional
            When it was taken, nanoseconds since the epoch; by default now.

        Raises
        ------
        DiskFullError
            If the disk is about to be full: the file is not taken.
        FileError
            If it could not be written.
        """
        self._file.plan(len(data))
        moment = time.time_ns() if log_time is None else log_time
        self._writer.add_attachment(moment, moment, name, media_type, data)

    def flush(self) -> None:
        """Finish the chunk in progress, if it holds a message.

        Raises
        ------
        FileError
            If the chunk could not be written: chunks before it stay.
        """
        self._file.check()
        self._writer.flush()

    def sync(self) -> None:
        """Finish the chunk in progress and return when all messages are on the disk itself.

        Raises
        ------
        FileError
            If that could not be done: chunks before stay.
        """
        self.flush()
        self._file.sync()

    def close(self) -> None:
        """Finish the file and put it on disk; safe to call twice.

        Raises
        ------
        FileError
            If the last chunk or the index could not be written; all chunks before are kept.
        """
        if self.closed:
            return
        try:
            if not self.has_failed:
                self._writer.finish()
        finally:
            self._file.close()

    def __enter__(self) -> Self:
        """Return the writer itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Finish the file, whatever happened."""
        self.close()


DEFAULT_KEEP_FREE = 64 << 20
"""What is left free on the disk for others [byte], our choice: a computer without any space on
its disk is hard to help."""
HEALTH_RECORD = "impact_rig/health"
"""Metadata record that tells how one file ended; the only one that is not repeated in the next."""
_BAG_SUFFIXES = frozenset({SUFFIX, ".db3"})
"""Of the files that make a folder one of rosbag2."""


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
        One of `COMPRESSIONS`.
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
        If a bare file is to be split.
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
        self._is_split = bool(split_size or split_duration)
        if self._is_split and self._folder is None:
            raise ParameterError(
                f"{output} is to be one file, which cannot be split: name a folder, without"
                f" {SUFFIX}"
            )
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
        self._topics: dict[int, _Topic] = {}  # by their channels, the same in each file
        self._metadata: dict[str, dict[str, str]] = {}
        self._attachments: dict[str, tuple[str, bytes, int]] = {}
        self._finished: list[McapWriter] = []
        self._repeated = 0
        self._has_synced = False
        self._described_topics = 0
        made = make_folders(self._folder or output.parent)
        try:
            self._begin()
        except FileError:
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
        return sum(item.count for item in self._topics.values() if item.name == topic)

    def add_channel(
        self, topic: str, definition: MessageDefinition, offers: tuple[OfferedQos, ...]
    ) -> int:
        """Announce a topic; as `McapWriter.add_channel`, for all files to come."""
        channel = self._file.add_channel(topic, definition, offers)
        self._topics[channel] = _Topic(topic, definition, offers)
        return channel

    def add_message(self, channel: int, data: bytes, log_time: int, publish_time: int) -> None:
        """Add a message; as `McapWriter.add_message`.

        In continuous streaming, where nobody calls `sync`, the next file is begun when a chunk
        is finished.
        """
        before = self._file.size if self._is_split else 0
        topic = self._topics[channel]
        self._file.add_message(channel, data, log_time, publish_time, topic.count)
        if topic.is_state:
            topic.last = (data, publish_time, topic.count)
        topic.count += 1
        self.messages += 1
        if self._is_split and self._file.size != before:
            self._split_stream()

    def add_metadata(self, name: str, fields: dict[str, str]) -> None:
        """Add a record of names and texts; as `McapWriter.add_metadata`.

        The last one of each name is repeated in the files to come, except `HEALTH_RECORD`.
        """
        self._file.add_metadata(name, fields)
        if name != HEALTH_RECORD:
            self._metadata[name] = dict(fields)

    def add_attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Add a file; as `McapWriter.add_attachment`; the last of each name is repeated."""
        moment = time.time_ns()
        self._file.add_attachment(name, media_type, data, moment)
        self._attachments[name] = (media_type, data, moment)

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
            self._finish(self._file)
        finally:
            self._describe_folder()

    def __enter__(self) -> Self:
        """Return the writer itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Finish the recording, whatever happened."""
        self.close()

    def _begin(self) -> None:
        if self._folder is not None:
            _refuse_existing_recording(self._folder)
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
        for topic in self._topics.values():
            new.add_channel(topic.name, topic.definition, topic.offers)
        self._finished.append(old)
        self._file = new
        self._has_synced = False
        try:
            self._finish(old)
            self._repeat(new, old.end_time)
            self._repeated = new.messages
        finally:
            self._describe_folder()

    def _keep_folder_described(self) -> None:
        """Name new topics at once: readers of a recording that was killed know no others."""
        if len(self._topics) != self._described_topics:
            self._describe_folder()

    def _describe_folder(self) -> None:
        self._described_topics = len(self._topics)
        if self._folder is not None:
            files = (*self._finished, self._file)
            summaries = [_summarize_file(file) for file in files]
            write_bag_metadata(self._folder, summaries, self._summarize(files))

    def _repeat(self, file: McapWriter, moment: int) -> None:
        """Write what is repeated into a new file.

        A repeated message keeps its number in its topic and its time of sending; as its time of
        reception it gets `moment` [ns], so that the files' times follow one another.
        """
        for name, fields in self._metadata.items():
            file.add_metadata(name, fields)
        for name, (media_type, data, taken) in self._attachments.items():
            file.add_attachment(name, media_type, data, taken)
        for channel, topic in self._topics.items():
            if topic.last is not None:
                data, publish_time, sequence = topic.last
                file.add_message(channel, data, moment, publish_time, sequence)

    def _finish(self, file: McapWriter) -> None:
        """Close a file, with what rosbag2 looks for in it."""
        try:
            if not file.has_failed:
                text = format_bag_metadata([_summarize_file(file)], self._summarize([file]))
                file.add_metadata("rosbag2", {"serialized_metadata": text})
        finally:
            file.close()

    def _summarize(self, files: Sequence[McapWriter]) -> list[TopicSummary]:
        """Return the topics with what some files together hold of them."""
        return [
            TopicSummary(
                name=topic.name,
                type_name=topic.definition.type_name,
                type_hash=topic.definition.type_hash,
                offers=topic.offers,
                messages=sum(file.count_messages(topic.name) for file in files),
            )
            for topic in self._topics.values()
        ]


@dataclass
class _Topic:
    """One topic, over all files.

    Attributes
    ----------
    name, definition, offers
        As announced.
    count : int
        How many of its messages were added; repeated ones do not count.
    last : tuple, optional
        Data, publish time and sequence of the message that the next file repeats.
    """

    name: str
    definition: MessageDefinition
    offers: tuple[OfferedQos, ...]
    count: int = 0
    last: tuple[bytes, int, int] | None = None

    def __post_init__(self) -> None:
        """Find out whether its last message holds until the next one comes."""
        self.is_state = any(
            offer.durability == "transient_local" and offer.depth == 1 for offer in self.offers
        )


def _summarize_file(file: McapWriter) -> FileSummary:
    """Return what `metadata.yaml` says of a file."""
    return FileSummary(file.path.name, file.messages, file.start_time, file.end_time)


def _refuse_existing_recording(folder: Path) -> None:
    """Make sure that a folder holds no recording yet.

    Raises
    ------
    FileError
        If it does, or cannot be read.
    """
    try:
        names = sorted(item.name for item in folder.iterdir())
    except OSError as error:
        raise FileError(f"folder {folder} cannot be read: {error.strerror}") from None
    for name in names:
        if name == METADATA_NAME or Path(name).suffix in _BAG_SUFFIXES:
            raise FileError(
                f"folder {folder} holds a recording already ({name}): none is overwritten, name"
                " another folder"
            )
