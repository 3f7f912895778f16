"""What can still be read of a chunk whose bytes may be damaged."""

import contextlib
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import lz4.frame
import zstandard
from mcap.opcode import Opcode

from impact_rig.recording.reading.mcap_chunk import FREE_SIZE, MAX_RATIO, decompress
from impact_rig.recording.reading.mcap_records import (
    MAX_SIZE,
    ChunkHead,
    DamageError,
    find_records,
)

COMPRESSIONS = ("", "zstd", "lz4")
"""Names of the compressions that exist."""
SMALL_STEP = 4096
"""What is decompressed at once where it may break at any place [byte], our choice."""
_MAGICS = {b"\x28\xb5\x2f\xfd": "zstd", b"\x04\x22\x4d\x18": "lz4"}
"""How compressed data begin."""
_ENGINE_ERRORS = (zstandard.ZstdError, RuntimeError, ValueError, MemoryError)
"""What the compressors raise on bytes that make no sense."""


class _Stream(Protocol):
    """Decompresses step by step."""

    def read(self, size: int) -> bytes: ...


@dataclass(frozen=True)
class SalvagedChunk:
    """What is left of a chunk.

    Attributes
    ----------
    data : bytes
        Uncompressed, up to where it breaks.
    is_vouched : bool
        Whether the data are what was written: the checksum fits, or there is none and nothing
        else speaks against them.
    reason : str
        What is wrong with it; empty: nothing.
    """

    data: bytes
    is_vouched: bool
    reason: str = ""


def salvage_chunk(head: ChunkHead, data: bytes, *, is_whole: bool) -> SalvagedChunk:
    """Decompress a chunk as far as it goes and hold it against its checksum.

    Parameters
    ----------
    head : ChunkHead
        As found.
    data : bytes
        Compressed, as far as the file has them.
    is_whole : bool
        Whether the file has all of them.
    """
    content, is_complete = _decompress(head, data)
    if not is_whole:
        return SalvagedChunk(content, False, "a chunk is cut off")
    if len(content) > find_limit(len(data)):
        return SalvagedChunk(b"", False, "a chunk is larger than can be meant")
    if not is_complete:
        return SalvagedChunk(content, False, "a chunk cannot be decompressed")
    return _check_content(
        head, content, is_named=_find_compression(head, data) == head.compression
    )


def _check_content(head: ChunkHead, content: bytes, *, is_named: bool) -> SalvagedChunk:
    is_size_right = len(content) == head.uncompressed_size
    if head.checksum and zlib.crc32(content) != head.checksum:
        return SalvagedChunk(content, False, "a chunk does not fit its checksum")
    if not head.checksum and not is_size_right:
        return SalvagedChunk(content, False, "a chunk has another size than it states")
    is_head_right = is_named and is_size_right
    return SalvagedChunk(content, True, "" if is_head_right else "the head of a chunk is wrong")


def find_limit(size: int) -> int:
    """Return the largest content of compressed data of a size that is believed [byte]."""
    return min(MAX_SIZE, max(FREE_SIZE, MAX_RATIO * size))


def find_whole_records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield kind, start and end of the content of each record, up to where a chunk breaks."""
    with contextlib.suppress(DamageError):
        for kind, start, end in find_records(data):
            if kind not in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
                return
            yield kind, start, end


def _decompress(head: ChunkHead, data: bytes) -> tuple[bytes, bool]:
    """Return what can be decompressed, a little over the limit at most, and whether it is all."""
    compression = _find_compression(head, data)
    if not compression:
        return data, True
    limit = find_limit(len(data))
    if head.uncompressed_size <= limit:
        with contextlib.suppress(DamageError):
            return decompress(compression, data, head.uncompressed_size), True
    stream: _Stream = (
        zstandard.ZstdDecompressor().stream_reader(data)
        if compression == "zstd"
        else _Lz4Stream(data)
    )
    content = bytearray()
    try:
        while len(content) <= limit and (piece := stream.read(SMALL_STEP)):
            content += piece
    except _ENGINE_ERRORS:
        return bytes(content), False
    # A frame that is cut off ends without an error: its checksum, or its size, tells.
    return bytes(content), True


def _find_compression(head: ChunkHead, data: bytes) -> str:
    """Return the stated compression; where it is none that exists, what the data look like."""
    if head.compression in COMPRESSIONS:
        return head.compression
    return _MAGICS.get(data[:4], "")


class _Lz4Stream:
    """Decompresses LZ4 in small steps."""

    def __init__(self, data: bytes) -> None:
        self._engine = lz4.frame.LZ4FrameDecompressor()
        self._data = data
        self._place = 0

    def read(self, size: int) -> bytes:
        """Return up to `size` further bytes; none: it ends here."""
        while not self._engine.eof:
            piece = b""
            if self._engine.needs_input:
                piece = self._data[self._place : self._place + size]
                if not piece:
                    return b""
                self._place += len(piece)
            content: bytes = self._engine.decompress(piece, max_length=size)
            if content:
                return content
        return b""
