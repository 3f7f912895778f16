"""One chunk of an MCAP file in the making: messages, their index, and what is said of both."""

import struct
import zlib
from collections.abc import Callable
from typing import NamedTuple

from mcap.opcode import Opcode

from impact_rig.core.errors import ParameterError
from impact_rig.recording.reading.mcap_records import (
    CHUNK_HEAD,
    FRAME_HEAD,
    INDEX_ENTRY,
    INDEX_HEAD,
    LENGTH,
    MESSAGE_HEAD,
)

COMPRESSIONS = ("zstd", "lz4", "none")
"""How chunks may be compressed."""
LZ4_LEVEL = -1
"""Of lz4, our choice: on counts of a digitizer a fifth faster than its default, and no larger."""
ZSTD_LEVEL = 2
"""Of zstd, our choice: on noise of a digitizer a third faster than its default, 3, on hits a
twentieth; a hundredth larger."""

_RECORD_HEAD = struct.Struct("<BQHIQQ")
"""Frame and head of a message in one."""
_INDEX_RECORD_HEAD = struct.Struct("<BQHI")
"""Frame of a chunk's message index, its channel, and the length of its entries."""
_TIME_AND_PLACE = struct.Struct("<QQ")
_TABLE_LENGTH = struct.Struct("<I")


class FinishedChunk(NamedTuple):
    """A chunk as it stands in the file.

    Attributes
    ----------
    pieces : tuple of bytes
        The chunk and its message indexes.
    summary : bytes
        The record that tells of it at the end of the file.
    """

    pieces: tuple[bytes, ...]
    summary: bytes


class ChunkBuilder:
    """Collects the records of a chunk; messages stay where they are until it is finished.

    Parameters
    ----------
    compression : str
        One of `COMPRESSIONS`.

    Attributes
    ----------
    size : int
        Of the records so far [byte].
    messages : int
        Among them [-].

    Raises
    ------
    ParameterError
        If the compression is unknown.
    """

    def __init__(self, compression: str) -> None:
        self._compress = _find_compressor(compression)
        self._name = b"" if compression == "none" else compression.encode()
        self._clear()

    def add_record(self, record: bytes) -> None:
        """Add a schema or a channel."""
        self._pieces.append(record)
        self.size += len(record)

    def add_message(
        self, channel: int, sequence: int, log_time: int, publish_time: int, data: bytes
    ) -> None:
        """Add a message; the times are nanoseconds since the epoch."""
        index = self._indexes.get(channel)
        if index is None:
            index = self._indexes[channel] = bytearray()
        index += _TIME_AND_PLACE.pack(log_time, self.size)
        if self.messages == 0:
            self._start_time = self._end_time = log_time
        elif log_time > self._end_time:
            self._end_time = log_time
        elif log_time < self._start_time:
            self._start_time = log_time
        length = MESSAGE_HEAD.size + len(data)
        self._pieces += (
            _RECORD_HEAD.pack(Opcode.MESSAGE, length, channel, sequence, log_time, publish_time),
            data,
        )
        self.size += FRAME_HEAD.size + length
        self.messages += 1

    def finish(self, place: int) -> FinishedChunk:
        """Return the chunk for a place in the file [byte], and begin the next one."""
        # What is not compressed is written from where it lies: joining it would cost a third more.
        records = self._pieces if self._compress is None else [b"".join(self._pieces)]
        checksum = 0
        for piece in records:
            checksum = zlib.crc32(piece, checksum)
        data = records if self._compress is None else [self._compress(records[0])]
        size, name = sum(map(len, data)), self._name
        head = (
            CHUNK_HEAD.pack(self._start_time, self._end_time, self.size, checksum, len(name))
            + name
            + LENGTH.pack(size)
        )
        length = FRAME_HEAD.size + len(head) + size
        head = FRAME_HEAD.pack(Opcode.CHUNK, length - FRAME_HEAD.size) + head
        indexes, table = self._format_indexes(place + length)
        index = b"".join((
            INDEX_HEAD.pack(self._start_time, self._end_time, place, length, len(table)),
            table,
            LENGTH.pack(len(indexes)),
            _TABLE_LENGTH.pack(len(name)),
            name,
            LENGTH.pack(size),
            LENGTH.pack(self.size),
        ))  # fmt: skip
        self._clear()
        return FinishedChunk(
            (head, *data, indexes), FRAME_HEAD.pack(Opcode.CHUNK_INDEX, len(index)) + index
        )

    def _clear(self) -> None:
        self.size = 0
        self.messages = 0
        self._pieces: list[bytes] = []
        self._indexes: dict[int, bytearray] = {}
        self._start_time = 0
        self._end_time = 0

    def _format_indexes(self, place: int) -> tuple[bytes, bytes]:
        """Return the message indexes that begin at a place, and where each channel's does."""
        indexes, table = bytearray(), bytearray()
        for channel, entries in self._indexes.items():
            table += INDEX_ENTRY.pack(channel, place + len(indexes))
            length = _INDEX_RECORD_HEAD.size - FRAME_HEAD.size + len(entries)
            indexes += _INDEX_RECORD_HEAD.pack(Opcode.MESSAGE_INDEX, length, channel, len(entries))
            indexes += entries
        return bytes(indexes), bytes(table)


def _find_compressor(name: str) -> Callable[[bytes], bytes] | None:
    if name == "none":
        return None
    if name == "lz4":
        from lz4 import frame

        return lambda data: bytes(frame.compress(data, compression_level=LZ4_LEVEL))
    if name == "zstd":
        from zstandard import ZstdCompressor

        return ZstdCompressor(level=ZSTD_LEVEL).compress
    raise ParameterError(f"compression is {name!r}: it must be one of {', '.join(COMPRESSIONS)}")
