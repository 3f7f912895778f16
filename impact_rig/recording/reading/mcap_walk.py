"""Goes through the records of an MCAP file, and tells damage from an end that was cut off."""

from collections.abc import Iterator, Mapping
from typing import BinaryIO

from mcap.opcode import Opcode

from impact_rig.recording.reading.mcap_chunk import read_chunk
from impact_rig.recording.reading.mcap_records import (
    FRAME_HEAD,
    MAGIC,
    MAX_SIZE,
    DamageError,
    Frame,
    SmallT,
    read_bytes,
    read_small,
)

_TOPIC_KINDS = frozenset({Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE})
_BLOCK_SIZE = 1 << 20
"""What is read at once of bytes that mean nothing [byte], our choice."""


class McapWalk:
    """One way through a file.

    Parameters
    ----------
    file : file
        Opened for reading.
    size : int
        Of the file [byte].
    is_complete : bool
        Whether the file was closed. If not, what breaks at its very end was cut off there, and
        is no damage.
    """

    def __init__(self, file: BinaryIO, size: int, *, is_complete: bool) -> None:
        self._file = file
        self._size = size
        self._is_complete = is_complete

    def find_frames(self, leaps: Mapping[int, int]) -> Iterator[Frame]:
        """Yield where the records lie, up to the end of the data.

        Parameters
        ----------
        leaps : mapping
            From where to where chunks are passed over.

        Raises
        ------
        DamageError
            Where the records do not follow each other.
        """
        place = len(MAGIC)
        data_end = self._size - len(MAGIC) if self._is_complete else self._size
        while place < data_end:
            if place in leaps:
                place = leaps[place]
                continue
            self._file.seek(place)
            head = self._file.read(FRAME_HEAD.size)
            kind, length = FRAME_HEAD.unpack(head.ljust(FRAME_HEAD.size, b"\0"))
            frame = Frame(kind, place + FRAME_HEAD.size, place + FRAME_HEAD.size + length)
            if not kind or frame.end > data_end:
                if length <= MAX_SIZE and self._is_cut_off(frame.end if kind else place):
                    return
                raise DamageError(f"at byte {place} there is no record")
            if kind in (Opcode.DATA_END, Opcode.FOOTER):
                return
            yield frame
            place = frame.end

    def read_records(self, frame: Frame) -> bytes:
        """Return the records of a chunk, or one that stands alone; none if it holds no messages.

        Raises
        ------
        DamageError
            If they are not what was written.
        """
        if frame.kind in _TOPIC_KINDS:
            return read_bytes(self._file, frame.start - FRAME_HEAD.size, frame.end)
        if frame.kind != Opcode.CHUNK:
            return b""
        try:
            return read_chunk(self._file, frame)
        except DamageError:
            if self._is_cut_off(frame.end):
                return b""
            raise

    def read_small(self, frame: Frame, record_class: type[SmallT]) -> SmallT:
        """Return a record that stands between the chunks.

        Raises
        ------
        DamageError
            If its bytes are not those of one.
        """
        record = read_small(record_class, read_bytes(self._file, frame.start, frame.end))
        if record is None:
            raise DamageError(f"the record at byte {frame.start} makes no sense")
        return record

    def _is_cut_off(self, place: int) -> bool:
        """Tell whether nothing follows in a file that was never closed.

        Where the power failed, the file system may have filled it up with zeros.
        """
        if self._is_complete:
            return False
        self._file.seek(min(place, self._size))
        # Who is still writing to the file may have gone on.
        while block := self._file.read(min(_BLOCK_SIZE, self._size - self._file.tell())):
            if block.strip(b"\0"):
                return False
        return True
