"""Writes a recording: one MCAP file."""

import time
from collections import Counter
from pathlib import Path
from typing import Any, Self

from mcap.writer import CompressionType, Writer

from impact_rig.recordings.new_file import DiskFile, make_folders
from impact_rig.recordings.records import RECORDER, Channel, OfferedQos, format_offered_qos
from impact_rig.recordings.schemas import MessageDefinition

DEFAULT_CHUNK_SIZE = 1 << 20
"""Uncompressed size at which a chunk is finished [byte]; what other MCAP writers use."""
MESSAGE_OVERHEAD = 64
"""Overhead of a message [byte]: 31 in its record, 16 in the chunk's index."""


class RecordingWriter:
    """A recording in the making, written by `mcap.writer.Writer`.

    Finished chunks are safe from the end of the process. The writer stops before the disk is
    full, so that the file can still be finished.

    Parameters
    ----------
    path : Path
        Of the new file; it must not exist, its folder is made.
    compression : str
        Of chunks: zstd, lz4 or none.
    chunk_size : int
        Uncompressed size at which a chunk is finished [byte].
    library : str
        What wrote the file, kept in it.

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
        library: str = RECORDER,
    ) -> None:
        self.path = path
        self._schemas: dict[tuple[str, str], int] = {}
        self._channels: dict[str, int] = {}
        self._announced: dict[tuple[Any, ...], int] = {}
        self._counts: Counter[int] = Counter()  # of the messages added, by channel
        make_folders(path.parent)
        self._file = DiskFile(path)
        self._writer = Writer(
            self._file,  # type: ignore[arg-type]  # it needs no more of a file than this has
            chunk_size=chunk_size,
            compression=CompressionType[compression.upper()],
        )
        self._writer.start("ros2", library)

    @property
    def size(self) -> int:
        """Bytes written so far, the unfinished chunk not included."""
        return self._file.size

    @property
    def closed(self) -> bool:
        """Whether the file is finished."""
        return self._file.closed

    @property
    def messages(self) -> int:
        """Number of added messages."""
        return self._counts.total()

    def count_messages(self, topic: str) -> int:
        """Return how many messages of a topic were added."""
        return self._counts[self._channels.get(topic, 0)]

    def add_channel(
        self, topic: str, definition: MessageDefinition, qos: tuple[OfferedQos, ...]
    ) -> int:
        """Announce a topic with its publishers' QoS; otherwise as `announce`."""
        metadata = {
            "offered_qos_profiles": format_offered_qos(qos),
            "topic_type_hash": definition.type_hash,
        }
        return self.announce(Channel(0, topic, definition.type_name, definition.text, metadata))

    def announce(self, channel: Channel) -> int:
        """Announce a topic, once if described alike again; its own number does not count.

        Returns
        -------
        int
            Number of the channel, for `add_message`; they are counted from 1.

        Raises
        ------
        FileError
            If a chunk could not be written, now or before.
        """
        described = (*channel[1:4], *sorted(channel.metadata.items()), channel.encoding)
        if described in self._announced:
            return self._announced[described]
        self._file.plan(len(channel.schema))
        key, encoding = (channel.type_name, channel.schema), channel.encoding
        if key not in self._schemas:
            text = key[1].encode(errors="surrogateescape")
            self._schemas[key] = (
                self._writer.register_schema(key[0], encoding[1], text) if key[0] else 0
            )
        self._channels[channel.topic] = self._writer.register_channel(
            channel.topic, encoding[0], self._schemas[key], dict(channel.metadata)
        )
        self._announced[described] = self._channels[channel.topic]
        return self._channels[channel.topic]

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
        number = (self._counts[channel] if sequence is None else sequence) & 0xFFFFFFFF
        before = file.size
        self._writer.add_message(channel, log_time, data, publish_time, number)
        if file.size != before:
            file.flush()
        self._counts[channel] += 1

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
            if self._file.failure is None:
                self._writer.finish()
        finally:
            self._file.close()

    def __enter__(self) -> Self:
        """Return the writer itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Finish the file, whatever happened."""
        self.close()
