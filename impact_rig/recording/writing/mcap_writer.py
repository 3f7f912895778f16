"""Writes messages that are already serialised to one MCAP file of profile `ros2`."""

import time
from pathlib import Path
from types import TracebackType
from typing import Self

from mcap.opcode import Opcode
from mcap.records import Attachment, AttachmentIndex, DataEnd, Header, Metadata, MetadataIndex

from impact_rig.core.errors import FileError, ParameterError
from impact_rig.recording.interfaces.message_definitions import MessageDefinition
from impact_rig.recording.interfaces.qos_profiles import OfferedQos
from impact_rig.recording.reading.mcap_records import MAGIC
from impact_rig.recording.writing.chunk_builder import ChunkBuilder
from impact_rig.recording.writing.disk_file import DiskFile
from impact_rig.recording.writing.mcap_summary import McapSummary, format_record
from impact_rig.recording.writing.mcap_topics import McapTopics

DEFAULT_CHUNK_SIZE = 1 << 20
"""Uncompressed size at which a chunk is finished [byte]; what other MCAP writers use."""
MESSAGE_OVERHEAD = 64
"""What a message takes beside its own bytes [byte]: 31 in its record, 16 in the chunk's index."""


class McapWriter:
    """A recording of one file in the making.

    Finished chunks are safe from the end of the process; before the disk is full the file is
    refused more, so that it can still be finished.

    Parameters
    ----------
    path : Path
        Of the new file; it must not exist, its folder must.
    compression : str
        One of `chunk_builder.COMPRESSIONS`.
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

    Raises
    ------
    ParameterError
        If the compression is unknown, or a size negative or the chunk's zero.
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
        self._chunk = ChunkBuilder(compression)
        if chunk_size < 1:
            raise ParameterError(f"chunk size is {chunk_size} byte: it must be positive")
        if keep_free < 0:
            raise ParameterError(f"keep_free is {keep_free} byte: it must not be negative")
        self.path = path
        self._chunk_size = chunk_size
        self._summary = McapSummary()
        self._topics = McapTopics()
        self._file = DiskFile(path, keep_free)
        try:
            self._file.write(MAGIC, format_record(Header("ros2", library)))
        except FileError:
            self._file.close()
            path.unlink(missing_ok=True)
            raise

    @property
    def messages(self) -> int:
        """How many were added."""
        return self._summary.messages

    @property
    def start_time(self) -> int:
        """Earliest time of reception of a message [ns]; 0 as long as there is none."""
        return self._summary.start_time

    @property
    def end_time(self) -> int:
        """Latest time of reception of a message [ns]; 0 as long as there is none."""
        return self._summary.end_time

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
        return self._summary.counts[self._topics.find(topic)]

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
        self._file.plan(len(definition.text))
        channel, records = self._topics.announce(topic, definition, qos)
        for kind, record in records:
            # In the chunk in progress, and again at the end of the file.
            self._chunk.add_record(record)
            self._summary.add(kind, record)
        return channel

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
        count = self._summary.counts[channel]
        number = (count if sequence is None else sequence) & 0xFFFFFFFF
        self._chunk.add_message(channel, number, log_time, publish_time, data)
        if self._chunk.size > self._chunk_size:
            self._finish_chunk()
        self._summary.count_message(channel, log_time)

    def add_metadata(self, name: str, fields: dict[str, str]) -> None:
        """Add a record of names and texts; it may take of the room that is left for the ending.

        Raises
        ------
        FileError
            If it could not be written.
        """
        record = format_record(Metadata(name, fields))
        index = MetadataIndex(self._file.size, len(record), name)
        self._file.write(record)
        self._summary.add(Opcode.METADATA_INDEX, format_record(index))

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
        record = format_record(Attachment(moment, moment, name, media_type, data))
        index = AttachmentIndex(
            self._file.size, len(record), moment, moment, len(data), name, media_type
        )
        self._file.write(record)
        self._summary.add(Opcode.ATTACHMENT_INDEX, format_record(index))

    def flush(self) -> None:
        """Finish the chunk in progress, if it holds a message.

        Raises
        ------
        FileError
            If the chunk could not be written: chunks before it stay.
        """
        self._file.check()
        self._finish_chunk()

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
                self._finish_chunk()
                end = format_record(DataEnd(data_section_crc=0))
                self._file.write(end, self._summary.format(self._file.size + len(end)))
        finally:
            self._file.close()

    def __enter__(self) -> Self:
        """Return the writer itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Finish the file, whatever happened."""
        self.close()

    def _finish_chunk(self) -> None:
        if not self._chunk.messages:
            return
        chunk = self._chunk.finish(self._file.size)
        self._file.write(*chunk.pieces)
        self._summary.add(Opcode.CHUNK_INDEX, chunk.summary)
        self._file.settle()
