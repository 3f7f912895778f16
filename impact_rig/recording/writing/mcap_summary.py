"""The end of an MCAP file, collected while it is written: what is in it, and where."""

import struct
import zlib
from collections import Counter
from typing import Any

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Statistics, SummaryOffset

from impact_rig.recording.reading.mcap_records import FRAME_HEAD, MAGIC

_FOOTER_PLACES = struct.Struct("<QQ")
_CHECKSUM = struct.Struct("<I")
_GROUPS = (
    Opcode.SCHEMA,
    Opcode.CHANNEL,
    Opcode.STATISTICS,
    Opcode.CHUNK_INDEX,
    Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX,
)
"""Records at the end, in their order."""


class McapSummary:
    """Keeps the records of the end as the bytes they will be: hours of chunks take little.

    Attributes
    ----------
    messages : int
        In the file [-].
    counts : Counter
        The same by channel [-].
    start_time, end_time : int
        Earliest and latest log time of a message, nanoseconds since the epoch; 0: none.
    """

    def __init__(self) -> None:
        self.messages = 0
        self.counts: Counter[int] = Counter()
        self.start_time = 0
        self.end_time = 0
        self._groups = {kind: bytearray() for kind in _GROUPS}
        self._records: Counter[Opcode] = Counter()

    def add(self, kind: Opcode, record: bytes) -> None:
        """Keep a record; those of a kind stay together."""
        self._groups[kind] += record
        self._records[kind] += 1

    def count_message(self, channel: int, log_time: int) -> None:
        """Count a message in."""
        if not self.messages:
            self.start_time = self.end_time = log_time
        elif log_time > self.end_time:
            self.end_time = log_time
        elif log_time < self.start_time:
            self.start_time = log_time
        self.counts[channel] += 1
        self.messages += 1

    def format(self, place: int) -> bytes:
        """Return all that follows on the data section; it begins at a place in the file."""
        self._groups[Opcode.STATISTICS] = bytearray(format_record(self._make_statistics()))
        summary, offsets = bytearray(), bytearray()
        for kind, records in self._groups.items():
            if records:
                offset = SummaryOffset(kind, place + len(summary), len(records))
                offsets += format_record(offset)
                summary += records
        places = _FOOTER_PLACES.pack(place, place + len(summary))
        length = len(places) + _CHECKSUM.size
        summary += offsets + FRAME_HEAD.pack(Opcode.FOOTER, length) + places
        return bytes(summary) + _CHECKSUM.pack(zlib.crc32(summary)) + MAGIC

    def _make_statistics(self) -> Statistics:
        return Statistics(
            attachment_count=self._records[Opcode.ATTACHMENT_INDEX],
            channel_count=self._records[Opcode.CHANNEL],
            channel_message_counts=dict(self.counts),
            chunk_count=self._records[Opcode.CHUNK_INDEX],
            message_count=self.messages,
            message_end_time=self.end_time,
            message_start_time=self.start_time,
            metadata_count=self._records[Opcode.METADATA_INDEX],
            schema_count=self._records[Opcode.SCHEMA],
        )


def format_record(record: Any) -> bytes:
    """Return one of the library's records as it stands in a file."""
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())
