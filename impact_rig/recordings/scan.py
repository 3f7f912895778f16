"""One pass over an MCAP file, by the library `mcap`, within bounds and up to the first damage.

A tolerant scan notes the damage and goes on behind it, with what a checksum vouches for. The
index at the end is not needed: a recording that was never closed reads as well. Where there is
one, it tells which chunks need not be read.
"""

import contextlib
import io
import os
import re
import struct
import zlib
from bisect import bisect_left
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import lz4.frame
import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.summary import Summary

from impact_rig.core.errors import FileError
from impact_rig.recordings.records import (
    Attachment,
    Channel,
    Item,
    MetadataRecord,
    RawMessage,
)

MAGIC = b"\x89MCAP0\r\n"
"""First and last bytes of every file."""
MAX_SIZE = 1 << 29
"""Largest record that is taken into memory [byte], our choice: twice the largest chunk of our
recorder; it bounds what a damaged or malicious file can ask for."""
FREE_SIZE = 1 << 26
"""A chunk up to this size may be compressed to any extent [byte], our choice."""
MAX_RATIO = 1000
"""Of a larger chunk's size to that of its compressed data [-], our choice: ten times what
constant signals reach in practice; what claims more is a trap for the memory."""
MAX_NAME = 512
"""Longest name of a topic or a type [characters], our choice: DDS takes 255."""
MAX_DAMAGES = 1000
"""How many damaged places are told one by one, our choice: further ones are added to the last."""
PRIVATE = 0x80
"""First of the kinds of records that anybody may use: they are passed over."""

_FRAME = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
"""Channel, sequence, log time and publish time of a message."""
_FOOTER_SIZE = _FRAME.size + 20
_CHUNK_SIZES = struct.Struct("<16xQII")
"""Of a chunk's content: uncompressed size, checksum, length of the compression's name."""
_CHUNK_START = re.compile(rb"(?s)\x06(?=.{5}\x00{3})")
"""How a chunk begins: its kind, and a length below a terabyte."""
_WINDOW = 1 << 20
"""What is searched at once for the next chunk [byte], our choice."""
_EFFORT = 4
"""How often the bytes of a file may be looked at in vain [-], our choice: it bounds the time that
a malicious file can ask for."""
_ERRORS = (McapError, struct.error, ValueError, OverflowError, MemoryError)
"""What the library raises on bytes that make no sense."""
_ENGINE_ERRORS = (zstandard.ZstdError, RuntimeError, OverflowError, MemoryError)
_INDEX_KINDS = {Opcode.MESSAGE_INDEX, Opcode.CHUNK_INDEX, Opcode.STATISTICS, Opcode.DATA_END}
"""Records without data."""
_SMALL: dict[int, tuple[Any, str]] = {
    Opcode.SCHEMA: (records.Schema, "the description of a type"),
    Opcode.CHANNEL: (records.Channel, "the description of a topic"),
    Opcode.ATTACHMENT: (records.Attachment, "an attachment"),
    Opcode.METADATA: (records.Metadata, "a metadata record"),
}

Wanted = Callable[[Channel], bool]
"""Tells whether a channel's messages are to be read."""


class DamageError(ValueError):
    """Bytes that are not what they should be; the message says what is wrong with what."""


class Damage(NamedTuple):
    """Bytes that could not be read.

    Attributes
    ----------
    start, size : int
        Where, and how many [byte].
    reason : str
        What is wrong, in words.
    has_data : bool
        Whether messages or attachments may be among them; if not, only an index is.
    """

    start: int
    size: int
    reason: str
    has_data: bool = True

    def __str__(self) -> str:
        """Return in words what cannot be read, and where."""
        if not self.size:
            return f"{self.reason} (at byte {self.start})"
        return f"{self.reason} ({self.size} byte from byte {self.start})"


