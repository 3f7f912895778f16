"""Writes messages that are already serialised to an MCAP file of profile `ros2`."""

import errno
import os
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from impact_rig.core.errors import FileError, ParameterError
from impact_rig.recording.mcap_format import MAGIC, MESSAGE_HEAD, RECORD_HEAD, Opcode
from impact_rig.recording.mcap_packing import (
    ChunkSummary,
    pack_channel,
    pack_chunk,
    pack_ending,
    pack_header,
    pack_message_index,
    pack_schema,
)
from impact_rig.recording.message_definitions import MessageDefinition
from impact_rig.recording.qos_profiles import OfferedQos, format_offered_qos

COMPRESSIONS = ("zstd", "lz4", "none")
"""How chunks may be compressed."""
ZSTD_LEVEL = 1
"""Our choice: counts of a digitizer pack nearly as well as at the default level, in half the
time."""
ROOM_FOR_ENDING = 1 << 20
"""What is left free on the disk for the end of the file [byte], our choice: the index of ten
thousand chunks."""
DEFAULT_CHUNK_SIZE = 1 << 20
"""Uncompressed size at which a chunk is finished [byte]; what other MCAP writers use."""


class McapWriter:
    """A recording in the making.

    Finished chunks are on their way to the disk at once; when the disk is full or fails, what was
    written before stays a good file.

    Parameters
    ----------
    path : Path
        Of the new file; it must not exist, its folder must.
    compression : str
        One of `COMPRESSIONS`.
    chunk_size : int
        Uncompressed size at which a chunk is finished [byte].
    library : str
        What wrote the file, kept in it.

    Raises
    ------
    ParameterError
        If the compression is unknown or the chunk size is not positive.
    FileError
        If the file exists already or cannot be created.
    """

    def __init__(
        self,
        path: Path,
        *,
        compression: str = "zstd",
        chunk_size: int = DEFAULT_CHUNK_SIZE,
        library: str = "impact_rig",
    ) -> None:
        self._compress = _make_compressor(compression)
        if chunk_size < 1:
            raise ParameterError(f"chunk size is {chunk_size} byte: it must be positive")
        self.path = path
        self._compression = "" if compression == "none" else compression
        self._chunk_size = chunk_size
        self._schemas: dict[str, bytes] = {}
        self._channels: list[bytes] = []
        self._sequences: list[int] = []
        self._chunks: list[ChunkSummary] = []
        self._buffer = bytearray()
        self._index: dict[int, list[int]] = {}
        self._size = 0
        self._finished_messages = 0
        self._pending_messages = 0
        try:
            self._file = open(path, "xb", buffering=0)  # noqa: SIM115
        except FileExistsError:
            raise FileError(
                f"{path} exists already: a recording is never overwritten, name another file"
            ) from None
        except OSError as error:
            raise FileError(f"{path} cannot be created: {error.strerror}") from None
        try:
            self._write(MAGIC + pack_header("ros2", library))
        except FileError:
            self._file.close()
            path.unlink(missing_ok=True)
            raise

    @property
    def messages(self) -> int:
        """Messages in the file, those of the unfinished chunk included."""
        return self._finished_messages + self._pending_messages

    @property
    def size(self) -> int:
        """Bytes written so far, the unfinished chunk not included."""
        return self._size

    @property
    def closed(self) -> bool:
        """Whether the file is finished."""
        return self._file.closed

    def add_channel(
        self, topic: str, definition: MessageDefinition, qos: tuple[OfferedQos, ...]
    ) -> int:
        """Announce a topic.

        Parameters
        ----------
        topic : str
            Full name.
        definition : MessageDefinition
            Of its type.
        qos : tuple of OfferedQos
            What its publishers offer.

        Returns
        -------
        int
            Number of the channel, for `add_message`.
        """
        if definition.type_name not in self._schemas:
            schema = pack_schema(
                len(self._schemas) + 1, definition.type_name, "ros2msg", definition.text
            )
            self._schemas[definition.type_name] = schema
            self._buffer += schema
        channel = pack_channel(
            len(self._channels) + 1,
            list(self._schemas).index(definition.type_name) + 1,
            topic,
            "cdr",
            {
                "offered_qos_profiles": format_offered_qos(qos),
                "topic_type_hash": definition.type_hash,
            },
        )
        self._channels.append(channel)
        self._sequences.append(0)
        self._buffer += channel
        return len(self._channels)

    def add_message(self, channel: int, data: bytes, log_time: int, publish_time: int) -> None:
        """Add a message; it reaches the disk when its chunk is finished.

        Parameters
        ----------
        channel : int
            As returned by `add_channel`.
        data : bytes
            Serialised message.
        log_time, publish_time : int
            When it was received and sent, nanoseconds since the epoch.

        Raises
        ------
        FileError
            If the chunk is full and cannot be written, or would leave no room for the end of the
            file; it is dropped, what was written before stays.
        """
        sequence = self._sequences[channel - 1]
        self._sequences[channel - 1] = (sequence + 1) & 0xFFFFFFFF
        self._index.setdefault(channel, []).extend((log_time, len(self._buffer)))
        self._buffer += RECORD_HEAD.pack(Opcode.MESSAGE, MESSAGE_HEAD.size + len(data))
        self._buffer += MESSAGE_HEAD.pack(channel, sequence, log_time, publish_time)
        self._buffer += data
        self._pending_messages += 1
        if len(self._buffer) >= self._chunk_size:
            self.flush()

    def flush(self) -> None:
        """Finish the chunk in progress, if it holds a message; raises as `add_message`."""
        if not self._index:
            return
        records, index, pending = self._buffer, self._index, self._pending_messages
        self._buffer, self._index, self._pending_messages = bytearray(), {}, 0
        packed = self._compress(records)
        times = [time for entries in index.values() for time in entries[::2]]
        chunk = pack_chunk(records, self._compression, packed, min(times), max(times))
        start = self._size
        pieces, offsets, position = [chunk], {}, start + len(chunk)
        for channel, entries in index.items():
            pieces.append(pack_message_index(channel, entries))
            offsets[channel] = position
            position += len(pieces[-1])
        self._check_room(position - start)
        self._write(b"".join(pieces))
        self._finished_messages += pending
        self._chunks.append(
            ChunkSummary(
                start=start,
                length=len(chunk),
                index_offsets=offsets,
                index_length=position - start - len(chunk),
                first_time=min(times),
                last_time=max(times),
                compression=self._compression,
                compressed_size=len(packed),
                size=len(records),
                counts={channel: len(entries) // 2 for channel, entries in index.items()},
            )
        )

    def close(self) -> None:
        """Finish the file and put it on disk; safe to call twice.

        Raises
        ------
        FileError
            If the last chunk or the index could not be written; all chunks before are kept.
        """
        if self._file.closed:
            return
        problems = []
        try:
            self.flush()
        except FileError as error:
            problems.append(error)
        try:
            ending = pack_ending(
                self._size, list(self._schemas.values()), self._channels, self._chunks
            )
            self._write(ending)
            os.fsync(self._file.fileno())
        except FileError as error:
            problems.append(error)
        except OSError as error:
            problems.append(FileError(f"{self.path} cannot be synchronised: {error.strerror}"))
        finally:
            self._file.close()
        if problems:
            raise problems[0]

    def __enter__(self) -> Self:
        """Return the writer itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Finish the file, whatever happened."""
        self.close()

    def _check_room(self, length: int) -> None:
        try:
            state = os.fstatvfs(self._file.fileno())
        except OSError:
            return
        if state.f_bavail * state.f_frsize < length + ROOM_FOR_ENDING:
            raise self._make_error(os.strerror(errno.ENOSPC))

    def _make_error(self, reason: str | None) -> FileError:
        return FileError(
            f"{self.path} cannot be written: {reason}; it keeps the"
            f" {self._finished_messages} messages written before"
        )

    def _write(self, data: bytes) -> None:
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            try:
                self._file.seek(self._size)
                self._file.truncate()
            except OSError:
                pass
            raise self._make_error(error.strerror) from None
        self._size += len(data)


def _make_compressor(name: str) -> Callable[[bytearray], bytes]:
    if name == "zstd":
        import zstandard

        return zstandard.ZstdCompressor(level=ZSTD_LEVEL).compress
    if name == "lz4":
        import lz4.frame

        return lambda data: bytes(lz4.frame.compress(data))
    if name == "none":
        return bytes
    raise ParameterError(f"compression is {name!r}: it must be one of {', '.join(COMPRESSIONS)}")
