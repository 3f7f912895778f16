"""The reader of MCAP files: each pass goes from record to record, by the library `mcap`.

A strict scan raises at the first damage. A tolerant one notes it and goes on behind it, at the
next record. The index at the end is not needed: a recording that was never closed reads as well.
"""

import contextlib
import io
import os
import re
import zlib
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterator
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.summary import Summary

from impact_rig.core.given.errors import FileError
from impact_rig.recordings.new_file import is_being_written, open_regular
from impact_rig.recordings.records import (
    RECORDER,
    ROS,
    Attachment,
    Channel,
    Encoding,
    Item,
    MetadataRecord,
    RawMessage,
)
from impact_rig.recordings.unpacking import (
    FRAME,
    MAX_SIZE,
    MESSAGE,
    PARSE_ERRORS,
    DamageError,
    Unpacker,
    read_bytes,
    read_frame,
    read_head,
    read_inner_head,
    read_record,
)

MAGIC = b"\x89MCAP0\r\n"
"""First and last bytes of every file."""
PROFILES = ("ros2", "")
"""Profiles of recordings of ROS 2; tools that merge or filter leave it empty."""
MAX_NAME = 512
"""Longest name of a topic or a type [characters], our choice: DDS takes 255."""
MAX_DAMAGES = 1000
"""How many damaged places are listed, our choice: further ones are added to the last."""
MAX_SEARCH = 4
"""How often the bytes of a file may be looked at in search of the next chunk [-], our choice."""

_FOOTER_SIZE = FRAME.size + 20
_CHUNK_START = re.compile(rb"(?s)\x06(?=.{5}\x00{3})")
"""How a chunk begins: its kind, and a length below a terabyte."""
_WINDOW = 1 << 20
_START_TIMES: dict[int, int] = {Opcode.CHUNK: 0, Opcode.MESSAGE: 6}
"""Where records have the time of their first message [byte]."""
_LOG_TIME = attrgetter("log_time")

Wanted = Callable[[Channel], bool]
"""Tells whether a channel's messages are to be read."""
Report = Callable[[int], None]
"""Gets now and then how far the file was read [byte]."""


class Damage(NamedTuple):
    """Bytes that could not be read."""

    start: int  # [byte]
    size: int  # [byte]; 0: nothing is lost by it
    reason: str  # in words

    def __str__(self) -> str:
        """Return in words what cannot be read, and where."""
        if not self.size:
            return f"{self.reason} (at byte {self.start})"
        return f"{self.reason} ({self.size} byte from byte {self.start})"


def describe_profile(path: Path, profile: str) -> str:
    """Return in words that a file is of another profile than ROS 2's."""
    return f"{path} is an MCAP file of profile {profile!r}: it should be {PROFILES[0]!r}"


