"""A recording in several files: a folder as rosbag2 writes it."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TypeVar

from impact_rig.core.errors import FileError
from impact_rig.recording.bag_files import find_bag_files
from impact_rig.recording.mcap_file import (
    Attachment,
    Channel,
    McapFile,
    MetadataRecord,
    RawMessage,
)
from impact_rig.recording.qos_profiles import choose_qos, parse_offered_qos

_T = TypeVar("_T")


class BagFolder:
    """The files of a folder as one recording.

    What the recorder repeats at the beginning of each file, so that it can be read alone, comes
    only once here.

    Parameters
    ----------
    path : Path
        Of the folder.

    Raises
    ------
    FileError
        If it holds no `.mcap` file, or one of them is no recording of ROS 2.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        files, missing = find_bag_files(path)
        self._parts, self._problems = _open_files(files)
        self._problems = [
            *(f"{path / name} is missing: what it held is lost" for name in missing),
            *self._problems,
        ]
        self._numbers: dict[tuple[str, str, str], int] = {}

    @property
    def files(self) -> tuple[Path, ...]:
        """Its files, in their order."""
        return tuple(part.path for part in self._parts)

    @property
    def is_complete(self) -> bool:
        """Whether every file is there and was closed."""
        return not self._problems and all(part.is_complete for part in self._parts)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the reader should know, in words; empty: nothing."""
        return (*self._problems, *(text for part in self._parts for text in part.warnings))

    def read_channels(self) -> tuple[Channel, ...]:
        """Return all topics; one with the same schema has the same number in all files."""
        channels: dict[int, Channel] = {}
        for part in self._parts:
            for channel in map(self._unify, part.read_channels()):
                channels.setdefault(channel.id, channel)
        return tuple(channels.values())

    def read_messages(
        self,
        wanted: Callable[[Channel], bool] = lambda _: True,
        *,
        start_time: int | None = None,
        end_time: int | None = None,
    ) -> Iterator[RawMessage]:
        """Yield messages, one file after the other; see `McapFile.read_messages`.

        A latched topic's first message in a file is left out where it is byte for byte its last
        one in the files before: it was repeated there.
        """
        latched: dict[int, bytes] = {}
        for part in self._parts:
            channels: dict[int, Channel] = {}

            def is_wanted(channel: Channel, channels: dict[int, Channel] = channels) -> bool:
                channels[channel.id] = self._unify(channel)
                return wanted(channels[channel.id])

            met: set[int] = set()
            for raw in part.read_messages(is_wanted, start_time=start_time, end_time=end_time):
                channel = channels[raw.channel.id]
                is_repeated = channel.id not in met and latched.get(channel.id) == raw.data
                met.add(channel.id)
                if channel.id in latched or _is_latched(channel):
                    latched[channel.id] = raw.data
                if not is_repeated:
                    yield raw._replace(channel=channel)

    def read_metadata(self) -> tuple[MetadataRecord, ...]:
        """Return what was noted beside the messages, each once."""
        return _drop_repeated(record for part in self._parts for record in part.read_metadata())

    def read_attachments(self) -> tuple[Attachment, ...]:
        """Return the files kept inside the recording, each once."""
        return _drop_repeated(item for part in self._parts for item in part.read_attachments())

    def _unify(self, channel: Channel) -> Channel:
        key = (channel.topic, channel.type_name, channel.schema)
        return channel._replace(id=self._numbers.setdefault(key, len(self._numbers) + 1))


def _open_files(files: tuple[Path, ...]) -> tuple[list[McapFile], list[str]]:
    """Open the files; the last of several may have been cut off before it held anything."""
    parts: list[McapFile] = []
    for path in files:
        try:
            parts.append(McapFile(path))
        except FileError as error:
            if path != files[-1] or not parts:
                raise
            return parts, [str(error)]
    return parts, []


def _is_latched(channel: Channel) -> bool:
    offers = parse_offered_qos(channel.metadata.get("offered_qos_profiles", ""))
    return choose_qos(offers).durability == "transient_local"


def _drop_repeated(items: Iterable[_T]) -> tuple[_T, ...]:
    kept: list[_T] = []
    for item in items:
        if item not in kept:
            kept.append(item)
    return tuple(kept)
