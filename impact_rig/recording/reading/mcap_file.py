"""Reads an MCAP file of profile `ros2` from front to back, as far as it goes.

The index at the end is not needed, so that a recording that was never closed reads as well; where
there is one, it tells which chunks need not be read.
"""

import contextlib
import os
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Attachment as AttachmentRecord
from mcap.records import Header, Metadata

from impact_rig.core.errors import FileError
from impact_rig.recording.interfaces.channel import Channel
from impact_rig.recording.reading.mcap_records import (
    FRAME_HEAD,
    MAGIC,
    MESSAGE_HEAD,
    DamageError,
    SmallT,
    find_records,
    read_small,
)
from impact_rig.recording.reading.mcap_summary import Summary, read_summary
from impact_rig.recording.reading.mcap_topics import TopicTable, Wanted
from impact_rig.recording.reading.mcap_walk import McapWalk
from impact_rig.recording.reading.raw_records import Attachment, MetadataRecord, RawMessage

_MESSAGE = int(Opcode.MESSAGE)
_MAX_HEADER = 1 << 20
"""Longest header [byte], our choice: it holds two short texts."""


class McapFile:
    """An MCAP file, checked to be one of ROS 2.

    Parameters
    ----------
    path : Path
        Of the file.

    Raises
    ------
    FileError
        If there is no such file, or it is none of MCAP with profile `ros2`.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with self._open() as file:
            self._size = os.fstat(file.fileno()).st_size
            self._check_start(file)
            file.seek(max(0, self._size - len(MAGIC)))
            self._is_complete = self._size > len(MAGIC) and file.read() == MAGIC

    @property
    def is_complete(self) -> bool:
        """Whether the recording was closed; if not, its end is missing."""
        return self._is_complete

    @property
    def files(self) -> tuple[Path, ...]:
        """The file itself."""
        return (self.path,)

    @property
    def size(self) -> int:
        """Of the file [byte]."""
        return self._size

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the reader should know, in words; empty: nothing."""
        if self._is_complete:
            return ()
        return (f"{self.path} was never closed: it is read up to the last message that is whole",)

    def read_channels(self) -> tuple[Channel, ...]:
        """Return all topics of the file: from its index, or else by reading all of it.

        Raises
        ------
        FileError
            If the file is damaged (other than cut off at its end).
        """
        table = TopicTable(self.path, lambda _: False)
        with self._walk() as walk:
            if self._summary is not None:
                table.add_summary(self._summary)
            if not table.channels:
                for _ in _find_messages(walk, table, {}):
                    pass
        return tuple(table.channels.values())

    def read_messages(
        self,
        wanted: Wanted = lambda _: True,
        *,
        start_time: int | None = None,
        end_time: int | None = None,
        report: Callable[[int], None] | None = None,
    ) -> Iterator[RawMessage]:
        """Yield messages in file order, one chunk in memory at a time.

        The checksum of each chunk that is read is checked. A chunk is not read where the index
        of the file, if its checksum vouches for it, tells that nothing wanted is in it.

        Parameters
        ----------
        wanted : callable
            Tells whether a channel's messages are to be yielded.
        start_time, end_time : int, optional
            Only messages logged from the one to before the other, nanoseconds since the epoch.
        report : callable, optional
            Is told now and then how far the file was read [byte].

        Raises
        ------
        FileError
            If the file is damaged (other than cut off at its end), or a wanted channel is not
            in `cdr`.
        """
        table = TopicTable(self.path, wanted)
        with self._walk() as walk:
            leaps = self._find_leaps(table, start_time, end_time)
            for message in _find_messages(walk, table, leaps, report):
                if _lies_between(message.log_time, start_time, end_time):
                    yield message

    def read_metadata(self) -> tuple[MetadataRecord, ...]:
        """Return what was noted beside the messages; raises as `read_channels`."""
        records = self._read_beside(Opcode.METADATA, Metadata)
        return tuple(MetadataRecord(record.name, dict(record.metadata)) for record in records)

    def read_attachments(self) -> tuple[Attachment, ...]:
        """Return the files kept inside the recording; raises as `read_channels`."""
        records = self._read_beside(Opcode.ATTACHMENT, AttachmentRecord)
        return tuple(
            Attachment(record.name, record.media_type, record.log_time, record.data)
            for record in records
        )

    @cached_property
    def _summary(self) -> Summary | None:
        if not self._is_complete:
            return None
        with self._open() as file:
            return read_summary(file, self._size)

    def _find_leaps(
        self, table: TopicTable, start_time: int | None, end_time: int | None
    ) -> dict[int, int]:
        """Return from where to where chunks lie that hold nothing wanted."""
        if self._summary is None or not self._summary.chunks:
            return {}
        table.add_summary(self._summary)
        chosen = {number for number, channel in table.chosen.items() if channel is not None}
        return {
            chunk.start: chunk.end
            for chunk in self._summary.chunks.values()
            # Without channels it is not known what the chunk holds.
            if chunk.channels
            and (
                chosen.isdisjoint(chunk.channels)
                or (start_time is not None and chunk.end_time < start_time)
                or (end_time is not None and chunk.start_time >= end_time)
            )
        }

    def _read_beside(self, kind: int, record_class: type[SmallT]) -> Iterator[SmallT]:
        """Yield the records of a kind that stand between the chunks."""
        chunks = self._summary.chunks.values() if self._summary is not None else ()
        with self._walk() as walk:
            for frame in walk.find_frames({chunk.start: chunk.end for chunk in chunks}):
                if frame.kind == kind:
                    yield walk.read_small(frame, record_class)

    def _open(self) -> BinaryIO:
        try:
            return self.path.open("rb")
        except FileNotFoundError:
            raise FileError(f"there is no file {self.path}") from None
        except IsADirectoryError:
            raise FileError(f"{self.path} is a folder: name the .mcap file in it") from None
        except OSError as error:
            raise FileError(f"{self.path} cannot be read: {error.strerror}") from None

    def _check_start(self, file: BinaryIO) -> None:
        if self._size == 0:
            raise FileError(f"{self.path} is empty: it should be an MCAP recording")
        if file.read(len(MAGIC)) != MAGIC:
            raise FileError(f"{self.path} is no MCAP recording: it does not begin like one")
        head = file.read(FRAME_HEAD.size)
        kind, length = FRAME_HEAD.unpack(head) if len(head) == FRAME_HEAD.size else (0, 0)
        content = file.read(min(length, _MAX_HEADER))
        if not head or len(content) < length:
            raise FileError(f"{self.path} holds no more than the beginning of an MCAP recording")
        if kind != Opcode.HEADER:
            raise FileError(f"{self.path} is damaged: it has no header")
        header = read_small(Header, content)
        if header is None:
            raise FileError(f"{self.path} is damaged: its header cannot be read")
        if header.profile != "ros2":
            raise FileError(
                f"{self.path} is an MCAP file of profile {header.profile!r}: it should be 'ros2'"
            )

    @contextlib.contextmanager
    def _walk(self) -> Iterator[McapWalk]:
        """Open the file, and give every problem with it the file's name."""
        try:
            with self._open() as file:
                yield McapWalk(file, self._size, is_complete=self._is_complete)
        except DamageError as error:
            raise FileError(
                f"{self.path} is damaged: {error}; `impact-rig recover` saves what is left of it"
            ) from None
        except MemoryError:
            raise FileError(f"{self.path} cannot be read: it asks for too much memory") from None
        except OSError as error:
            raise FileError(f"{self.path} cannot be read: {error.strerror}") from None


def _find_messages(
    walk: McapWalk,
    table: TopicTable,
    leaps: Mapping[int, int],
    report: Callable[[int], None] | None = None,
) -> Iterator[RawMessage]:
    chosen, unpack, head_size = table.chosen, MESSAGE_HEAD.unpack_from, MESSAGE_HEAD.size
    for frame in walk.find_frames(leaps):
        data = walk.read_records(frame)
        for kind, start, end in find_records(data):
            if kind == _MESSAGE:
                number, sequence, log_time, publish_time = unpack(data, start)
                if number not in chosen:
                    raise DamageError("a message belongs to a channel that is not announced")
                channel = chosen[number]
                if channel is not None:
                    content = data[start + head_size : end]
                    yield RawMessage(channel, sequence, log_time, publish_time, content)
            elif kind == Opcode.SCHEMA:
                table.add_schema(data[start:end])
            elif kind == Opcode.CHANNEL:
                table.add_channel(data[start:end])
        if report is not None:
            report(frame.end)


def _lies_between(time: int, start_time: int | None, end_time: int | None) -> bool:
    """Return whether a time lies from the one to before the other; None: no limit."""
    return (start_time is None or time >= start_time) and (end_time is None or time < end_time)
