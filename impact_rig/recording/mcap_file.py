"""Reads an MCAP file of profile `ros2` from front to back, as far as it goes.

The index at the end is not needed, so that a recording that was never closed reads as well.
"""

import os
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import Attachment as AttachmentRecord
from mcap.records import Channel as ChannelRecord
from mcap.records import Chunk, DataEnd, Footer, Header, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from zstandard import ZstdError

from impact_rig.core.errors import FileError

MAGIC = b"\x89MCAP0\r\n"
"""First and last bytes of every file."""
_DAMAGE = (ValueError, RuntimeError, OverflowError, MemoryError)
"""What the container's and the compressors' libraries raise on bytes that make no sense, beside
their own errors."""


class Channel(NamedTuple):
    """One topic of a file.

    Attributes
    ----------
    id : int
        Unique in the file.
    topic : str
        Full name.
    type_name : str
        For example `impact_rig_msgs/msg/Impact`.
    schema : str
        Definition of the type, as `ros2msg`.
    metadata : dict
        `offered_qos_profiles` and `topic_type_hash` for ROS 2.
    """

    id: int
    topic: str
    type_name: str
    schema: str
    metadata: dict[str, str]


class RawMessage(NamedTuple):
    """One message as it stands in the file.

    Attributes
    ----------
    channel : Channel
        Its topic.
    sequence : int
        Counted per channel.
    log_time, publish_time : int
        When it was received and sent, nanoseconds since the epoch.
    data : bytes
        Serialised.
    """

    channel: Channel
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


class MetadataRecord(NamedTuple):
    """What was noted beside the messages.

    Attributes
    ----------
    name : str
        What it is about; the same name may come again.
    fields : dict
        Texts by their names.
    """

    name: str
    fields: dict[str, str]


class Attachment(NamedTuple):
    """A file kept inside the recording.

    Attributes
    ----------
    name, media_type : str
        Its name, for example `rig.toml`, and its kind, for example `application/toml`.
    log_time : int
        When it was attached, nanoseconds since the epoch.
    data : bytes
        Its content.
    """

    name: str
    media_type: str
    log_time: int
    data: bytes


