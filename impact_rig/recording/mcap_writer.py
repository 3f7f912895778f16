"""Writes messages that are already serialised to an MCAP file of profile `ros2`."""

import errno
import os
from pathlib import Path
from types import TracebackType
from typing import Self

from mcap.writer import CompressionType, Writer

from impact_rig.core.errors import FileError, ParameterError
from impact_rig.recording.message_definitions import MessageDefinition
from impact_rig.recording.qos_profiles import OfferedQos, format_offered_qos

COMPRESSIONS = ("zstd", "lz4", "none")
"""How chunks may be compressed."""
ROOM_FOR_ENDING = 4 << 20
"""What is left free on the disk, beside one chunk, for the end of the file [byte], our choice:
the index of some ten thousand chunks."""
DEFAULT_CHUNK_SIZE = 1 << 20
"""Uncompressed size at which a chunk is finished [byte]; what other MCAP writers use."""


class _RawFile:
    """A new file, unbuffered, so that a finished chunk is on its way to the disk at once."""

    def __init__(self, path: Path) -> None:
        self.file = path.open("xb", buffering=0)
        self.size = 0

    def write(self, data: bytes) -> int:
        """Write all of `data`, or leave the file as it was."""
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[self.file.write(rest) :]
        except OSError:
            self.file.truncate(self.size)
            raise
        self.size += len(data)
        return len(data)

    def tell(self) -> int:
        """Return where the next bytes go."""
        return self.size

    def flush(self) -> None:
        """Do nothing: there is no buffer."""


class McapWriter:
    """A recording in the making.

    Finished chunks are on their way to the disk at once; before the disk is full the file is
    refused more, so that it can still be finished.

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
        kind = _find_compression(compression)
        if chunk_size < 1:
            raise ParameterError(f"chunk size is {chunk_size} byte: it must be positive")
        self.path = path
        self.messages = 0
        self._chunk_size = chunk_size
        self._unchecked = 0
        self._has_failed = False
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._sequences: dict[int, int] = {}
        try:
            self._output = _RawFile(path)
        except FileExistsError:
            raise FileError(
                f"{path} exists already: a recording is never overwritten, name another file"
            ) from None
        except OSError as error:
            raise FileError(f"{path} cannot be created: {error.strerror}") from None
        self._writer = Writer(self._output, chunk_size=chunk_size, compression=kind)  # type: ignore[arg-type]
        try:
            self._writer.start("ros2", library)
        except OSError as error:
            self._output.file.close()
            path.unlink(missing_ok=True)
            raise self._make_error(error) from None

    @property
    def size(self) -> int:
        """Bytes written so far, the unfinished chunk not included."""
        return self._output.size

    @property
    def closed(self) -> bool:
        """Whether the file is finished."""
        return self._output.file.closed

    def count_messages(self, topic: str) -> int:
        """Return how many messages of a topic were added."""
        return self._sequences.get(self._channels.get(topic, 0), 0)

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
        name = definition.type_name
        if name not in self._schemas:
            text = definition.text.encode()
            self._schemas[name] = self._writer.register_schema(name, "ros2msg", text)
        metadata = {
            "offered_qos_profiles": format_offered_qos(qos),
            "topic_type_hash": definition.type_hash,
        }
        self._channels[topic] = self._writer.register_channel(
            topic, "cdr", self._schemas[name], metadata
        )
        return self._channels[topic]

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
            If the disk is about to be full: the message is not taken, and the file can still be
            closed well. Or if a chunk could not be written: chunks before it stay.
        """
        self._check_room(len(data))
        sequence = self._sequences.get(channel, 0)
        try:
            self._writer.add_message(channel, log_time, data, publish_time, sequence)
        except OSError as error:
            self._has_failed = True
            raise self._make_error(error) from None
        self._sequences[channel] = (sequence + 1) & 0xFFFFFFFF
        self.messages += 1

    def flush(self) -> None:
        """Finish the chunk in progress, if it holds a message.

        Raises
        ------
        FileError
            If the chunk could not be written: chunks before it stay.
        """
        try:
            self._writer.flush()
        except OSError as error:
            self._has_failed = True
            raise self._make_error(error) from None

    def close(self) -> None:
        """Finish the file and put it on disk; safe to call twice.

        Raises
        ------
        FileError
            If the last chunk or the index could not be written; all chunks before are kept.
        """
        file = self._output.file
        if file.closed:
            return
        try:
            if not self._has_failed:
                self._writer.finish()
            os.fsync(file.fileno())
        except OSError as error:
            raise self._make_error(error) from None
        finally:
            file.close()

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
        """Look at the free space now and then: at least four times for each chunk."""
        self._unchecked += length
        if self._unchecked < self._chunk_size // 4:
            return
        self._unchecked = 0
        state = os.fstatvfs(self._output.file.fileno())
        if state.f_bavail * state.f_frsize < ROOM_FOR_ENDING + 2 * self._chunk_size + length:
            raise self._make_error(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))

    def _make_error(self, error: OSError) -> FileError:
        return FileError(
            f"{self.path} cannot be written: {error.strerror}; it keeps what was written before"
        )


def _find_compression(name: str) -> CompressionType:
    if name not in COMPRESSIONS:
        raise ParameterError(
            f"compression is {name!r}: it must be one of {', '.join(COMPRESSIONS)}"
        )
    return CompressionType[name.upper()]