class Scan:
    """One pass over a file.

    Parameters
    ----------
    path : Path
        Of the file.
    is_strict : bool
        Whether the first damage is an error; what breaks at the very end of a file that was
        never closed was cut off there, and is none.
    wanted : callable
        Asked once for each channel whether its messages are wanted.
    start_time, end_time : int, optional
        Only messages logged from the one to before the other, nanoseconds since the epoch.
    kinds : set of type
        Of what is yielded.
    report : callable
        Told now and then how far the file was read [byte].
    before : Scan, optional
        One of the same file, whose index is taken over.

    Attributes
    ----------
    size : int
        Of the file as it was opened [byte].
    is_closed : bool
        Whether the file has an end.
    header : Header, optional
        Profile and library.
    channels : dict
        All that were described so far, by number.
    damages : list of Damage
        As far as was read.
    unknown : Counter
        Messages of which nobody told the topic, by the number of their channel.
    compressions : dict
        Names of the chunks' compressions, in the order in which they came.
    chunks : int
        Those that were found.

    Raises
    ------
    FileError
        If there is no such file, or it cannot be read.
    """

    def __init__(
        self,
        path: Path,
        *,
        is_strict: bool = True,
        wanted: Wanted = lambda _: True,
        start_time: int | None = None,
        end_time: int | None = None,
        kinds: frozenset[type] = frozenset({RawMessage, MetadataRecord, Attachment}),
        report: Callable[[int], None] = lambda _: None,
        before: "Scan | None" = None,
    ) -> None:
        self.path = path
        self._before = before
        self._is_strict = is_strict
        self._wanted = wanted
        self._times = start_time, end_time
        self._kinds = kinds
        self._report = report
        self._file = _open(path)
        self.size = os.fstat(self._file.fileno()).st_size
        self._effort = _EFFORT * self.size
        self.header: records.Header | None = None
        self.channels: dict[int, Channel] = {}
        self.damages: list[Damage] = []
        self.unknown: Counter[int] = Counter()
        self.compressions: dict[str, None] = {}
        self.chunks = 0
        self._indexed: dict[int, set[tuple[int, int]]] | None = None
        self._schemas: dict[int, records.Schema] = {}
        self._chosen: dict[int, Channel | None] = {}
        with self._named():
            self.is_closed = (
                self.size > len(MAGIC) and self._read(self.size - len(MAGIC), self.size) == MAGIC
            )

    def read(self) -> Iterator[Item]:
        """Yield what is whole, in file order, one chunk in memory at a time; close the file.

        Raises
        ------
        FileError
            If the file cannot be read; in a strict scan also if it is damaged or a wanted topic
            is none of ROS 2.
        """
        with self._named(), self._file:
            yield from self._walk()

    def read_messages(self) -> Iterator[RawMessage]:
        """Yield the messages alone; raises as `read`."""
        self._kinds = frozenset({RawMessage})
        for item in self.read():
            if isinstance(item, RawMessage):
                yield item

    def check_start(self) -> None:
        """Read header and index alone; raises as `read`."""
        with self._named(), self._file:
            self._read_header()
            self._take_summary()

    def read_channels(self) -> tuple[Channel, ...]:
        """Return all topics: from the index, or else by reading all; raises as `read`."""
        self._kinds = frozenset()
        with self._named(), self._file:
            self._read_header()
            self._take_summary()
            if not self.channels:
                for _ in self._walk():
                    pass
        return tuple(self.channels.values())

    @cached_property
    def summary(self) -> Summary | None:
        """The index at the end of the file; None: there is none that can be used."""
        if self._before is not None and self._before.size == self.size:
            return self._before.summary
        return self._load_summary()

    def _load_summary(self) -> Summary | None:
        """Read the index: not one whose checksum does not fit, without one no more than topics."""
        tail_start = self.size - _FOOTER_SIZE - len(MAGIC)
        if not self.is_closed or tail_start <= len(MAGIC):
            return None
        try:
            tail = self._read(tail_start, self.size)
            footer = records.Footer.read(ReadDataStream(io.BytesIO(tail[_FRAME.size :])))
            if not len(MAGIC) < footer.summary_start <= tail_start:
                return None
            section = self._read(footer.summary_start, tail_start)
            checksum = zlib.crc32(tail[: _FOOTER_SIZE - 4], zlib.crc32(section))
            if footer.summary_crc not in (0, checksum):
                return None
            self._file.seek(0)
            summary = SeekingReader(self._file, record_size_limit=MAX_SIZE).get_summary()
        except (DamageError, *_ERRORS):
            return None
        if summary is None:
            return None
        if not footer.summary_crc:
            summary.chunk_indexes, summary.statistics = [], None
            summary.attachment_indexes, summary.metadata_indexes = [], []
        ends = (chunk.chunk_start_offset + chunk.chunk_length for chunk in summary.chunk_indexes)
        return summary if max(ends, default=0) <= footer.summary_start else None

    def _walk(self) -> Iterator[Item]:
        place = self._read_header()
        self._take_summary()
        leaps = self._plan_leaps()
        end = self.size - len(MAGIC) if self.is_closed else self.size
        while place < end:
            if place in leaps:
                place = leaps[place]
                continue
            try:
                kind, after, is_right = self._read_frame(place, end)
                if not is_right:
                    reason = "the index at the end states another length of a record"
                    if self._is_strict:
                        raise DamageError(f"{reason} than that at byte {place} has")
                    self._note(place, place, reason, has_data=False)
                if kind in (Opcode.DATA_END, Opcode.FOOTER):
                    self._check_end(kind, place, after)
                    return
                yield from self._read_record(kind, place, after)
            except DamageError as error:
                after = self._pass_over(place, end, str(error))
            place = after
            self._report(place)

    def _read_header(self) -> int:
        """Return where the first record after the header begins."""
        if self.size == 0:
            raise FileError(f"{self.path} is empty: it should be an MCAP recording")
        if self._is_strict and self._read(0, min(len(MAGIC), self.size)) != MAGIC:
            raise FileError(f"{self.path} is no MCAP recording: it does not begin like one")
        head = self._read(len(MAGIC), min(len(MAGIC) + _FRAME.size, self.size))
        kind, length = _FRAME.unpack(head) if len(head) == _FRAME.size else (0, 0)
        after = len(MAGIC) + _FRAME.size + length
        if self._is_strict and (not head or after > self.size):
            raise FileError(f"{self.path} holds no more than the beginning of an MCAP recording")
        if kind == Opcode.HEADER and after <= self.size:
            content = self._read(len(MAGIC) + _FRAME.size, after)
            self.header = _parse(records.Header, content)
        if self.header is None:
            if self._is_strict:
                raise FileError(f"{self.path} is damaged: its header cannot be read")
            end = self.size - len(MAGIC) if self.is_closed else self.size
            return self._pass_over(0, end, "the file does not begin like one of MCAP")
        if self._is_strict and self.header.profile != "ros2":
            raise FileError(
                f"{self.path} is an MCAP file of profile {self.header.profile!r}:"
                " it should be 'ros2'"
            )
        return int(after)

    def _take_summary(self) -> None:
        if self.summary is not None:
            self._schemas |= self.summary.schemas
            for channel in self.summary.channels.values():
                self._add_channel(channel)

    def _plan_leaps(self) -> dict[int, int]:
        """Return from where to where chunks lie of other times, or all where no message is wanted.

        What topics a chunk holds is not believed: an index could hide hits.
        """
        if self.summary is None:
            return {}
        start, end = self._times
        has_messages = RawMessage in self._kinds
        return {
            chunk.chunk_start_offset: chunk.chunk_start_offset
            + chunk.chunk_length
            + chunk.message_index_length
            for chunk in self.summary.chunk_indexes
            # Without channels it is not known what the chunk holds.
            if (not has_messages and self.channels)
            or (
                chunk.message_index_offsets
                and chunk.message_index_offsets.keys() <= self.channels.keys()
                and (
                    (start is not None and chunk.message_end_time < start)
                    or (end is not None and chunk.message_start_time >= end)
                )
            )
        }

    @cached_property
    def _chunk_entries(self) -> dict[int, records.ChunkIndex]:
        """What the index says of chunks, by where they begin."""
        found = self.summary.chunk_indexes if self.summary is not None else ()
        return {entry.chunk_start_offset: entry for entry in found}

    @cached_property
    def _known_ends(self) -> dict[int, int]:
        """Where records begin and end by the index."""
        if self.summary is None:
            return {}
        ends = {
            chunk.chunk_start_offset: chunk.chunk_start_offset + chunk.chunk_length
            for chunk in self.summary.chunk_indexes
        }
        ends |= {
            item.offset: item.offset + item.length for item in self.summary.attachment_indexes
        }
        ends |= {item.offset: item.offset + item.length for item in self.summary.metadata_indexes}
        return ends

    def _read_frame(self, place: int, end: int) -> tuple[int, int, bool]:
        """Return kind and end of the record at a place, and whether its length says so, too."""
        head = self._read(place, min(place + _FRAME.size, end)).ljust(_FRAME.size, b"\0")
        kind, length = _FRAME.unpack(head)
        stated = place + _FRAME.size + length
        after = self._known_ends.get(place, stated)
        if not Opcode.HEADER <= kind <= Opcode.DATA_END and kind < PRIVATE:
            raise DamageError(f"at byte {place} there is no record")
        if after > end:
            raise DamageError(f"the record at byte {place} is longer than the file")
        return kind, after, after == stated

    def _read_record(self, kind: int, place: int, after: int) -> Iterator[Item]:
        start = place + _FRAME.size
        if kind == Opcode.CHUNK:
            self.chunks += 1
            self._indexed = None
            content = self._read_chunk(start, after)
            if not self._is_strict:
                self._indexed = _list_places(content)
                self._check_index(place, self._indexed)
            yield from self._read_messages(content)
        elif kind == Opcode.MESSAGE_INDEX and self._indexed is not None:
            index = _parse(records.MessageIndex, self._read(start, after))
            if index is None or set(index.records) != self._indexed[index.channel_id]:
                raise DamageError("the index of a chunk does not fit it")
        elif kind == Opcode.MESSAGE:
            yield from self._read_messages(self._read(place, after))
        elif kind in (Opcode.SCHEMA, Opcode.CHANNEL):
            self._describe(self._parse_small(kind, self._read(start, after), place))
        elif (kind == Opcode.METADATA and MetadataRecord in self._kinds) or (
            kind == Opcode.ATTACHMENT and Attachment in self._kinds
        ):
            record = self._parse_small(kind, self._read(start, after), place)
            if kind == Opcode.METADATA:
                yield MetadataRecord(record.name, dict(record.metadata))
            else:
                yield Attachment(record.name, record.media_type, record.log_time, record.data)

    def _check_index(self, place: int, places: dict[int, set[tuple[int, int]]]) -> None:
        """Note it if the index at the end hides a chunk, or what it holds."""
        if not self._chunk_entries:
            return
        entry = self._chunk_entries.get(place)
        times = [log_time for messages in places.values() for log_time, _ in messages]
        if entry is None or (
            entry.message_index_offsets
            and (
                set(entry.message_index_offsets),
                entry.message_start_time,
                entry.message_end_time,
            )
            != (set(places), min(times, default=0), max(times, default=0))
        ):
            self._note(
                place, place, "the index at the end hides what a chunk holds", has_data=False
            )

    def _read_chunk(self, start: int, after: int) -> bytes:
        """Return the records of a chunk, checked and within bounds."""
        content = self._read(start, after)
        chunk = _parse_chunk(content)
        self.compressions[chunk.compression or "none"] = None
        return _decompress(chunk)

    def _read_messages(self, content: bytes) -> Iterator[RawMessage]:
        """Yield the wanted messages among records that follow each other.

        The library takes three times as long for the messages of all topics, of which most are
        not wanted.
        """
        place, size = 0, len(content)
        chosen, (start, end) = self._chosen, self._times
        head_size, unpack = _MESSAGE.size, _MESSAGE.unpack_from
        while place < size:
            kind, begin, place = _read_record_head(content, place)
            if kind != Opcode.MESSAGE:
                self._describe(self._parse_small(kind, content[begin:place], begin))
                continue
            number, sequence, log_time, publish_time = unpack(content, begin)
            if number not in chosen:
                if self._is_strict:
                    raise DamageError("a message belongs to a channel that is not announced")
                self.unknown[number] += 1
                continue
            channel = chosen[number]
            if (
                channel is not None
                and (start is None or log_time >= start)
                and (end is None or log_time < end)
            ):
                data = content[begin + head_size : place]
                yield RawMessage(channel, sequence, log_time, publish_time, data)

    def _parse_small(self, kind: int, content: bytes, place: int) -> Any:
        if kind not in _SMALL:
            raise DamageError("a chunk holds what is no message")
        record_class, words = _SMALL[kind]
        record = _parse(record_class, content)
        if record is None:
            raise DamageError(f"{words} is damaged: the record at byte {place}")
        return record

    def _describe(self, record: Any) -> None:
        if isinstance(record, records.Schema):
            if self._schemas.setdefault(record.id, record) != record:
                raise DamageError(f"the type {record.name!r} is described in two ways")
        elif isinstance(record, records.Channel):
            self._add_channel(record)

    def _add_channel(self, record: records.Channel) -> None:
        """Take the description of a topic."""
        schema = self._schemas.get(record.schema_id)
        if schema is None:
            if record.schema_id:
                raise DamageError(f"topic {record.topic!r} has no schema")
            schema = records.Schema(id=0, name="", encoding="", data=b"")
        channel = Channel(
            id=record.id,
            topic=record.topic,
            type_name=schema.name,
            schema=schema.data.decode(errors="replace"),
            metadata=dict(record.metadata),
            encoding=(record.message_encoding, schema.encoding),
        )
        if not all(len(name) <= MAX_NAME and name.isprintable() for name in channel[1:3]):
            raise DamageError("the name of a topic or of its type makes no sense")
        if self.channels.setdefault(channel.id, channel) != channel:
            raise DamageError(f"topic {record.topic!r} is described in two ways")
        if channel.id in self._chosen:
            return
        is_wanted = RawMessage in self._kinds and self._wanted(channel)
        if is_wanted and self._is_strict and not channel.is_ros:
            raise FileError(
                f"{self.path}: topic {channel.topic!r} is in {channel.encoding[0]!r} with a"
                f" schema in {channel.encoding[1]!r}: 'cdr' and 'ros2msg' can be read"
            )
        self._chosen[channel.id] = channel if is_wanted else None

    def _check_end(self, kind: int, place: int, after: int) -> None:
        """Hold the data against their checksum; a strict scan does not read them all."""
        if self._is_strict or kind != Opcode.DATA_END:
            return
        content = self._read(place + _FRAME.size, after)
        stated = int.from_bytes(content[:4], "little")
        if self.is_closed and self.summary is None and after + _FOOTER_SIZE + 8 != self.size:
            self._note(after, self.size, "the index at the end cannot be used", has_data=False)
        if stated and not self.damages and stated != self._compute_checksum(place):
            self._note(place, place, "what stands between the chunks was altered", has_data=False)

    def _compute_checksum(self, end: int) -> int:
        checksum = 0
        for start in range(0, end, _WINDOW):
            checksum = zlib.crc32(self._read(start, min(start + _WINDOW, end)), checksum)
        return checksum

    def _pass_over(self, place: int, end: int, reason: str) -> int:
        """Return where to go on behind a damage; raise it in a strict scan."""
        head = self._read(place, min(place + _FRAME.size, end)).ljust(_FRAME.size, b"\0")
        kind, length = _FRAME.unpack(head)
        after: int = self._known_ends.get(place, place + _FRAME.size + length)
        if self._is_strict:
            # What is longer than anything that is written was not cut off.
            if length <= MAX_SIZE and self._is_cut_off(after if kind else place):
                return self.size
            raise DamageError(reason)
        if not self._is_followed(after, end):
            after = self._find_next(place + 1, end)
        if after == self.size and not self.is_closed:
            reason = "the last record is cut off"
        self._note(place, after, reason, has_data=kind not in _INDEX_KINDS)
        return after

    def _is_followed(self, place: int, end: int) -> bool:
        if place >= end:
            return place == end
        try:
            self._read_frame(place, end)
        except DamageError:
            return False
        return True

    def _is_cut_off(self, place: int) -> bool:
        """Tell whether nothing follows in a file that was never closed.

        Where the power failed, the file system may have filled it up with zeros.
        """
        if self.is_closed:
            return False
        for start in range(min(place, self.size), self.size, _WINDOW):
            if self._read(start, min(start + _WINDOW, self.size)).strip(b"\0"):
                return False
        return True

    def _find_next(self, place: int, end: int) -> int:
        """Return where the next record begins that the index or a checksum vouches for."""
        if known := sorted(self._known_ends):
            nearest = bisect_left(known, place)
            return known[nearest] if nearest < len(known) else end
        while place < end:
            window = self._read(place, min(place + _WINDOW, end))
            for match in _CHUNK_START.finditer(window):
                if self._is_chunk(place + match.start(), end):
                    return place + match.start()
            # A chunk may begin in the last bytes of what was searched.
            place += max(len(window) - _FRAME.size + 1, 1)
        return end

    def _is_chunk(self, place: int, end: int) -> bool:
        """Tell whether a chunk whose checksum fits begins at a place."""
        _, length = _FRAME.unpack(self._read(place, place + _FRAME.size))
        start = place + _FRAME.size
        if start + length > end or length < _CHUNK_SIZES.size or self._effort < length:
            return False
        _, checksum, name = _CHUNK_SIZES.unpack(self._read(start, start + _CHUNK_SIZES.size))
        if not checksum or name > len("zstd"):
            return False
        self._effort -= length
        try:
            _decompress(_parse_chunk(self._read(start, start + length)))
        except DamageError:
            return False
        return True

    def _note(self, start: int, end: int, reason: str, *, has_data: bool) -> None:
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

    def _read(self, start: int, end: int) -> bytes:
        """Return the bytes of the file from one place to before another."""
        if end - start > MAX_SIZE:
            raise DamageError(f"a record at byte {start} claims to have {end - start} byte")
        self._file.seek(start)
        data = self._file.read(max(end - start, 0))
        if len(data) < end - start:
            raise DamageError(f"the file ends within the record at byte {start}")
        return data

    @contextlib.contextmanager
    def _named(self) -> Iterator[None]:
        """Give every problem with the file its name."""
        try:
            yield
        except DamageError as error:
            raise FileError(
                f"{self.path} is damaged: {error}; `impact-rig recover` saves what is left of it"
            ) from None
        except MemoryError:
            raise FileError(f"{self.path} cannot be read: it asks for too much memory") from None
        except OSError as error:
            raise FileError(f"{self.path} cannot be read: {error.strerror}") from None


