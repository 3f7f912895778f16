"""Tells where a record begins, and finds the next one where they no longer follow each other."""

import re
from bisect import bisect_left
from collections.abc import Collection, Iterator
from heapq import merge

from mcap.opcode import Opcode

from impact_rig.recording.reading.mcap_records import (
    FRAME_HEAD,
    MAX_CHUNK_HEAD,
    MAX_SIZE,
    MESSAGE_HEAD,
    ChunkHead,
    read_chunk_head,
)
from impact_rig.recording.recovery.chunk_salvage import COMPRESSIONS
from impact_rig.recording.recovery.file_index import FileBytes, FileIndex, read_record
from impact_rig.recording.recovery.message_index import read_message_index

_WINDOW = 1 << 20
"""Where the next record is searched at once [byte], our choice."""
_CANDIDATE = re.compile(rb"(?s)(?=[\x03-\x0f].{5}\x00{3})")
"""How a record begins: its kind, and a length below a terabyte."""
PRIVATE = 0x80
"""First of the kinds that anybody may use: they are passed over."""
DATA_END_SIZE = 4
"""Of the content of the record that ends the data [byte]."""
_EFFORT = 4
"""How often the bytes of a file may be looked at in vain [-], our choice: it bounds the time that
a malicious file can ask for."""


class RecordSearch:
    """Finds records in a file.

    Parameters
    ----------
    file : FileBytes
        Where.
    index : FileIndex, optional
        What the end of the file says of it.

    Attributes
    ----------
    end : int
        Where the data end [byte], as far as that is known beforehand.
    """

    def __init__(self, file: FileBytes, index: FileIndex | None) -> None:
        self._file = file
        self._chunks = index.chunks if index is not None and index.is_sound else frozenset()
        self._starts = sorted(self._chunks)
        self._window_start, self._window = 0, b""
        self._effort = _EFFORT * file.size
        self.end = index.start if index is not None and index.is_sound else file.size

    def read_frame(self, place: int) -> tuple[int, int] | None:
        """Return kind and end of the record at a place; None: there is none that is whole.

        Only a chunk may end beyond the data: it was cut off.
        """
        head = self._file.read(place, FRAME_HEAD.size)
        if len(head) < FRAME_HEAD.size:
            return None
        kind, length = FRAME_HEAD.unpack(head)
        after = place + FRAME_HEAD.size + length
        if place in self._chunks:
            return Opcode.CHUNK, after
        if kind == Opcode.CHUNK:
            return (kind, after) if self.read_chunk_head(place) is not None else None
        is_known = Opcode.HEADER <= kind <= Opcode.DATA_END or kind >= PRIVATE
        return (kind, after) if is_known and after <= self.end else None

    def is_followed(self, place: int) -> bool:
        """Return whether a record, or the end, is where one should end."""
        return place == self.end or (place < self.end and self.read_frame(place) is not None)

    def read_chunk_head(self, place: int) -> ChunkHead | None:
        """Return the head of the chunk that begins at a place; None: none does."""
        return read_chunk_head(self._file.read(place + FRAME_HEAD.size, MAX_CHUNK_HEAD))

    def list_chunk_ends(self, place: int, after: int, head: ChunkHead) -> tuple[int, ...]:
        """Return where a chunk may end: by its record and by its head, once where they agree."""
        by_head = place + FRAME_HEAD.size + head.data_offset + head.data_size
        return tuple(dict.fromkeys((after, by_head)))

    def spend(self, size: int) -> bool:
        """Note that bytes were looked at in vain; return whether more may be."""
        self._effort -= size
        return self._effort > 0

    def find_next(self, place: int, channels: Collection[int] | None) -> int:
        """Return where the next record begins that can be told from chance, or the end.

        Parameters
        ----------
        place : int
            Where to begin.
        channels : collection of int, optional
            Whose messages are records of their own; None: all are in chunks.
        """
        for candidate in self._find_candidates(place):
            if candidate in self._chunks or self._is_record(candidate, channels):
                return candidate
        return self.end

    def _find_candidates(self, place: int) -> Iterator[int]:
        starts = self._starts
        known = (starts[i] for i in range(bisect_left(starts, place), len(starts)))
        return merge(known, self._find_matches(place))

    def _find_matches(self, place: int) -> Iterator[int]:
        while place < self.end:
            skip = place - self._window_start
            if not 0 <= skip < len(self._window) - FRAME_HEAD.size:
                self._window_start, skip = place, 0
                self._window = self._file.read(place, _WINDOW)
            for match in _CANDIDATE.finditer(self._window, skip):
                yield self._window_start + match.start()
            if len(self._window) <= FRAME_HEAD.size:
                return
            place = self._window_start + len(self._window) - FRAME_HEAD.size + 1

    def _is_record(self, place: int, channels: Collection[int] | None) -> bool:
        frame = self.read_frame(place)
        if frame is None:
            return False
        kind, after = frame
        length = after - place - FRAME_HEAD.size
        if kind == Opcode.CHUNK:
            head = self.read_chunk_head(place)
            return (
                head is not None
                and head.data_offset + head.data_size == length
                and head.compression in COMPRESSIONS
            )
        if not self.is_followed(after) or length > MAX_SIZE or not self.spend(length):
            return False
        content = self._file.read(place + FRAME_HEAD.size, length)
        return _is_content(kind, content, channels)


def _is_content(kind: int, content: bytes, channels: Collection[int] | None) -> bool:
    if kind == Opcode.DATA_END:
        return len(content) == DATA_END_SIZE
    if kind == Opcode.MESSAGE_INDEX:
        return read_message_index(content) is not None
    if kind == Opcode.MESSAGE and channels is not None and len(content) >= MESSAGE_HEAD.size:
        return MESSAGE_HEAD.unpack_from(content)[0] in channels
    # What describes messages stands beside them.
    kinds = {Opcode.ATTACHMENT, Opcode.METADATA}
    if channels is not None:
        kinds |= {Opcode.SCHEMA, Opcode.CHANNEL}
    return kind in kinds and read_record(kind, content) is not None
