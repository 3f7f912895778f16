"""The layout of an MCAP file's records: the one place that knows which byte means what.

After https://mcap.dev/spec. What is small is read by the library `mcap`; what comes a thousand
times, messages and chunks, is read here.
"""

import io
import struct
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple, TypeVar

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Footer, Header, Metadata, Schema, Statistics

MAGIC = b"\x89MCAP0\r\n"
"""First and last bytes of every file."""
FRAME_HEAD = struct.Struct("<BQ")
"""Kind and length of a record."""
MESSAGE_HEAD = struct.Struct("<HIQQ")
"""Channel, sequence, log time and publish time of a message."""
CHECKSUM_SIZE = 4
"""Of a CRC-32 [byte]."""
MAX_SIZE = 1 << 29
"""Largest record that is taken into memory [byte], our choice: twice the largest chunk of our
recorder; it bounds what a damaged or malicious file can ask for."""
MAX_NAME = 32
"""Longest name of a compression [byte], our choice: zstd and lz4 are the known ones."""

CHUNK_HEAD = struct.Struct("<QQQII")
"""First and last log time, uncompressed size, checksum, length of the compression's name."""
LENGTH = struct.Struct("<Q")
INDEX_HEAD = struct.Struct("<QQQQI")
"""Of a chunk's index: first and last log time, where it begins, its length, length of a table."""
INDEX_ENTRY = struct.Struct("<HQ")
"""Channel and where its message index begins."""
MAX_CHUNK_HEAD = CHUNK_HEAD.size + MAX_NAME + LENGTH.size
"""Longest head of a chunk [byte]."""

Small = Header | Footer | Schema | Channel | Attachment | Metadata | Statistics
"""Records that are read as a whole, by the library."""
SmallT = TypeVar("SmallT", bound=Small)


class DamageError(ValueError):
    """Bytes that are not what they should be; the message says what is wrong with what."""


class Frame(NamedTuple):
    """Where a record lies.

    Attributes
    ----------
    kind : int
        Its opcode.
    start, end : int
        Of its content [byte].
    """

    kind: int
    start: int
    end: int


class ChunkHead(NamedTuple):
    """What stands before a chunk's data.

    Attributes
    ----------
    uncompressed_size : int
        As stated [byte].
    checksum : int
        CRC-32 of the uncompressed data; 0: none.
    compression : str
        As stated, "" for none.
    data_offset : int
        From the start of the chunk's content to its data [byte].
    data_size : int
        As stated [byte].
    """

    uncompressed_size: int
    checksum: int
    compression: str
    data_offset: int
    data_size: int


class ChunkPlace(NamedTuple):
    """What the index at the end of a file says of one chunk.

    Attributes
    ----------
    start, end : int
        Where it begins, and where its message indexes end [byte].
    start_time, end_time : int
        Log times of its first and last message, nanoseconds since the epoch.
    channels : frozenset of int
        Whose messages are in it; empty: not known.
    """

    start: int
    end: int
    start_time: int
    end_time: int
    channels: frozenset[int]


def read_bytes(file: BinaryIO, start: int, end: int) -> bytes:
    """Return a stretch of a file.

    Raises
    ------
    DamageError
        If it is larger than is taken into memory, or the file ends before it.
    """
    if end - start > MAX_SIZE:
        raise DamageError(f"a record at byte {start} claims to have {end - start} byte")
    file.seek(start)
    data = file.read(end - start)
    if len(data) < end - start:
        raise DamageError(f"the file ends within the record at byte {start}")
    return data


def read_chunk_head(content: bytes) -> ChunkHead | None:
    """Return what stands before a chunk's data; None: this cannot be one.

    Parameters
    ----------
    content : bytes
        The beginning of the chunk's content; `MAX_CHUNK_HEAD` bytes of it suffice.
    """
    if len(content) < CHUNK_HEAD.size:
        return None
    _, _, size, checksum, length = CHUNK_HEAD.unpack_from(content)
    end = CHUNK_HEAD.size + length
    if length > MAX_NAME or len(content) < end + LENGTH.size:
        return None
    name = content[CHUNK_HEAD.size : end].decode("ascii", "replace")
    return ChunkHead(size, checksum, name, end + LENGTH.size, *LENGTH.unpack_from(content, end))


def read_chunk_place(content: bytes) -> ChunkPlace | None:
    """Return what a chunk's index record says; None: it is damaged."""
    if len(content) < INDEX_HEAD.size:
        return None
    start_time, end_time, start, length, table = INDEX_HEAD.unpack_from(content)
    table_end = INDEX_HEAD.size + table
    if table % INDEX_ENTRY.size or len(content) < table_end + LENGTH.size:
        return None
    entries = INDEX_ENTRY.iter_unpack(content[INDEX_HEAD.size : table_end])
    end = start + length + LENGTH.unpack_from(content, table_end)[0]
    return ChunkPlace(start, end, start_time, end_time, frozenset(entry[0] for entry in entries))


def read_small(record_class: type[SmallT], content: bytes) -> SmallT | None:
    """Return a small record; None: its bytes are not those of one.

    The record written again must be the bytes that were read: a length that points anywhere else
    is found out. An attachment's checksum is checked on the way.
    """
    try:
        record = record_class.read(ReadDataStream(io.BytesIO(content)))
        builder = RecordBuilder()
        record.write(builder)
    except (McapError, struct.error, ValueError, OverflowError, MemoryError):
        return None
    written = builder.end()[FRAME_HEAD.size :]
    if record_class is Attachment and content.endswith(bytes(CHECKSUM_SIZE)):
        written = written[:-CHECKSUM_SIZE]
    # Later versions of the format may add fields at the end of a record.
    return record if content.startswith(written) else None


def find_records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield kind, start and end of the content of each record in a chunk or in a file's index.

    Raises
    ------
    DamageError
        Where they do not follow each other to the end.
    """
    place, size = 0, len(data)
    head_size, unpack = FRAME_HEAD.size, FRAME_HEAD.unpack_from
    while place < size:
        if place + head_size > size:
            raise DamageError("a record has no whole head")
        kind, length = unpack(data, place)
        start = place + head_size
        place = start + length
        if place > size:
            raise DamageError("a record is longer than what it is in")
        if not kind:
            raise DamageError("a record is of no kind")
        if kind == Opcode.MESSAGE and length < MESSAGE_HEAD.size:
            raise DamageError("a message is shorter than its head")
        yield kind, start, place