def _open(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except FileNotFoundError:
        raise FileError(f"there is no file {path}") from None
    except IsADirectoryError:
        raise FileError(f"{path} is a folder: name the .mcap file in it") from None
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror}") from None


def _parse(record_class: Any, content: bytes) -> Any:
    """Return a small record; None: its bytes are not those of one.

    The record written again must be the bytes that were read: a length that points anywhere else
    is found out. An attachment's checksum is checked on the way.
    """
    try:
        record = record_class.read(ReadDataStream(io.BytesIO(content)))
        builder = RecordBuilder()
        record.write(builder)
    except _ERRORS:
        return None
    written = builder.end()[_FRAME.size :]
    if record_class is records.Attachment and content.endswith(bytes(4)):
        written = written[:-4]
    # Later versions of the format may add fields at the end of a record.
    return record if content.startswith(written) else None


def _list_places(content: bytes) -> dict[int, set[tuple[int, int]]]:
    """Return log time and place of each message of a chunk, by channel, as its index does."""
    places: dict[int, set[tuple[int, int]]] = defaultdict(set)
    place = 0
    while place < len(content):
        before = place
        kind, begin, place = _read_record_head(content, before)
        if kind == Opcode.MESSAGE:
            number, _, log_time, _ = _MESSAGE.unpack_from(content, begin)
            places[number].add((log_time, before))
    return places


