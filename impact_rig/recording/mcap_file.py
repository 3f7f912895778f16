"""Reads an MCAP file of profile `ros2` from front to back, as far as it goes.

The index at the end is not needed, so that a recording that was never closed reads as well.
"""

import os
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

from impact_rig.core.errors import FileError
from impact_rig.recording.mcap_format import (
    MAGIC,
    MESSAGE_HEAD,
    RECORD_HEAD,
    U64,
    Channel,
    Opcode,
    RawMessage,
)
from impact_rig.recording.mcap_unpacking import (
    ContentReader,
    unpack_channel,
    unpack_chunk,
    unpack_schema,
)


class McapFile:
    """An MCAP file, checked to be one of ROS 2.

    Parameters
    ----------
    path : Path
        Of the file.

    Raises
    ------
    FileError
        If there is no such file, or it is no MCAP file, or not of profile `ros2`.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with self._open() as file:
            self._size = os.fstat(file.fileno()).st_size
            self._is_complete, self._summary_start = self._find_ending(file)
            self._check_start(file)

    @property
    def is_complete(self) -> bool:
        """Whether the recording was closed; if not, its end is missing."""
        return self._is_complete

    def read_messages(
        self, wanted: Callable[[Channel], bool] = lambda channel: True, start: int = len(MAGIC)
    ) -> Iterator[RawMessage]:
        """Yield messages in file order, one chunk in memory at a time.

        Parameters
        ----------
        wanted : callable
            Tells whether a channel's messages are to be yielded.
        start : int
            Where a record begins [byte]; the first by default.

        Raises
        ------
        FileError
            If the file is damaged (other than cut off at its end), or a wanted channel is not
            in `cdr`.
        """
        channels: dict[int, Channel | None] = {}
        schemas: dict[int, tuple[str, str, str]] = {}
        for opcode, content in self._read_records(start):
            try:
                yield from self._read_content(opcode, content, channels, schemas, wanted)
            except (struct.error, UnicodeDecodeError):
                raise FileError(f"{self.path} is damaged: a record is too short") from None
            except FileError as error:
                raise FileError(f"{self.path}: {error}") from None

    def read_channels(self) -> tuple[Channel, ...]:
        """Return all topics of the file: from its index, or else by reading all of it.

        Raises as `read_messages`.
        """
        channels: dict[int, Channel] = {}

        def note(channel: Channel) -> bool:
            channels[channel.id] = channel
            return False

        if self._summary_start:
            for _ in self.read_messages(note, self._summary_start):
                pass
        if not channels:
            for _ in self.read_messages(note):
                pass
        return tuple(channels.values())

    def _open(self) -> BinaryIO:
        try:
            return open(self.path, "rb")
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
        content = self._read_record(file)
        if content is None or content[0] != Opcode.HEADER:
            raise FileError(f"{self.path} holds no more than the beginning of an MCAP recording")
        try:
            profile = ContentReader(content[1]).take_text()
        except (struct.error, UnicodeDecodeError, FileError):
            raise FileError(f"{self.path} is damaged: its header cannot be read") from None
        if profile != "ros2":
            raise FileError(
                f"{self.path} is an MCAP file of profile {profile!r}: it should be 'ros2'"
            )

    def _find_ending(self, file: BinaryIO) -> tuple[bool, int]:
        length = RECORD_HEAD.size + 20 + len(MAGIC)
        file.seek(max(0, self._size - length))
        ending = file.read()
        file.seek(0)
        is_complete = len(ending) == length and ending.endswith(MAGIC)
        if not is_complete or not ending.startswith(RECORD_HEAD.pack(Opcode.FOOTER, 20)):
            return False, 0
        start = int(U64.unpack_from(ending, RECORD_HEAD.size)[0])
        return True, start if len(MAGIC) < start < self._size - length else 0

    def _read_records(self, start: int) -> Iterator[tuple[int, bytes]]:
        with self._open() as file:
            file.seek(start)
            while True:
                record = self._read_record(file)
                if record is None or record[0] in (Opcode.DATA_END, Opcode.FOOTER):
                    return
                yield record

    def _read_record(self, file: BinaryIO) -> tuple[int, bytes] | None:
        head = file.read(RECORD_HEAD.size)
        if len(head) < RECORD_HEAD.size:
            return None
        opcode, length = RECORD_HEAD.unpack(head)
        if length > self._size - file.tell():
            if self._is_complete:
                raise FileError(f"{self.path} is damaged: a record claims {length} bytes")
            return None
        return opcode, file.read(length)

    def _read_content(
        self,
        opcode: int,
        content: bytes,
        channels: dict[int, Channel | None],
        schemas: dict[int, tuple[str, str, str]],
        wanted: Callable[[Channel], bool],
    ) -> Iterator[RawMessage]:
        if opcode == Opcode.CHUNK:
            records = unpack_chunk(content)
            position = 0
            while position < len(records):
                inner, length = RECORD_HEAD.unpack_from(records, position)
                start = position + RECORD_HEAD.size
                position = start + length
                if position > len(records):
                    raise FileError("a record does not end with its chunk: the file is damaged")
                if inner == Opcode.MESSAGE:
                    message = _read_message(records, start, position, channels)
                    if message is not None:
                        yield message
                elif inner != Opcode.CHUNK:
                    yield from self._read_content(
                        inner, records[start:position], channels, schemas, wanted
                    )
        elif opcode == Opcode.MESSAGE:
            message = _read_message(content, 0, len(content), channels)
            if message is not None:
                yield message
        elif opcode == Opcode.SCHEMA:
            number, *schema = unpack_schema(content)
            schemas[number] = (schema[0], schema[1], schema[2])
        elif opcode == Opcode.CHANNEL:
            channel = unpack_channel(content, schemas)
            if channel.id not in channels:
                channels[channel.id] = self._check_channel(channel) if wanted(channel) else None

    def _check_channel(self, channel: Channel) -> Channel:
        if channel.encoding != "cdr" or channel.schema_encoding != "ros2msg":
            raise FileError(
                f"topic {channel.topic!r} is in {channel.encoding!r} with a schema in"
                f" {channel.schema_encoding!r}: 'cdr' and 'ros2msg' can be read"
            )
        return channel


def _read_message(
    records: bytes, start: int, stop: int, channels: dict[int, Channel | None]
) -> RawMessage | None:
    number, sequence, log_time, publish_time = MESSAGE_HEAD.unpack_from(records, start)
    try:
        channel = channels[number]
    except KeyError:
        raise FileError(f"a message belongs to channel {number}, which is not announced") from None
    if channel is None:
        return None
    data = records[start + MESSAGE_HEAD.size : stop]
    return RawMessage(channel, sequence, log_time, publish_time, data)
