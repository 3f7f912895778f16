"""Records of the MCAP container format from bytes: what a reader finds in a file."""

import struct
import zlib
from collections.abc import Mapping
from typing import Any

from impact_rig.core.errors import FileError
from impact_rig.recording.mcap_format import CHUNK_HEAD, U16, U32, U64, Channel

LARGEST_CHUNK = 1 << 30
"""Largest chunk that is unpacked [byte], our choice: a thousand times what anybody writes, and
what a damaged length can make us allocate."""


class ContentReader:
    """Takes a record's content apart, front to back.

    Parameters
    ----------
    content : bytes
        Of one record. `struct.error`, `UnicodeDecodeError` or `FileError` tell that it does not
        hold what is asked for.
    """

    def __init__(self, content: bytes) -> None:
        self._content = content
        self._position = 0

    def take(self, layout: struct.Struct) -> tuple[Any, ...]:
        """Return the next numbers."""
        values = layout.unpack_from(self._content, self._position)
        self._position += layout.size
        return values

    def take_bytes(self, length: int) -> bytes:
        """Return the next bytes."""
        stop = self._position + length
        if stop > len(self._content):
            raise FileError(f"a record ends {stop - len(self._content)} bytes too early")
        data = self._content[self._position : stop]
        self._position = stop
        return data

    def take_text(self) -> str:
        """Return the next string."""
        return self.take_bytes(self.take(U32)[0]).decode()

    def take_map(self) -> dict[str, str]:
        """Return the next map of strings."""
        inner = ContentReader(self.take_bytes(self.take(U32)[0]))
        pairs = {}
        while inner._position < len(inner._content):
            key = inner.take_text()
            pairs[key] = inner.take_text()
        return pairs


def unpack_schema(content: bytes) -> tuple[int, str, str, str]:
    """Return number, name, encoding and text of a schema."""
    reader = ContentReader(content)
    number = reader.take(U16)[0]
    return number, reader.take_text(), reader.take_text(), reader.take_text()


def unpack_channel(content: bytes, schemas: Mapping[int, tuple[str, str, str]]) -> Channel:
    """Return a channel; `schemas` gives name, encoding and text of the announced schemas."""
    reader = ContentReader(content)
    number, schema = reader.take(U16)[0], reader.take(U16)[0]
    topic, encoding = reader.take_text(), reader.take_text()
    definition = schemas.get(schema, ("", "", ""))
    return Channel(number, topic, *definition, encoding, reader.take_map())


def unpack_chunk(content: bytes) -> bytes:
    """Return the records of a chunk, its checksum verified.

    Raises
    ------
    FileError
        If it is damaged, too large, or compressed in a way unknown here.
    """
    reader = ContentReader(content)
    _, _, size, checksum = reader.take(CHUNK_HEAD)
    compression = reader.take_text()
    packed = reader.take_bytes(reader.take(U64)[0])
    if size > LARGEST_CHUNK:
        raise FileError(f"a chunk claims {size} bytes: {LARGEST_CHUNK} is the most that is read")
    records = _decompress(packed, compression, size)
    if len(records) != size or (checksum and zlib.crc32(records) != checksum):
        raise FileError("a chunk does not match its checksum: the file is damaged")
    return records


def _decompress(packed: bytes, compression: str, size: int) -> bytes:
    if compression == "":
        return packed
    if compression == "zstd":
        import zstandard

        try:
            if zstandard.frame_content_size(packed) not in (size, -1):
                return b""
            return zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
        except zstandard.ZstdError:
            return b""
    if compression == "lz4":
        import lz4.frame

        try:
            if lz4.frame.get_frame_info(packed)["content_size"] == size:
                return bytes(lz4.frame.decompress(packed))
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size))
        except (RuntimeError, EOFError):
            return b""
    raise FileError(f"a chunk is compressed by {compression!r}: zstd, lz4 or none can be read")
