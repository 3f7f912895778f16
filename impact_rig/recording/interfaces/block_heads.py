"""What a recorder must know of a block: read from the serialised message, the points left alone.

A block of 10 ms has 200 kB, of which these are the first hundred bytes.
"""

import struct
from collections.abc import Callable
from typing import NamedTuple

from impact_rig.core.errors import FileError
from impact_rig.core.signals.record import HitLabel

_ENCAPSULATION = 4
"""Bytes before the first field, from which alignment is counted; the second tells the order."""
_LITTLE_ENDIAN = 1
_SIZES = {"?": 1, "i": 4, "I": 4, "Q": 8, "d": 8}
"""Of a value, which is also what it is aligned to [byte]."""
_COUNT_SIZE = 4
"""Of a digitizer's count [byte]."""


class BlockHead(NamedTuple):
    """What stands in a block beside its points.

    Attributes
    ----------
    label : HitLabel
        The hit that the block is of.
    first_sample : int
        Index of its first point.
    points : int
        Of the hammer's channel.
    stamp : int
        Time of its first point, nanoseconds since the epoch.
    last : bool
        Whether it ends the record, or the arming.
    """

    label: HitLabel
    first_sample: int
    points: int
    stamp: int
    last: bool


def read_block_head(data: bytes) -> BlockHead:
    """Read the head of a serialised `AccelerationBlock`.

    Raises
    ------
    FileError
        If it ends too early.
    """
    return _read(data, _read_block)


def read_stream_head(data: bytes) -> BlockHead:
    """Read the head of a serialised `StreamBlock`; raises as `read_block_head`."""
    return _read(data, _read_stream_block)


class _Fields:
    """Takes the fields of a message one after the other, as CDR lays them out."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._order = "<" if data[1] & _LITTLE_ENDIAN else ">"
        self._place = _ENCAPSULATION

    def take(self, kind: str) -> int:
        """Return the next number, of a kind as `struct` names it."""
        size = _SIZES[kind]
        # Counted from the end of the encapsulation, every value is aligned to its size.
        place = self._place + (_ENCAPSULATION - self._place) % size
        self._place = place + size
        (value,) = struct.unpack_from(self._order + kind, self._data, place)
        return int(value)

    def take_text(self) -> str:
        """Return the next text."""
        size = self.take("I")
        start, self._place = self._place, self._place + size
        return self._data[start : self._place - 1].decode()

    def take_stamp(self) -> int:
        """Return the time in the next `Header`, nanoseconds since the epoch."""
        seconds = self.take("i")
        nanoseconds = self.take("I")
        self.take_text()
        return seconds * 1_000_000_000 + nanoseconds

    def take_label(self, sample: str, record: int) -> HitLabel:
        """Return the hit of a sample and a record, of which the rest comes next."""
        return HitLabel(sample, record, impact=self.take("I"), attempt=self.take("I"))

    def take_points(self) -> int:
        """Return how many points the next `Channel` has: counts, or else numbers."""
        counts = self.take("I")
        self._place += _COUNT_SIZE * counts
        return counts or self.take("I")


def _read(data: bytes, read: "Callable[[_Fields], BlockHead]") -> BlockHead:
    try:
        return read(_Fields(data))
    except (struct.error, IndexError, UnicodeDecodeError):
        raise FileError(f"a block of {len(data)} byte is cut off or is none") from None


def _read_block(fields: _Fields) -> BlockHead:
    stamp = fields.take_stamp()
    record, sample = fields.take("I"), fields.take_text()
    label = fields.take_label(sample, record)
    first_sample = fields.take("Q")
    fields.take("d")  # the sampling rate
    fields.take("?")  # whether it was triggered
    last = bool(fields.take("?"))
    return BlockHead(label, first_sample, fields.take_points(), stamp, last)


def _read_stream_block(fields: _Fields) -> BlockHead:
    stamp = fields.take_stamp()
    first_sample = fields.take("Q")
    fields.take("d")  # the sampling rate
    record, sample = fields.take("I"), fields.take_text()
    label = fields.take_label(sample, record)
    last = bool(fields.take("?"))
    return BlockHead(label, first_sample, fields.take_points(), stamp, last)
