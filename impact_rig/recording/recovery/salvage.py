"""Finds every sound record of a recording, whatever happened to the bytes between them.

Where the records no longer follow each other, the next one is searched byte by byte. What a
checksum vouches for is told from what merely looks whole.
"""

from collections import Counter
from collections.abc import Callable, Generator, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from mcap.opcode import Opcode
from mcap.records import Attachment, Header, McapRecord, Metadata
from mcap.records import Channel as ChannelRecord
from mcap.records import Schema as SchemaRecord

from impact_rig.recording.reading.mcap_records import FRAME_HEAD, MAGIC, MAX_SIZE, MESSAGE_HEAD
from impact_rig.recording.reading.mcap_summary import FOOTER_SIZE
from impact_rig.recording.recovery.chunk_salvage import (
    SalvagedChunk,
    find_whole_records,
    salvage_chunk,
)
from impact_rig.recording.recovery.file_index import FileBytes, read_index, read_record
from impact_rig.recording.recovery.found import ChunkEnd, Damage, Found, FoundMessage
from impact_rig.recording.recovery.found_topics import FoundTopics, Topic
from impact_rig.recording.recovery.message_index import MessageIndexCheck
from impact_rig.recording.recovery.record_search import PRIVATE, RecordSearch

MAX_DAMAGES = 1000
"""How many damaged places are told one by one, our choice: further ones are added to the last."""
_SMALL: dict[int, str] = {
    Opcode.SCHEMA: "the description of a type",
    Opcode.CHANNEL: "the description of a topic",
    Opcode.ATTACHMENT: "an attachment",
    Opcode.METADATA: "a metadata record",
}
"""Records that are read as a whole, in words."""
_INDEX_KINDS = {
    bytes([kind])
    for kind in (Opcode.MESSAGE_INDEX, Opcode.CHUNK_INDEX, Opcode.STATISTICS, Opcode.DATA_END)
}
"""Records without data, as they begin."""


