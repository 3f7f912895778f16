"""What the end of an MCAP file says of the rest: topics, and where the chunks are."""

import zlib
from dataclasses import dataclass
from typing import BinaryIO, TypeVar

from mcap.opcode import Opcode
from mcap.records import Channel, Footer, Schema

from impact_rig.recording.reading.mcap_records import (
    CHECKSUM_SIZE,
    FRAME_HEAD,
    MAGIC,
    MAX_SIZE,
    ChunkPlace,
    DamageError,
    find_records,
    read_chunk_place,
    read_small,
)

_T = TypeVar("_T")

FOOTER_SIZE = FRAME_HEAD.size + 20
"""Of the last record [byte]."""


@dataclass(frozen=True)
class Summary:
    """The index at the end of a file.

    Attributes
    ----------
    schemas, channels : dict
        By number.
    chunks : dict
        By where they begin [byte]; empty if no checksum vouches for the index.
    """

    schemas: dict[int, Schema]
    channels: dict[int, Channel]
    chunks: dict[int, ChunkPlace]


def read_summary(file: BinaryIO, size: int) -> Summary | None:
    """Return the index at the end of a file; None: there is none that can be trusted.

    Parameters
    ----------
    file : file
        Opened for reading.
    size : int
        Of the file [byte].
    """
    footer_start = size - len(MAGIC) - FOOTER_SIZE
    if footer_start <= len(MAGIC):
        return None
    file.seek(footer_start)
    tail = file.read(FOOTER_SIZE)
    footer = read_small(Footer, tail[FRAME_HEAD.size :])
    if footer is None or tail[0] != Opcode.FOOTER:
        return None
    start = footer.summary_start
    if not len(MAGIC) < start < footer_start or footer_start - start > MAX_SIZE:
        return None
    file.seek(start)
    section = file.read(footer_start - start)
    checksum = zlib.crc32(tail[:-CHECKSUM_SIZE], zlib.crc32(section))
    if footer.summary_crc not in (0, checksum):
        return None
    try:
        return _read_section(section, start, is_vouched=footer.summary_crc != 0)
    except DamageError:
        return None


def _read_section(section: bytes, end: int, *, is_vouched: bool) -> Summary:
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    chunks: dict[int, ChunkPlace] = {}
    for kind, start, stop in find_records(section):
        content = section[start:stop]
        if kind == Opcode.SCHEMA:
            schema = _require(read_small(Schema, content))
            schemas[schema.id] = schema
        elif kind == Opcode.CHANNEL:
            channel = _require(read_small(Channel, content))
            channels[channel.id] = channel
        elif kind == Opcode.CHUNK_INDEX and is_vouched:
            chunk = _require(read_chunk_place(content))
            if not chunk.start < chunk.end <= end:
                raise DamageError("the index names a chunk that cannot be there")
            chunks[chunk.start] = chunk
    # What is in a chunk is of no use where its topics would have to be looked up in it.
    is_usable = all(chunk.channels <= channels.keys() for chunk in chunks.values())
    return Summary(schemas, channels, chunks if is_usable else {})


def _require(record: _T | None) -> _T:
    if record is None:
        raise DamageError("a record of the index is damaged")
    return record
