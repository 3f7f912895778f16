"""What the end of an MCAP file says of the rest: topics, counts, places. And where bytes lie."""

import os
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    Channel,
    Footer,
    Header,
    Metadata,
    Schema,
    Statistics,
)

from impact_rig.core.errors import FileError
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
from impact_rig.recording.reading.mcap_summary import FOOTER_SIZE

_KINDS: dict[int, Any] = {
    Opcode.HEADER: Header,
    Opcode.FOOTER: Footer,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.ATTACHMENT: Attachment,
    Opcode.STATISTICS: Statistics,
    Opcode.METADATA: Metadata,
}
"""Records that are small and read as a whole."""
_WINDOW = 1 << 20
"""What is read at once where small pieces are wanted [byte], our choice."""


class FileBytes:
    """The bytes of a file, read where they are wanted.

    Raises
    ------
    FileError
        If there is no such file or it cannot be read, also later on.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._file = path.open("rb", buffering=0)
            self.size = os.fstat(self._file.fileno()).st_size
        except FileNotFoundError:
            raise FileError(f"there is no file {path}") from None
        except OSError as error:
            raise FileError(f"{path} cannot be read: {error.strerror}") from None
        self._window_start, self._window = 0, b""

    def read(self, place: int, size: int) -> bytes:
        """Return up to `size` bytes from `place` on, fewer at the end of the file."""
        if size > _WINDOW // 2:
            return self._read(place, size)
        start = place - self._window_start
        if start < 0 or start + size > len(self._window):
            self._window_start, start = place, 0
            self._window = self._read(place, _WINDOW)
        return self._window[start : start + size]

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()

    def _read(self, place: int, size: int) -> bytes:
        try:
            return os.pread(self._file.fileno(), size, place)
        except OSError as error:
            raise FileError(
                f"{self.path} cannot be read at byte {place}: {error.strerror}"
            ) from None


@dataclass(frozen=True)
class FileIndex:
    """What the end of a file says of the rest.

    Attributes
    ----------
    start : int
        Where it begins [byte].
    is_sound : bool
        Whether its checksum vouches for it.
    schemas : dict
        By number.
    channels : dict
        By number.
    chunks : frozenset of int
        Where chunks begin [byte].
    statistics : Statistics, optional
        Counts.
    """

    start: int
    is_sound: bool
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: frozenset[int] = frozenset()
    statistics: Statistics | None = None


def read_record(kind: int, content: bytes) -> Any:
    """Return a small record; None: its bytes are not those of one."""
    record_class = _KINDS.get(kind)
    return None if record_class is None else read_small(record_class, content)


def read_index(file: FileBytes) -> FileIndex | None:
    """Return what the end of a file says of the rest; None: it has no such end."""
    tail_start = file.size - len(MAGIC) - FOOTER_SIZE
    tail = file.read(tail_start, FOOTER_SIZE + len(MAGIC)) if tail_start > len(MAGIC) else b""
    if not tail.endswith(MAGIC) or tail[: FRAME_HEAD.size] != FRAME_HEAD.pack(Opcode.FOOTER, 20):
        return None
    footer = read_record(Opcode.FOOTER, tail[FRAME_HEAD.size : FOOTER_SIZE])
    if not isinstance(footer, Footer):
        return None
    start = footer.summary_start
    if not len(MAGIC) < start < tail_start or tail_start - start > MAX_SIZE:
        return None
    summary = file.read(start, tail_start - start)
    checked = summary + tail[: FOOTER_SIZE - CHECKSUM_SIZE]
    is_sound = footer.summary_crc in (0, zlib.crc32(checked))
    records = list(_read_records(summary))
    return FileIndex(
        start=start,
        is_sound=is_sound and all(records),
        schemas={item.id: item for item in records if isinstance(item, Schema)},
        channels={item.id: item for item in records if isinstance(item, Channel)},
        chunks=frozenset(item.start for item in records if isinstance(item, ChunkPlace)),
        statistics=next((item for item in records if isinstance(item, Statistics)), None),
    )


def _read_records(summary: bytes) -> Iterator[Any]:
    """Yield the records that matter; None for one that is damaged."""
    try:
        for kind, start, end in find_records(summary):
            if kind == Opcode.CHUNK_INDEX:
                yield read_chunk_place(summary[start:end])
            elif kind in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS):
                yield read_record(kind, summary[start:end])
    except DamageError:
        yield None