class Salvage:
    """One pass over a file that may be damaged.

    Parameters
    ----------
    path : Path
        Of the file.
    report : callable, optional
        Told how many bytes were looked at, now and then.

    Attributes
    ----------
    path : Path
        Of the file.
    size : int
        Of the file [byte].
    is_closed : bool
        Whether the file has an end.
    header : Header, optional
        Profile and library.
    index : FileIndex, optional
        What the end of the file says of it.
    damages : list of Damage
        As far as was read.
    unknown : Counter
        Messages that cannot be told a topic, by the number of their channel.
    chunks : int
        Those that were found.

    Raises
    ------
    FileError
        If there is no such file or it cannot be read.
    """

    def __init__(self, path: Path, report: Callable[[int], None] = lambda _: None) -> None:
        self._file = FileBytes(path)
        self._report = report
        self.path = path
        self.size = self._file.size
        self.is_closed = self._file.read(max(0, self.size - len(MAGIC)), len(MAGIC)) == MAGIC
        self.header: Header | None = None
        self.index = read_index(self._file)
        self.damages: list[Damage] = []
        self.unknown: Counter[int] = Counter()
        self.chunks = 0
        self._search = RecordSearch(self._file, self.index)
        self._topics = FoundTopics()
        self._is_framing_whole = True
        self._message_index = MessageIndexCheck()
        if self.index is not None:
            for record in (*self.index.schemas.values(), *self.index.channels.values()):
                self._define(record, is_vouched=self.index.is_sound)

    @property
    def existing(self) -> Counter[int]:
        """Messages of each channel that are known to have been in the file, as far as was read."""
        return self._message_index.existing

    @property
    def topics(self) -> dict[int, Topic]:
        """Topics by the numbers of their channels, as far as was read."""
        return self._topics.list_topics()

    def read(self) -> Iterator[Found]:
        """Yield everything that is whole, in file order, one chunk in memory at a time.

        Raises
        ------
        FileError
            If the disk does not deliver.
        """
        try:
            yield from self._walk()
        finally:
            self._file.close()

    def _walk(self) -> Iterator[Found]:
        place = self._read_start()
        while place < self._search.end:
            self._report(place)
            frame = self._search.read_frame(place)
            if frame is None:
                self._message_index.finish()
                place = self._pass_over(place, "no record begins here")
            elif frame[0] == Opcode.CHUNK:
                place = yield from self._read_chunk(place, frame[1])
            elif frame[0] == Opcode.DATA_END:
                place = self._end_data(frame[1])
            else:
                yield from self._read_record(frame[0], place, frame[1])
                place = frame[1]
        self._message_index.finish()
        self._report(self.size)

    def _read_start(self) -> int:
        """Return where the first record after the header begins."""
        place = len(MAGIC)
        if self._file.read(0, place) != MAGIC:
            self._note(0, min(place, self.size), "the file does not begin like one of MCAP")
        frame = self._search.read_frame(place)
        if frame is not None and frame[0] == Opcode.HEADER:
            start = place + FRAME_HEAD.size
            header = self._read_small(Opcode.HEADER, start, frame[1])
            if isinstance(header, Header):
                self.header = header
                return frame[1]
        return (
            self._pass_over(place - 1, "the header cannot be read") if self.size > place else place
        )

    def _end_data(self, place: int) -> int:
        """Return where to go on after the data: an index that is sound is not walked through."""
        if self._search.end < self.size:
            return self._search.end
        is_without_index = place + FOOTER_SIZE + len(MAGIC) == self.size and self.is_closed
        if not is_without_index:
            self._note(place, self.size, "the index at the end cannot be used", has_data=False)
        return self.size

    def _pass_over(self, place: int, reason: str) -> int:
        """Return where the next record begins after a place where none is whole."""
        is_chunked = self.chunks > 0
        after = self._search.find_next(place + 1, None if is_chunked else self._topics.numbers)
        if after == self.size and not self.is_closed:
            reason = "the last record is cut off"
        kind = self._file.read(place, 1)
        self._note(place, after, reason, has_data=kind not in _INDEX_KINDS)
        self._is_framing_whole = False
        return after

    def _read_record(self, kind: int, place: int, after: int) -> Iterator[Found]:
        start = place + FRAME_HEAD.size
        if kind == Opcode.MESSAGE_INDEX:
            if not self._message_index.check(self._file.read(start, min(after - start, MAX_SIZE))):
                self._note(place, after, "the index of a chunk does not fit it", has_data=False)
            return
        self._message_index.finish()
        if kind == Opcode.MESSAGE and MESSAGE_HEAD.size <= after - start <= MAX_SIZE:
            content = self._file.read(start, after - start)
            channel, _, log_time, _ = MESSAGE_HEAD.unpack_from(content)
            self._message_index.add_message(channel, log_time, place)
            yield from self._make_message(content, is_vouched=self._is_framing_whole)
        elif kind in _SMALL:
            record = self._read_small(kind, start, after)
            if record is None:
                self._note(place, after, f"{_SMALL[kind]} is damaged")
            elif isinstance(record, (Metadata, Attachment)):
                yield record
            else:
                self._define(record, is_vouched=self._is_framing_whole)
        elif kind < PRIVATE:
            self._note(place, after, "a record that does not belong there")

    def _read_small(self, kind: int, start: int, after: int) -> Any:
        if after - start > MAX_SIZE:
            return None
        return read_record(kind, self._file.read(start, after - start))

    def _read_chunk(self, place: int, after: int) -> Generator[Found, None, int]:
        """Yield a chunk's messages and return where to go on."""
        self._message_index.finish()
        self.chunks += 1
        chunk, compression, after = self._salvage_chunk(place, after)
        finish = 0
        for kind, start, finish in find_whole_records(chunk.data):
            content = chunk.data[start:finish]
            if kind == Opcode.MESSAGE:
                channel, _, log_time, _ = MESSAGE_HEAD.unpack_from(content)
                self._message_index.add_message(channel, log_time, start - FRAME_HEAD.size)
                yield from self._make_message(content, is_vouched=chunk.is_vouched)
            else:
                self._define(read_record(kind, content), is_vouched=chunk.is_vouched)
        self._message_index.end_chunk(is_vouched=chunk.is_vouched)
        yield ChunkEnd(compression)
        if chunk.is_vouched:
            if finish < len(chunk.data):
                self._note(place, after, "a chunk holds what is no record")
            elif chunk.reason:
                self._note(place, place, chunk.reason, has_data=False)
            return after
        if self._search.is_followed(after):
            self._note(place, after, chunk.reason)
            return after
        return self._pass_over(place, chunk.reason)

    def _salvage_chunk(self, place: int, after: int) -> tuple[SalvagedChunk, str, int]:
        """Try the lengths that the record and its head state: one may be wrong.

        Returns what is left of the chunk, its compression, and where it ends.
        """
        head = self._search.read_chunk_head(place)
        if head is None:
            return SalvagedChunk(b"", False, "the head of a chunk is damaged"), "", after
        start = place + FRAME_HEAD.size + head.data_offset
        best: SalvagedChunk | None = None
        ends = self._search.list_chunk_ends(place, after, head)
        for end in ends:
            size = min(end, self._search.end) - start
            if not 0 <= size <= MAX_SIZE:
                continue
            is_whole = end <= self._search.end
            chunk = salvage_chunk(head, self._file.read(start, size), is_whole=is_whole)
            if chunk.is_vouched:
                reason = chunk.reason or ("the head of a chunk is wrong" if len(ends) > 1 else "")
                return replace(chunk, reason=reason), head.compression, end
            best = best or chunk
            if not self._search.spend(size):
                break
        if best is None:
            best = SalvagedChunk(b"", False, f"a chunk is larger than {MAX_SIZE} byte")
        return best, head.compression, ends[0]

    def _define(self, record: McapRecord | None, *, is_vouched: bool) -> None:
        if isinstance(record, SchemaRecord):
            self._topics.add_schema(record, is_vouched=is_vouched)
        elif isinstance(record, ChannelRecord):
            self._topics.add_channel(record, is_vouched=is_vouched)

    def _make_message(self, content: bytes, *, is_vouched: bool) -> Iterator[FoundMessage]:
        channel, sequence, log_time, publish_time = MESSAGE_HEAD.unpack_from(content)
        topic = self._topics.find(channel)
        if topic is None:
            self.unknown[channel] += 1
            return
        data = content[MESSAGE_HEAD.size :]
        yield FoundMessage(topic, sequence, log_time, publish_time, data, is_vouched)

    def _note(self, start: int, end: int, reason: str, *, has_data: bool = True) -> None:
        damage = Damage(start, max(end - start, 0), reason, has_data)
        last = self.damages[-1] if self.damages else None
        if last is not None and (
            len(self.damages) >= MAX_DAMAGES
            or (last.start + last.size == start and last.reason == reason)
        ):
            self.damages[-1] = last._replace(
                size=last.size + damage.size, has_data=last.has_data or has_data
            )
        else:
            self.damages.append(damage)
