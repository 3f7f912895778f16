"""A recording in several files: a folder as rosbag2 writes it."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TypeVar

from impact_rig.core.errors import FileError
from impact_rig.recording.interfaces.channel import Channel
from impact_rig.recording.interfaces.qos_profiles import parse_offered_qos
from impact_rig.recording.reading.bag_files import find_bag_files
from impact_rig.recording.reading.mcap_file import McapFile
from impact_rig.recording.reading.mcap_topics import Wanted
from impact_rig.recording.reading.raw_records import Attachment, MetadataRecord, RawMessage

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
        self._channels: dict[tuple[str, str, str], Channel] = {}

    @property
    def files(self) -> tuple[Path, ...]:
        """Its files, in their order."""
        return tuple(part.path for part in self._parts)

    @property
    def size(self) -> int:
        """Of all files together [byte]."""
        return sum(part.size for part in self._parts)

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
        channels = {
            self._unify(channel).id: self._unify(channel)
            for part in self._parts
            for channel in part.read_channels()
        }
        return tuple(channels.values())

    def read_messages(
        self,
        wanted: Wanted = lambda _: True,
        *,
        start_time: int | None = None,
        end_time: int | None = None,
        report: Callable[[int], None] | None = None,
    ) -> Iterator[RawMessage]:
        """Yield messages, one file after the other; see `McapFile.read_messages`.

        A topic's first message in a file is left out where it is the last one of the files
        before: it was repeated there.
        """
        last: dict[int, RawMessage] = {}
        if start_time is not None:
            # What is repeated later on may have been told before.
            for _ in self._join(lambda it: _is_state(it) and wanted(it), last, None, start_time):
                pass
        yield from self._join(wanted, last, start_time, end_time, report)

    def read_metadata(self) -> tuple[MetadataRecord, ...]:
        """Return what was noted beside the messages, each once."""
        return _drop_repeated(record for part in self._parts for record in part.read_metadata())

    def read_attachments(self) -> tuple[Attachment, ...]:
        """Return the files kept inside the recording, each once."""
        return _drop_repeated(item for part in self._parts for item in part.read_attachments())

    def _join(
        self,
        wanted: Wanted,
        last: dict[int, RawMessage],
        start_time: int | None,
        end_time: int | None,
        report: Callable[[int], None] | None = None,
    ) -> Iterator[RawMessage]:
        """Yield the messages of the files; keep the last one of each channel in `last`."""
        sizes = [part.size for part in self._parts]
        for place, part in enumerate(self._parts):
            unified: dict[int, Channel] = {}
            before = sum(sizes[:place])

            def report_part(done: int, before: int = before) -> None:
                if report is not None:
                    report(before + done)

            def is_wanted(channel: Channel, unified: dict[int, Channel] = unified) -> bool:
                unified[channel.id] = self._unify(channel)
                return wanted(unified[channel.id])

            met: set[int] = set()
            for message in part.read_messages(
                is_wanted, start_time=start_time, end_time=end_time, report=report_part
            ):
                raw = message._replace(channel=unified[message.channel.id])
                number = raw.channel.id
                is_repeated = number not in met and _is_same(last.get(number), raw)
                met.add(number)
                last[number] = raw
                if not is_repeated:
                    yield raw

    def _unify(self, channel: Channel) -> Channel:
        """Return the first channel of this topic and schema, under its number in the folder."""
        key = (channel.topic, channel.type_name, channel.schema)
        numbered = channel._replace(id=len(self._channels) + 1)
        return self._channels.setdefault(key, numbered)


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


def _is_state(channel: Channel) -> bool:
    offers = parse_offered_qos(channel.metadata.get("offered_qos_profiles", ""))
    return any(offer.durability == "transient_local" for offer in offers)


def _is_same(last: RawMessage | None, raw: RawMessage) -> bool:
    """Tell whether a message is the one before; only the time of its recording may differ."""
    return last is not None and last._replace(log_time=raw.log_time) == raw


def _drop_repeated(items: Iterable[_T]) -> tuple[_T, ...]:
    kept: list[_T] = []
    for item in items:
        if item not in kept:
            kept.append(item)
    return tuple(kept)
