"""The content of an MCAP record: parsed by the library `mcap`, checked, and bounded in size."""

import io
import struct
import zlib
from typing import Any, BinaryIO

import lz4.frame
import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.stream_reader import StreamReader

MAX_SIZE = 1 << 27
"""Largest record that is taken into memory [byte], our choice: a hundred chunks of our recorder.
Its messages and their decoded numbers take as much memory once more."""
MAX_RATIO = 1000
"""Unpacked size over the size of the file [-], our choice: ten times that of constant signals."""
FREE_SIZE = 1 << 22
"""Unpacked size that any file may have [byte], our choice: four chunks of our recorder."""
MESSAGE_BYTES = 4
"""Least part of a file for each record in its chunks [byte], our choice: the times of messages
alone take more, however well they are compressed, and an index 16."""
FREE_RECORDS = 10_000
"""Records that the chunks of any file may hold [-], our choice."""
FRAME = struct.Struct("<BQ")
"""Kind and length of a record."""
MESSAGE = struct.Struct("<HIQQ")
"""Channel, sequence, log time and publish time of a message."""
PARSE_ERRORS = (McapError, struct.error, ValueError, OverflowError, MemoryError)
"""Errors of the library on bytes that make no sense."""
_ENGINE_ERRORS = (zstandard.ZstdError, RuntimeError, OverflowError, MemoryError)
_WORDS = {
    Opcode.HEADER: "the header",
    Opcode.SCHEMA: "the description of a type",
    Opcode.CHANNEL: "the description of a topic",
    Opcode.CHUNK: "the head of a chunk",
    Opcode.ATTACHMENT: "an attachment",
    Opcode.METADATA: "a metadata record",
}


class DamageError(ValueError):
    """Damaged bytes; the message says which, and what is wrong with them."""


def read_bytes(file: BinaryIO, start: int, end: int) -> bytes:
    """Return the bytes of a file from one place to before another; raises `DamageError`."""
    if end - start > MAX_SIZE:
        raise DamageError(f"a record at byte {start} claims to have {end - start} byte")
    file.seek(start)
    data = file.read(end - start)
    if len(data) < end - start:
        raise DamageError(f"the file ends within the record at byte {start}")
    return data


def read_frame(file: BinaryIO, place: int, end: int) -> tuple[int, int]:
    """Return kind and end of what may be a record; of bytes behind the file's end, zeros."""
    head = read_bytes(file, place, min(place + FRAME.size, end)) if place < end else b""
    kind, length = FRAME.unpack(head.ljust(FRAME.size, b"\0"))
    return kind, place + FRAME.size + length


def read_head(file: BinaryIO, place: int, end: int) -> tuple[int, int]:
    """Return kind and end of the record at a place of a file; raises `DamageError`."""
    kind, after = read_frame(file, place, end)
    # Private records, whose kinds begin at 0x80, are passed over.
    if not Opcode.HEADER <= kind <= Opcode.DATA_END and kind < 0x80:  # noqa: PLR2004
        raise DamageError(f"at byte {place} there is no record")
    if after > end:
        raise DamageError(f"the record at byte {place} is longer than the file")
    return kind, after


def read_record(content: bytes, place: int) -> Any:
    """Return the record that bytes are, as the library reads it: one of `_WORDS`.

    The record written again must be the bytes that were read: a length that points anywhere else
    is found out. An attachment's checksum is checked on the way.

    Raises
    ------
    DamageError
        If the bytes are not those of one.
    """
    try:
        reader = StreamReader(io.BytesIO(content), skip_magic=True, emit_chunks=True)
        record = next(iter(reader.records))
        builder = RecordBuilder()
        record.write(builder)
        written = builder.end()[FRAME.size :]
    except PARSE_ERRORS:
        written = None
    if written and content[0] == Opcode.ATTACHMENT and content.endswith(bytes(4)):
        written = written[:-4]  # it was written without a checksum
    # Later versions of the format may add fields at the end of a record.
    if written is None or not content.startswith(written, FRAME.size):
        words = _WORDS[Opcode(content[0])]
        raise DamageError(f"{words} is damaged: the record at byte {place}")
    return record


def read_inner_head(content: bytes, place: int) -> tuple[int, int, int]:
    """Return kind, start and end of the content of the record at a place in a chunk."""
    if place + FRAME.size > len(content):
        raise DamageError("a record has no whole head")
    kind, length = FRAME.unpack_from(content, place)
    start = place + FRAME.size
    if start + length > len(content):
        raise DamageError("a record is longer than what it is in")
    if kind == Opcode.MESSAGE and length < MESSAGE.size:
        raise DamageError("a message is shorter than its head")
    return kind, start, start + length


class Unpacker:
    """Unpacks the chunks of one file, which may hold `MAX_RATIO` times its size [byte]."""

    def __init__(self, file_size: int) -> None:
        self._room = max(MAX_RATIO * file_size, FREE_SIZE)
        self._records = file_size // MESSAGE_BYTES + FREE_RECORDS

    def unpack(self, chunk: records.Chunk) -> bytes:
        """Return the records of a chunk; raises `DamageError`."""
        size = chunk.uncompressed_size
        if size > min(MAX_SIZE, self._room):
            raise DamageError(
                f"a chunk of {len(chunk.data)} byte claims to hold {size}: a file must not hold"
                f" more than {MAX_RATIO} times its size"
            )
        self._room -= size
        content = _decompress(chunk)
        if len(content) != size:
            raise DamageError(f"a chunk holds {len(content)} byte: it should hold {size}")
        if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
            raise DamageError("a chunk does not fit its checksum")
        return content

    def count_records(self, count: int) -> None:
        """Count records that were found in chunks; raises `DamageError` if they are too many."""
        self._records -= count
        if self._records < 0:
            raise DamageError(
                f"its chunks hold more than a message for every {MESSAGE_BYTES} byte of the file"
            )


def _decompress(chunk: records.Chunk) -> bytes:
    """Return the content of a chunk; it takes no more memory than the chunk states."""
    data, size = chunk.data, chunk.uncompressed_size
    try:
        if chunk.compression == "zstd":
            if zstandard.frame_content_size(data) not in (-1, size):
                raise DamageError(f"a chunk should hold {size} byte: its data state another size")
            return zstandard.ZstdDecompressor().decompress(data, max_output_size=max(size, 1))
        if chunk.compression == "lz4":
            engine = lz4.frame.LZ4FrameDecompressor()
            return bytes(engine.decompress(data, max_length=size + 1))
    except _ENGINE_ERRORS as error:
        reason = str(error) or type(error).__name__
        raise DamageError(f"a chunk cannot be decompressed: {reason}") from None
    if chunk.compression not in ("", "none"):
        raise DamageError(
            f"a chunk is compressed by {chunk.compression[:32]!r}: it must be zstd or lz4"
        )
    return data