class Scan:
    """An MCAP file. It keeps nothing of its readings, so that many may read it at once.

    Parameters
    ----------
    is_strict : bool
        Whether the first damage is an error; what breaks at the very end of a file that was
        never closed was cut off there, and is none.
    encodings : collection
        Which ones of messages and schema a strict scan lets pass.
    by_time : bool
        Put messages in the order of their log times, if another program than the rig's recorder
        wrote them: the format allows any.

    Raises
    ------
    FileError
        If there is no such file or it cannot be read, and, if strict, is no recording of ROS 2.
        So does every method; if strict, also at the first damage, and if a wanted channel is in
        another encoding.
    """

    def __init__(
        self,
        path: Path,
        *,
        is_strict: bool = True,
        encodings: Collection[Encoding] = (ROS,),
        by_time: bool = False,
    ) -> None:
        self.path = path
        self.is_strict = is_strict
        self.encodings = encodings
        with open_file(path) as file:
            self.size: int = os.fstat(file.fileno()).st_size  # as it was opened [byte]
            tail = read_bytes(file, max(self.size - len(MAGIC), 0), self.size)
            self.is_closed = self.size > len(MAGIC) and tail == MAGIC
            self.is_live = not self.is_closed and is_being_written(file)
            self.end = self.size - len(MAGIC) if self.is_closed else self.size
            self.header, self.first = self._read_header(file)
            self.summary = self._read_summary(file)  # the index; None: none can be used
            self.statistics = self.summary.statistics if self.summary is not None else None
            self.by_time = by_time and not self.is_of_recorder
            self.read()  # what the index describes makes sense

    @property
    def is_of_recorder(self) -> bool:
        """Whether the rig's recorder wrote it, which numbers messages without gaps."""
        return self.header is not None and self.header.library.split(" ")[0] == RECORDER

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences about a sound file."""
        if self.is_closed:
            return ()
        state = "is being recorded" if self.is_live else "was never closed"
        return (f"{self.path} {state}: it is read up to the last message that is whole",)

    def read(
        self,
        wanted: Wanted = lambda _: True,
        report: Report = lambda _: None,
        *,
        with_rest: bool = True,
    ) -> "Pass":
        """Return what yields all that is whole, in file order.

        Parameters
        ----------
        wanted : callable
            Asked once for each channel.
        with_rest : bool
            Read metadata and attachments as well.
        """
        return Pass(self, wanted, report, with_rest=with_rest)

    def read_messages(
        self, wanted: Wanted = lambda _: True, report: Report = lambda _: None
    ) -> Iterator[RawMessage]:
        """Yield the messages alone, as `read`."""
        for item in self.read(wanted, report, with_rest=False):
            if isinstance(item, RawMessage):
                yield item

    def read_channels(self) -> tuple[Channel, ...]:
        """Return all topics: from the index, or else by reading all."""
        return tuple(self._channels.values())

    @cached_property
    def moved(self) -> dict[int, tuple[int, int, int]]:
        """Start time, start and end of the chunk or message to be read at the place of each."""
        found, place = [], self.first
        with open_file(self.path) as file, contextlib.suppress(DamageError):
            while place < self.end:
                kind, after = read_head(file, place, self.end)
                if kind in _START_TIMES:
                    start = place + FRAME.size + _START_TIMES[kind]
                    time = int.from_bytes(read_bytes(file, start, start + 8), "little")
                    found.append((time, place, after))
                place = after
        return dict(zip((place for _, place, _ in found), sorted(found), strict=True))

    @cached_property
    def _channels(self) -> dict[int, Channel]:
        scan = self.read(lambda _: False, with_rest=False)
        scan.by_time = False
        if not scan.channels:
            for _ in scan:
                pass
        return scan.channels

    def counts_none(self, wanted: Wanted) -> bool:
        """Return whether the index says that no message of some channels is in the file."""
        # Without any count the index does not say; the format allows it.
        counts = self.statistics and self.statistics.channel_message_counts
        found = filter(wanted, self.read_channels())
        return not any(not counts or counts.get(channel.id, 0) for channel in found)

    def read_time_range(self) -> tuple[int, int]:
        """Return the log times of the first and last message [ns since the epoch].

        Raises
        ------
        FileError
            Also if there is no message.
        """
        if self.statistics is not None and self.statistics.message_count:
            return self.statistics.message_start_time, self.statistics.message_end_time
        times = [message.log_time for message in self.read_messages()]
        if not times:
            raise FileError(f"{self.path} holds no message")
        return min(times), max(times)

    def _read_header(self, file: BinaryIO) -> tuple[records.Header | None, int]:
        """Return the header, and where the first record after it begins."""
        if not self.size:
            raise FileError(f"{self.path} is empty: it should be an MCAP recording")
        has_magic = read_bytes(file, 0, min(len(MAGIC), self.size)) == MAGIC
        header, after = None, 0
        with contextlib.suppress(DamageError):
            kind, after = read_head(file, len(MAGIC), self.end)
            if has_magic and kind == Opcode.HEADER:
                header = read_record(read_bytes(file, len(MAGIC), after), len(MAGIC))
        if self.is_strict:
            if not has_magic:
                raise FileError(f"{self.path} is no MCAP recording: it does not begin like one")
            if header is None:
                raise FileError(f"{self.path} is damaged: its header is cut off or cannot be read")
            if header.profile not in PROFILES:
                raise FileError(describe_profile(self.path, header.profile))
        return header, after

    def _read_summary(self, file: BinaryIO) -> Summary | None:
        """Read the index: without a checksum only its topics, with a wrong one nothing."""
        tail_start = self.end - _FOOTER_SIZE
        if not self.is_closed or tail_start <= len(MAGIC):
            return None
        try:
            tail = read_bytes(file, tail_start, self.size)
            footer = records.Footer.read(ReadDataStream(io.BytesIO(tail[FRAME.size :])))
            if not len(MAGIC) < footer.summary_start <= tail_start:
                return None
            section = read_bytes(file, footer.summary_start, tail_start)
            checksum = zlib.crc32(tail[: _FOOTER_SIZE - 4], zlib.crc32(section))
            if footer.summary_crc not in (0, checksum):
                return None
            file.seek(0)
            summary = SeekingReader(file, record_size_limit=MAX_SIZE).get_summary()
        except (DamageError, *PARSE_ERRORS):
            return None
        if summary is not None and not footer.summary_crc:
            summary.statistics = None
        return summary


class Pass:
    """One reading of a file, from record to record, with one chunk in memory at a time.

    Iterating yields what is whole, once; the attributes tell what was met so far.
    """

    def __init__(self, scan: Scan, wanted: Wanted, report: Report, *, with_rest: bool) -> None:
        self.scan = scan
        self.channels: dict[int, Channel] = {}  # all that were described so far, by number
        self.damages: list[Damage] = []
        self.unknown = 0  # messages of channels that are not described
        self.uncounted = 0  # messages beyond those that the index counts
        self.chunks: dict[int, int] = {}  # their sizes by where they begin [byte]
        self.by_time = scan.by_time
        self._wanted, self._report, self._with_rest = wanted, report, with_rest
        self._chosen: dict[int, Channel | None] = {}  # channels that were met; None: not wanted
        self._schemas: dict[int, records.Schema] = {}
        self._known: dict[int, records.Channel] = {}  # descriptions of channels, as they were read
        self._unpacker = Unpacker(scan.size)
        self._waiting: list[RawMessage] = []  # for earlier ones, in the order of time
        self._search_room = MAX_SEARCH * scan.size
        if scan.summary is not None:
            self._schemas |= scan.summary.schemas
            for channel in scan.summary.channels.values():
                self._add_channel(channel)

    def __iter__(self) -> Iterator[Item]:
        """Yield messages, and, if they are wanted, metadata and attachments, in their order."""
        if self.by_time:
            self.channels |= {channel.id: channel for channel in self.scan.read_channels()}
        yield from self._read_all()
        yield from self._waiting

    def _read_all(self) -> Iterator[Item]:
        scan = self.scan
        with open_file(scan.path) as file:
            place = scan.first
            if scan.header is None:
                place = self._pass_over(file, 0, "the file does not begin like one of MCAP")
            while place < scan.end:
                try:
                    kind, after = read_head(file, place, scan.end)
                    if kind in (Opcode.DATA_END, Opcode.FOOTER):
                        is_index = kind == Opcode.DATA_END and after + _FOOTER_SIZE != scan.end
                        if is_index and scan.is_closed and scan.summary is None:
                            self._note(after, scan.size, "the index at the end cannot be used")
                        return
                    if kind != Opcode.MESSAGE_INDEX:
                        yield from self._read_record(file, kind, place, after)
                        self._report(after)
                except DamageError as error:
                    after = self._pass_over(file, place, str(error))
                place = after

    def _read_record(self, file: BinaryIO, kind: int, place: int, after: int) -> Iterator[Item]:
        if kind in _START_TIMES:
            if kind == Opcode.CHUNK:
                self.chunks[place] = after - place
            if not self.by_time:
                yield from self._read_messages(self._read_content(file, kind, place, after))
                return
            start, place, after = self.scan.moved.get(place, (0, place, after))
            waiting = self._waiting
            ready = bisect_right(waiting, start, key=_LOG_TIME)
            yield from waiting[:ready]
            del waiting[:ready]
            kind, _ = read_head(file, place, after)
            waiting += self._read_messages(self._read_content(file, kind, place, after))
            waiting.sort(key=_LOG_TIME)
            if sum(len(message.data) for message in waiting) > MAX_SIZE:
                raise FileError(
                    f"{self.scan.path}: its messages are too far from the order of time to be put"
                    " in it: `mcap sort` does it"
                )
        elif kind in (Opcode.SCHEMA, Opcode.CHANNEL):
            self._describe(read_record(read_bytes(file, place, after), place))
        elif kind in (Opcode.METADATA, Opcode.ATTACHMENT) and self._with_rest:
            record = read_record(read_bytes(file, place, after), place)
            yield (
                MetadataRecord(record.name, dict(record.metadata))
                if kind == Opcode.METADATA
                else Attachment(record.name, record.media_type, record.log_time, record.data)
            )

    def _read_content(self, file: BinaryIO, kind: int, place: int, after: int) -> bytes:
        """Return records; nothing of a packed chunk is kept meanwhile."""
        content = read_bytes(file, place, after)
        is_chunk = kind == Opcode.CHUNK
        return self._unpacker.unpack(read_record(content, place)) if is_chunk else content

    def _read_messages(self, content: bytes) -> Iterator[RawMessage]:
        """Yield the wanted messages among records that follow each other.

        The library takes three times as long for the messages of all topics, of which most are
        not wanted.
        """
        place, size, chosen = 0, len(content), self._chosen
        head_size, unpack = MESSAGE.size, MESSAGE.unpack_from
        while place < size:
            self._unpacker.count_records(1)
            start = place
            kind, begin, place = read_inner_head(content, start)
            if kind != Opcode.MESSAGE:
                if kind not in (Opcode.SCHEMA, Opcode.CHANNEL):
                    raise DamageError("a chunk holds what is no message")
                self._describe(read_record(content[start:place], start))
                continue
            number, sequence, log_time, publish_time = unpack(content, begin)
            if number not in chosen:
                if number not in self.channels:
                    if self.scan.is_strict:
                        raise DamageError("a message belongs to a channel that is not announced")
                    self.unknown += 1
                    continue
                chosen[number] = self._choose(self.channels[number])
            channel = chosen[number]
            if channel is not None:
                data = content[begin + head_size : place]
                yield RawMessage(channel, sequence, log_time, publish_time, data)

    def _choose(self, channel: Channel) -> Channel | None:
        """Return a channel if its messages are wanted."""
        if not self._wanted(channel):
            return None
        if self.scan.is_strict and channel.encoding not in self.scan.encodings:
            raise FileError(
                f"{self.scan.path}: topic {channel.topic!r} is in {channel.encoding[0]!r} with a"
                f" schema in {channel.encoding[1]!r}: {' and '.join(map(repr, ROS))} can be read"
            )
        return channel

    def _describe(self, record: Any) -> None:
        """Take the description of a type or of a topic."""
        if isinstance(record, records.Channel):
            self._add_channel(record)
        elif self._schemas.setdefault(record.id, record) != record:
            raise DamageError(f"the type {record.name!r} is described in two ways")

    def _add_channel(self, record: records.Channel) -> None:
        if self._known.get(record.id) == record:
            return
        schema = self._schemas.get(record.schema_id)
        if schema is None:
            if record.schema_id:
                raise DamageError(f"topic {record.topic!r} has no schema")
            schema = records.Schema(id=0, name="", encoding="", data=b"")
        channel = Channel(
            id=record.id,
            topic=record.topic,
            type_name=schema.name,
            schema=schema.data.decode(errors="surrogateescape"),
            metadata=dict(record.metadata),
            encoding=(record.message_encoding, schema.encoding),
        )
        if not all(len(name) <= MAX_NAME and name.isprintable() for name in channel[1:3]):
            raise DamageError("the name of a topic or of its type makes no sense")
        if self.channels.setdefault(channel.id, channel) != channel:
            raise DamageError(f"topic {record.topic!r} is described in two ways")
        self._known[record.id] = record

    def _pass_over(self, file: BinaryIO, place: int, reason: str) -> int:
        """Return where reading goes on after a damage; raise it in a strict scan."""
        scan = self.scan
        kind, after = read_frame(file, place, scan.end)
        if scan.is_strict:
            # What is longer than anything that is written was not cut off.
            if after - place <= MAX_SIZE and self._is_cut_off(file, after if kind else place):
                return scan.size
            raise DamageError(reason)
        if not self._has_records(file, after):
            after = self._find_chunk(file, place + 1)
        is_end = after == scan.size and not scan.is_closed
        if not (is_end and scan.is_live):
            self._note(place, after, "the last record is cut off" if is_end else reason)
        return after

    def _has_records(self, file: BinaryIO, place: int) -> bool:
        """Return whether two records follow at a place; after a wrong length one may seem to."""
        with contextlib.suppress(DamageError):
            for _ in range(2):
                if place != self.scan.end:
                    _, place = read_head(file, place, self.scan.end)
            return True
        return False

    def _is_cut_off(self, file: BinaryIO, place: int) -> bool:
        """Return whether nothing follows in a file that was never closed.

        Where the power failed, the file system may have filled it up with zeros.
        """
        size = self.scan.size
        return not self.scan.is_closed and not any(
            read_bytes(file, start, min(start + _WINDOW, size)).strip(b"\0")
            for start in range(min(place, size), size, _WINDOW)
        )

    def _find_chunk(self, file: BinaryIO, place: int) -> int:
        """Return where the next chunk begins that its checksum vouches for, or the data end."""
        end = self.scan.end
        while place < end:
            window = read_bytes(file, place, min(place + _WINDOW, end))
            for match in _CHUNK_START.finditer(window):
                if self._is_chunk(file, place + match.start()):
                    return place + match.start()
            # A chunk may begin in the last bytes of what was searched.
            place += max(len(window) - FRAME.size + 1, 1)
        return end

    def _is_chunk(self, file: BinaryIO, place: int) -> bool:
        _, after = read_frame(file, place, self.scan.end)
        if after > self.scan.end or after - place > self._search_room:
            return False
        self._search_room -= after - place
        try:
            chunk = read_record(read_bytes(file, place, after), place)
            return bool(chunk.uncompressed_crc and self._unpacker.unpack(chunk))
        except DamageError:
            return False

    def _note(self, start: int, end: int, reason: str) -> None:
        damage = Damage(start, max(end - start, 0), reason)
        if len(self.damages) < MAX_DAMAGES:
            self.damages.append(damage)
        else:
            self.damages[-1] = self.damages[-1]._replace(size=self.damages[-1].size + damage.size)


@contextlib.contextmanager
def open_file(path: Path) -> Iterator[BinaryIO]:
    """Open a file, give every problem with it its name, and tell what saves the rest."""
    try:
        with open_regular(path) as file:
            yield file
    except DamageError as error:
        raise FileError(
            f"{path} is damaged: {error}; `impact-rig export {path} -o sound.mcap` saves what is"
            " left of it"
        ) from None
    except MemoryError:
        raise FileError(f"{path} cannot be read: it asks for too much memory") from None
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror}") from None
