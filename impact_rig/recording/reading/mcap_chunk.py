"""Decompresses a chunk, within limits that a malicious file cannot move, and checks it."""

import zlib
from typing import BinaryIO

import lz4.frame
import zstandard

from impact_rig.recording.reading.mcap_records import (
    MAX_CHUNK_HEAD,
    MAX_SIZE,
    DamageError,
    Frame,
    read_bytes,
    read_chunk_head,
)

FREE_SIZE = 1 << 26
"""A chunk up to this size may be compressed to any extent [byte], our choice."""
MAX_RATIO = 1000
"""Of a larger chunk's size to that of its compressed data [-], our choice: ten times what
constant signals reach in practice; what claims more is a trap for the memory."""


def read_chunk(file: BinaryIO, frame: Frame) -> bytes:
    """Return the records of a chunk.

    Parameters
    ----------
    file : file
        Opened for reading.
    frame : Frame
        Where the chunk lies in it.

    Raises
    ------
    DamageError
        If it does not fit its checksum, cannot be decompressed, or is larger than is taken into
        memory.
    """
    head = read_chunk_head(
        read_bytes(file, frame.start, min(frame.start + MAX_CHUNK_HEAD, frame.end))
    )
    if head is None or head.data_offset + head.data_size != frame.end - frame.start:
        raise DamageError("the head of a chunk makes no sense")
    if head.uncompressed_size > min(MAX_SIZE, max(FREE_SIZE, MAX_RATIO * head.data_size)):
        raise DamageError(
            f"a chunk of {head.data_size} byte claims to hold {head.uncompressed_size}"
        )
    data = read_bytes(file, frame.start + head.data_offset, frame.end)
    content = decompress(head.compression, data, head.uncompressed_size)
    if head.checksum and zlib.crc32(content) != head.checksum:
        raise DamageError("a chunk does not fit its checksum")
    return content


def decompress(compression: str, data: bytes, size: int) -> bytes:
    """Return the content of compressed data.

    Parameters
    ----------
    compression : str
        "zstd", "lz4" or "".
    data : bytes
        One frame.
    size : int
        Of the content [byte]; no more is taken into memory.

    Raises
    ------
    DamageError
        If it cannot be decompressed, or has another size.
    """
    try:
        if compression == "zstd":
            content = _decompress_zstd(data, size)
        elif compression == "lz4":
            engine = lz4.frame.LZ4FrameDecompressor()
            content = engine.decompress(data, max_length=size + 1)
            if not engine.eof:
                raise DamageError("a chunk cannot be decompressed: its end is missing")
        elif compression in ("", "none"):
            content = data
        else:
            raise DamageError(f"a chunk is compressed by {compression!r}: it must be zstd or lz4")
    except (zstandard.ZstdError, RuntimeError, OverflowError, MemoryError) as error:
        reason = str(error) or type(error).__name__
        raise DamageError(f"a chunk cannot be decompressed: {reason}") from None
    if len(content) != size:
        raise DamageError(f"a chunk holds {len(content)} byte: it should hold {size}")
    return content


def _decompress_zstd(data: bytes, size: int) -> bytes:
    stated = zstandard.frame_content_size(data)
    if stated not in (-1, size):
        raise DamageError(f"a chunk holds {stated} byte: it should hold {size}")
    return zstandard.ZstdDecompressor().decompress(data, max_output_size=max(size, 1))