class McapFile:
    """An MCAP file, checked to be one of ROS 2.

    Parameters
    ----------
    path : Path
        Of the file.

    Raises
    ------
    FileError
        If there is no such file, or it is none of MCAP with profile `ros2`.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with self._open() as file:
            self._size = os.fstat(file.fileno()).st_size
            self._check_start(file)
            file.seek(max(0, self._size - len(MAGIC)))
            self._is_complete = file.read() == MAGIC

    @property
    def is_complete(self) -> bool:
        """Whether the recording was closed; if not, its end is missing."""
        return self._is_complete

    @property
    def files(self) -> tuple[Path, ...]:
        """The file itself."""
        return (self.path,)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the reader should know, in words; empty: nothing."""
        if self._is_complete:
            return ()
        return (f"{self.path} was never closed: it is read up to the last message that is whole",)

    def read_messages(
        self,
        wanted: Callable[[Channel], bool] = lambda _: True,
        *,
        start_time: int | None = None,
        end_time: int | None = None,
    ) -> Iterator[RawMessage]:
        """Yield messages in file order, one chunk in memory at a time.

        Parameters
        ----------
        wanted : callable
            Tells whether a channel's messages are to be yielded.
        start_time, end_time : int, optional
            Only messages logged from the one to before the other, nanoseconds since the epoch.

        Raises
        ------
        FileError
            If the file is damaged (other than cut off at its end), or a wanted channel is not
            in `cdr`.
        """
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel | None] = {}
        for record in self._read_records():
            if isinstance(record, Message):
                if record.channel_id not in channels:
                    raise self._make_error("a message belongs to a channel that is not announced")
                channel = channels[record.channel_id]
                if channel is not None and lies_between(record.log_time, start_time, end_time):
                    yield RawMessage(
                        channel,
                        record.sequence,
                        record.log_time,
                        record.publish_time,
                        record.data,
                    )
            elif isinstance(record, Schema):
                schemas.setdefault(record.id, record)
            elif isinstance(record, ChannelRecord) and record.id not in channels:
                channel = self._make_channel(record, schemas.get(record.schema_id))
                channels[record.id] = channel if wanted(channel) else None
                if channels[record.id] is not None:
                    self._check_encoding(record, schemas.get(record.schema_id))

    def read_channels(self) -> tuple[Channel, ...]:
        """Return all topics of the file: from its index, or else by reading all of it.

        Raises as `read_messages`.
        """
        summary = self._read_summary()
        if summary is not None:
            return tuple(
                self._make_channel(channel, summary.schemas.get(channel.schema_id))
                for channel in summary.channels.values()
            )
        channels: list[Channel] = []

        def note(channel: Channel) -> bool:
            channels.append(channel)
            return False

        for _ in self.read_messages(note):
            pass
        return tuple(channels)

    def read_metadata(self) -> tuple[MetadataRecord, ...]:
        """Return what was noted beside the messages; raises as `read_messages`."""
        return tuple(
            MetadataRecord(record.name, dict(record.metadata))
            for record in self._read_records()
            if isinstance(record, Metadata)
        )

    def read_attachments(self) -> tuple[Attachment, ...]:
        """Return the files kept inside the recording; raises as `read_messages`."""
        return tuple(
            Attachment(record.name, record.media_type, record.log_time, record.data)
            for record in self._read_records()
            if isinstance(record, AttachmentRecord)
        )

    def _open(self) -> BinaryIO:
        try:
            return self.path.open("rb")
        except FileNotFoundError:
            raise FileError(f"there is no file {self.path}") from None
        except IsADirectoryError:
            raise FileError(f"{self.path} is a folder: name the .mcap file in it") from None
        except OSError as error:
            raise FileError(f"{self.path} cannot be read: {error.strerror}") from None

    def _check_start(self, file: BinaryIO) -> None:
        if self._size == 0:
            raise FileError(f"{self.path} is empty: it should be an MCAP recording")
        if file.read(len(MAGIC)) != MAGIC:
            raise FileError(f"{self.path} is no MCAP recording: it does not begin like one")
        file.seek(0)
        try:
            header = next(StreamReader(file, record_size_limit=self._size).records)
        except (McapError, StopIteration):
            raise FileError(
                f"{self.path} holds no more than the beginning of an MCAP recording"
            ) from None
        except (struct.error, UnicodeDecodeError, ValueError):
            raise FileError(f"{self.path} is damaged: its header cannot be read") from None
        if not isinstance(header, Header):
            raise FileError(f"{self.path} is damaged: it has no header")
        if header.profile != "ros2":
            raise FileError(
                f"{self.path} is an MCAP file of profile {header.profile!r}: it should be 'ros2'"
            )

    def _read_summary(self) -> Any:
        """Return the index at the end, if there is one that can be read and names topics."""
        if not self._is_complete:
            return None
        try:
            with self._open() as file:
                reader = SeekingReader(file, validate_crcs=True, record_size_limit=self._size)
                summary = reader.get_summary()
        except (McapError, OSError, struct.error, ValueError, MemoryError):
            return None
        return summary if summary is not None and summary.channels else None

    def _read_records(self) -> Iterator[McapRecord]:
        with self._open() as file:
            reader = StreamReader(file, emit_chunks=True, record_size_limit=self._size)
            try:
                for record in reader.records:
                    if isinstance(record, (DataEnd, Footer)):
                        return
                    if isinstance(record, Chunk):
                        yield from breakup_chunk(record, validate_crc=True)
                    else:
                        yield record
            except (McapError, ZstdError, struct.error, *_DAMAGE) as error:
                # What breaks at the very end of a file that was never closed was cut off there.
                if self._is_complete or file.tell() < self._size:
                    raise self._make_error(str(error) or type(error).__name__) from None

    def _make_channel(self, record: Any, schema: Any) -> Channel:
        if schema is None:
            raise self._make_error(f"topic {record.topic!r} has no schema")
        return Channel(
            id=record.id,
            topic=record.topic,
            type_name=schema.name,
            schema=schema.data.decode(errors="replace"),
            metadata=dict(record.metadata),
        )

    def _check_encoding(self, record: Any, schema: Any) -> None:
        if record.message_encoding != "cdr" or schema.encoding != "ros2msg":
            raise FileError(
                f"{self.path}: topic {record.topic!r} is in {record.message_encoding!r} with a"
                f" schema in {schema.encoding!r}: 'cdr' and 'ros2msg' can be read"
            )

    def _make_error(self, reason: str) -> FileError:
        return FileError(f"{self.path} is damaged: {reason}")


def lies_between(time: int, start_time: int | None, end_time: int | None) -> bool:
    """Return whether a time lies from the one to before the other; None: no limit."""
    return (start_time is None or time >= start_time) and (end_time is None or time < end_time)