def _read_record_head(content: bytes, place: int) -> tuple[int, int, int]:
    """Return kind, start and end of the content of the record at a place in a chunk."""
    if place + _FRAME.size > len(content):
        raise DamageError("a record has no whole head")
    kind, length = _FRAME.unpack_from(content, place)
    start = place + _FRAME.size
    if start + length > len(content):
        raise DamageError("a record is longer than what it is in")
    if kind == Opcode.MESSAGE and length < _MESSAGE.size:
        raise DamageError("a message is shorter than its head")
    return kind, start, start + length


def _parse_chunk(content: bytes) -> records.Chunk:
    stream = ReadDataStream(io.BytesIO(content))
    try:
        chunk: records.Chunk = records.Chunk.read(stream)
    except _ERRORS:
        raise DamageError("the head of a chunk makes no sense") from None
    place = _CHUNK_SIZES.size + len(chunk.compression.encode())
    # The library reads as far as there is something.
    if int.from_bytes(content[place : place + 8], "little") != len(chunk.data):
        raise DamageError("the head of a chunk makes no sense")
    return chunk


def _decompress(chunk: records.Chunk) -> bytes:
    """Return the records of a chunk; no more is taken into memory than it states."""
    data, size = chunk.data, chunk.uncompressed_size
    if size > min(MAX_SIZE, max(FREE_SIZE, MAX_RATIO * len(data))):
        raise DamageError(f"a chunk of {len(data)} byte claims to hold {size}")
    try:
        if chunk.compression == "zstd":
            if zstandard.frame_content_size(data) not in (-1, size):
                raise DamageError(f"a chunk should hold {size} byte: its data state another size")
            content = zstandard.ZstdDecompressor().decompress(data, max_output_size=max(size, 1))
        elif chunk.compression == "lz4":
            engine = lz4.frame.LZ4FrameDecompressor()
            content = engine.decompress(data, max_length=size + 1)
        elif chunk.compression in ("", "none"):
            content = data
        else:
            raise DamageError(
                f"a chunk is compressed by {chunk.compression[:32]!r}: it must be zstd or lz4"
            )
    except _ENGINE_ERRORS as error:
        reason = str(error) or type(error).__name__
        raise DamageError(f"a chunk cannot be decompressed: {reason}") from None
    if len(content) != size:
        raise DamageError(f"a chunk holds {len(content)} byte: it should hold {size}")
    if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
        raise DamageError("a chunk does not fit its checksum")
    return content
