"""Records of the MCAP container format as bytes: what a writer puts into a file."""

import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass

from impact_rig.recording.mcap_format import (
    CHUNK_HEAD,
    MAGIC,
    RECORD_HEAD,
    U16,
    U32,
    U64,
    Opcode,
)


@dataclass(frozen=True)
class ChunkSummary:
    """Where a finished chunk lies, for the index at the end of the file.

    Attributes
    ----------
    start, length : int
        Of the chunk record [byte].
    index_offsets : dict
        Position of each channel's message index [byte].
    index_length : int
        Of all message indexes together [byte].
    first_time, last_time : int
        Log times, nanoseconds since the epoch.
    compression : str
        "zstd", "lz4" or empty.
    compressed_size, size : int
        [byte]
    counts : dict
        Messages by channel.
    """

    start: int
    length: int
    index_offsets: dict[int, int]
    index_length: int
    first_time: int
    last_time: int
    compression: str
    compressed_size: int
    size: int
    counts: dict[int, int]


def pack_record(opcode: Opcode, content: bytes) -> bytes:
    """Return a whole record."""
    return RECORD_HEAD.pack(opcode, len(content)) + content


def pack_header(profile: str, library: str) -> bytes:
    """Return the record that opens a file."""
    return pack_record(Opcode.HEADER, _pack_text(profile) + _pack_text(library))


def pack_schema(number: int, name: str, encoding: str, text: str) -> bytes:
    """Return the record of a message type."""
    content = U16.pack(number) + _pack_text(name) + _pack_text(encoding) + _pack_text(text)
    return pack_record(Opcode.SCHEMA, content)


def pack_channel(
    number: int, schema: int, topic: str, encoding: str, metadata: Mapping[str, str]
) -> bytes:
    """Return the record of a topic."""
    pairs = b"".join(_pack_text(key) + _pack_text(value) for key, value in metadata.items())
    content = U16.pack(number) + U16.pack(schema) + _pack_text(topic) + _pack_text(encoding)
    return pack_record(Opcode.CHANNEL, content + U32.pack(len(pairs)) + pairs)


def pack_chunk(
    records: bytes | bytearray, compression: str, packed: bytes, first_time: int, last_time: int
) -> bytes:
    """Return a chunk: many records as one, compressed or not."""
    head = CHUNK_HEAD.pack(first_time, last_time, len(records), zlib.crc32(records))
    content = b"".join((head, _pack_text(compression), U64.pack(len(packed)), packed))
    return pack_record(Opcode.CHUNK, content)


def pack_message_index(channel: int, entries: list[int]) -> bytes:
    """Return the index of one channel in one chunk: log time and offset of each message."""
    content = U16.pack(channel) + U32.pack(8 * len(entries))
    return pack_record(Opcode.MESSAGE_INDEX, content + struct.pack(f"<{len(entries)}Q", *entries))


def pack_ending(
    position: int, schemas: list[bytes], channels: list[bytes], chunks: list[ChunkSummary]
) -> bytes:
    """Return all that follows the last chunk: end of data, summary, footer and magic.

    Parameters
    ----------
    position : int
        Where it will stand in the file [byte].
    schemas, channels : list of bytes
        Their records, repeated here for readers that seek.
    chunks : list of ChunkSummary
        In file order.
    """
    ending = bytearray(pack_record(Opcode.DATA_END, U32.pack(0)))
    summary_start = position + len(ending)
    offsets = bytearray()
    for opcode, group in (
        (Opcode.SCHEMA, schemas),
        (Opcode.CHANNEL, channels),
        (Opcode.STATISTICS, [_pack_statistics(len(schemas), len(channels), chunks)]),
        (Opcode.CHUNK_INDEX, [_pack_chunk_index(chunk) for chunk in chunks]),
    ):
        length = sum(map(len, group))
        if length:
            place = struct.pack("<BQQ", opcode, position + len(ending), length)
            offsets += pack_record(Opcode.SUMMARY_OFFSET, place)
            ending += b"".join(group)
    offsets_start = position + len(ending)
    ending += offsets
    footer = RECORD_HEAD.pack(Opcode.FOOTER, 20) + struct.pack("<QQ", summary_start, offsets_start)
    checked = ending[summary_start - position :] + footer
    return bytes(ending) + footer + U32.pack(zlib.crc32(checked)) + MAGIC


def _pack_statistics(schemas: int, channels: int, chunks: list[ChunkSummary]) -> bytes:
    counts: dict[int, int] = {}
    for chunk in chunks:
        for channel, count in chunk.counts.items():
            counts[channel] = counts.get(channel, 0) + count
    content = struct.pack(
        "<QHIIIIQQI",
        sum(counts.values()),
        schemas,
        channels,
        0,
        0,
        len(chunks),
        min((chunk.first_time for chunk in chunks), default=0),
        max((chunk.last_time for chunk in chunks), default=0),
        10 * len(counts),
    )
    content += b"".join(struct.pack("<HQ", *item) for item in counts.items())
    return pack_record(Opcode.STATISTICS, content)


def _pack_chunk_index(chunk: ChunkSummary) -> bytes:
    content = struct.pack(
        "<QQQQI",
        chunk.first_time,
        chunk.last_time,
        chunk.start,
        chunk.length,
        10 * len(chunk.index_offsets),
    )
    content += b"".join(struct.pack("<HQ", *item) for item in chunk.index_offsets.items())
    content += U64.pack(chunk.index_length) + _pack_text(chunk.compression)
    content += struct.pack("<QQ", chunk.compressed_size, chunk.size)
    return pack_record(Opcode.CHUNK_INDEX, content)


def _pack_text(text: str) -> bytes:
    data = text.encode()
    return U32.pack(len(data)) + data
