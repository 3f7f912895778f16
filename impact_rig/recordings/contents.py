"""Reads all of a recording, sound or damaged, and says what it holds and what was lost of it."""

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from impact_rig.core.errors import FileError
from impact_rig.recordings.bag import find_bag_files
from impact_rig.recordings.hits import (
    HIT_TYPES,
    HitState,
    HitWatch,
    RecordedHit,
    StreamWatch,
    count_points,
)
from impact_rig.recordings.messages import SETUP_TYPE, STREAM_TYPE
from impact_rig.recordings.records import Attachment, Item, MetadataRecord, RawMessage
from impact_rig.recordings.scan import Damage, Scan
from impact_rig.recordings.schemas import SchemaDecoder
from impact_rig.recordings.writer import HEALTH_RECORD

RECOVERY_RECORD = "impact_rig/recovery"
"""Metadata record that tells what a recording was recovered from, and what was lost."""


@dataclass
class Tally:
    """How many sound messages there are, received from when to when [ns since the epoch]."""

    messages: int = 0
    start_time: int = 0
    end_time: int = 0

    def add(self, other: "Tally") -> None:
        """Count others in."""
        if not other.messages:
            return
        is_first = self.messages == 0
        self.start_time = other.start_time if is_first else min(self.start_time, other.start_time)
        self.end_time = max(self.end_time, other.end_time)
        self.messages += other.messages


@dataclass(kw_only=True)
class TopicContents(Tally):
    """One topic of a recording.

    Attributes
    ----------
    name, type_name : str
        In full.
    schema : str
        Of its type.
    metadata : mapping
        `offered_qos_profiles` and `topic_type_hash` for ROS 2.
    lost : int
        Further messages that are known to have been written [-].
    """

    name: str
    type_name: str
    schema: str
    metadata: Mapping[str, str]
    lost: int = 0

    @property
    def rate(self) -> float:
        """Messages per second [Hz]; NaN below two messages."""
        duration = (self.end_time - self.start_time) * 1e-9
        return (self.messages - 1) / duration if self.messages > 1 and duration > 0 else math.nan


@dataclass(kw_only=True)
class FileContents(Tally):
    """One file of a recording.

    Attributes
    ----------
    path : Path
        Where it is.
    size : int
        [byte].
    library : str
        What wrote it.
    compression : tuple of str
        Of its chunks, "none" for none.
    chunks : int
        How many [-].
    is_closed, has_index : bool
        Whether it has an end, and an index that can be used.
    damages : list of Damage
        What cannot be read.
    problems : list of str
        Everything that is wrong with it, in words.
    """

    path: Path
    size: int
    library: str
    compression: tuple[str, ...]
    chunks: int
    is_closed: bool
    has_index: bool
    damages: list[Damage]
    problems: list[str]

    @property
    def unread(self) -> int:
        """Bytes that could not be read."""
        return sum(damage.size for damage in self.damages)


@dataclass(frozen=True)
class AttachmentEntry:
    """A file kept inside the recording: its name, its kind and its size [byte]."""

    name: str
    media_type: str
    size: int


@dataclass(frozen=True)
class Note:
    """What an operator said, and when [ns since the epoch]."""

    time: int
    text: str


@dataclass
class Contents:
    """What a recording holds.

    Attributes
    ----------
    path : Path
        As it was named: a file or a folder.
    missing_files : tuple of str
        Files of the folder that are not there.
    files : list of FileContents
        In the order of recording.
    topics : list of TopicContents
        By name.
    hits : tuple of RecordedHit
        In the order in which they happened.
    streams : dict of StreamWatch
        What there is of running streams, by topic.
    metadata : list of MetadataRecord
        As found.
    attachments : list of AttachmentEntry
        As found.
    notes : list of Note
        The operator's.
    setups : dict
        The set-up messages, decoded, each once, by what stands in the file.
    messages_lost : int
        What the middleware dropped on the way to the recorder [-].
    unknown_messages : int
        Messages whose topic is not described anywhere [-].
    remarks : dict of str
        What else a reader should know, in words, as keys.
    """

    path: Path
    missing_files: tuple[str, ...]
    files: list[FileContents] = field(default_factory=list)
    topics: list[TopicContents] = field(default_factory=list)
    hits: tuple[RecordedHit, ...] = ()
    streams: dict[str, StreamWatch] = field(default_factory=dict)
    metadata: list[MetadataRecord] = field(default_factory=list)
    attachments: list[AttachmentEntry] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)
    setups: dict[bytes, Any] = field(default_factory=dict)
    messages_lost: int = 0
    unknown_messages: int = 0
    remarks: dict[str, None] = field(default_factory=dict)

    @property
    def problems(self) -> tuple[str, ...]:
        """Everything that is wrong, in words; empty: the recording is sound."""
        many = len(self.files) > 1
        missing = tuple(f"{name} is missing" for name in self.missing_files)
        found = tuple(
            f"{file.path.name}: {text}" if many else text
            for file in self.files
            for text in file.problems
        )
        return missing + found

    @property
    def is_sound(self) -> bool:
        """Whether everything that was written is there and every reader finds it."""
        return not self.problems

    @property
    def is_whole(self) -> bool:
        """Whether all messages that were written are there, as far as that can be told."""
        is_closed = all(file.is_closed for file in self.files)
        is_original = all(record.name != RECOVERY_RECORD for record in self.metadata)
        return is_original and is_closed and not (self.missing_files or self.lost)

    @property
    def messages(self) -> int:
        """Those that are sound [-]."""
        return sum(topic.messages for topic in self.topics)

    @property
    def lost(self) -> int:
        """Further ones that are known to have been written [-]."""
        return sum(topic.lost for topic in self.topics) + self.unknown_messages

    @property
    def start_time(self) -> int:
        """Of the first message, nanoseconds since the epoch; 0: there is none."""
        return min((topic.start_time for topic in self.topics if topic.messages), default=0)

    @property
    def end_time(self) -> int:
        """Of the last message, nanoseconds since the epoch; 0: there is none."""
        return max((topic.end_time for topic in self.topics if topic.messages), default=0)

    def count_hits(self, state: HitState) -> int:
        """Return how many hits are saved, damaged or lost."""
        return sum(hit.state is state for hit in self.hits)


OUR_LIBRARY = "impact_rig"
"""First word of the library in files of our recorder, which numbers messages without gaps."""
PROFILE = "ros2"
"""Of recordings of ROS 2."""
MOST_PLACES = 10
"""How many damaged places are told in words, our choice."""


@dataclass
class _ChannelTally(Tally):
    """Of one channel in one file, with the numbers of its first and last message."""

    first_sequence: int = 0
    last_sequence: int = 0

    def take(self, message: RawMessage) -> None:
        """Count a message."""
        if self.messages == 0:
            self.first_sequence = message.sequence
        self.last_sequence = message.sequence
        self.add(Tally(1, message.log_time, message.log_time))


def _count_lost(scan: Scan, tallies: Mapping[int, _ChannelTally]) -> dict[int, int]:
    """Return how many further messages of each channel are known to have been written."""
    existing: Counter[int] = Counter()
    if scan.summary is not None and scan.summary.statistics is not None:
        existing |= Counter(scan.summary.statistics.channel_message_counts)
    if scan.header is not None and scan.header.library.split(" ")[0] == OUR_LIBRARY:
        for number, tally in tallies.items():
            span = tally.last_sequence - tally.first_sequence + 1
            existing[number] = max(existing[number], span)
    return {
        number: max(count - (tallies[number].messages if number in tallies else 0), 0)
        for number, count in existing.items()
    }


def _describe_file(scan: Scan, problems: list[str]) -> FileContents:
    """Return what is known of the file itself, once it was read; its messages are not counted."""
    return FileContents(
        path=scan.path,
        size=scan.size,
        library=scan.header.library if scan.header is not None else "",
        compression=tuple(scan.compressions),
        chunks=scan.chunks,
        is_closed=scan.is_closed,
        has_index=scan.summary is not None,
        damages=scan.damages,
        problems=problems,
    )


def _list_problems(scan: Scan, lost: Mapping[int, int]) -> Iterator[str]:
    if not scan.is_closed:
        yield "it was never closed, its end is missing"
    elif scan.summary is None:
        yield "it has no index at its end that could be used"
    if scan.header is not None and scan.header.profile != PROFILE:
        yield f"its profile is {scan.header.profile!r}: it should be {PROFILE!r}"
    yield from map(str, scan.damages[:MOST_PLACES])
    if len(scan.damages) > MOST_PLACES:
        yield f"{len(scan.damages) - MOST_PLACES} further places cannot be read"
    if not scan.damages and any(lost.values()):
        yield f"{sum(lost.values())} messages are missing: their numbers, or the index, tell"
    if count := scan.unknown.total():
        yield f"the topic of {count} messages is not described any more"


NOTE_TYPE = "std_msgs/msg/String"
STATE_TYPE = "impact_rig_msgs/msg/RecorderState"
_DECODED = HIT_TYPES | {STREAM_TYPE, NOTE_TYPE, STATE_TYPE}


def inspect_recording(path: Path, *, report: Callable[[int], None] = lambda _: None) -> Contents:
    """Read all of a recording, checksums included, and say what it holds.

    Parameters
    ----------
    path : Path
        Of the file, or of a folder as rosbag2 writes it; see `find_recording`.
    report : callable, optional
        Told how many bytes were looked at, now and then.

    Raises
    ------
    FileError
        If there is no such file, or nothing in it is of MCAP and ROS 2.
    """
    files, missing = find_bag_files(path) if path.is_dir() else ((path,), ())
    inspection = _Inspection(Contents(path, tuple(missing)))
    errors = []
    done = 0
    for file in files:
        scan = Scan(file, is_strict=False, report=lambda place, done=done: report(done + place))  # type: ignore[misc]
        try:
            inspection.read(scan)
        except FileError as error:
            # Nothing is left in this file of the folder.
            inspection.contents.files.append(_describe_file(scan, [str(error)]))
            errors.append(error)
        done += scan.size
    if len(errors) == len(files):
        raise errors[0]
    return inspection.finish()


class _Inspection:
    """Collects what the files of a recording hold."""

    def __init__(self, contents: Contents) -> None:
        self.contents = contents
        self._decoder = SchemaDecoder()
        self._watch = HitWatch()
        self._topics: dict[tuple[str, str], TopicContents] = {}

    def read(self, scan: Scan) -> None:
        """Take one file.

        Raises
        ------
        FileError
            If nothing in it is of MCAP and ROS 2.
        """
        tallies: dict[int, _ChannelTally] = defaultdict(_ChannelTally)
        for item in scan.read():
            if isinstance(item, RawMessage):
                tallies[item.channel.id].take(item)
            self._take(item)
        _check_kind(scan)
        lost = _count_lost(scan, tallies)
        file = _describe_file(scan, list(_list_problems(scan, lost)))
        for number, channel in scan.channels.items():
            key = (channel.topic, channel.type_name)
            if key not in self._topics:
                self._topics[key] = TopicContents(
                    name=channel.topic,
                    type_name=channel.type_name,
                    schema=channel.schema,
                    metadata=channel.metadata,
                )
            self._topics[key].lost += lost.get(number, 0)
            for whole in (self._topics[key], file):
                whole.add(tallies[number])
        self.contents.unknown_messages += scan.unknown.total()
        self.contents.files.append(file)

    def finish(self) -> Contents:
        """Return what was found."""
        contents = self.contents
        contents.topics = sorted(self._topics.values(), key=lambda topic: topic.name)
        contents.hits = self._watch.list_hits(is_whole=contents.is_whole)
        return contents

    def _take(self, item: Item) -> None:
        contents = self.contents
        if isinstance(item, RawMessage):
            if item.channel.type_name in _DECODED:
                self._take_message(item)
        elif isinstance(item, Attachment):
            entry = AttachmentEntry(item.name, item.media_type, len(item.data))
            if entry not in contents.attachments:
                contents.attachments.append(entry)
        else:
            if item not in contents.metadata:
                contents.metadata.append(item)
            lost = item.fields.get("messages_lost", "") if item.name == HEALTH_RECORD else ""
            if lost.isdecimal():
                # A state is published when it changes; this was written at the very end.
                contents.messages_lost = max(contents.messages_lost, int(lost))

    def _take_message(self, message: RawMessage) -> None:
        topic, type_name = message.channel.topic, message.channel.type_name
        try:
            content = self._decoder.decode(message.channel, message.data)
            if type_name in HIT_TYPES:
                self._watch.add(topic, type_name, content, message.data)
            self._look_into(message, type_name, content)
        except FileError:
            self.contents.remarks[f"messages on {topic} do not fit their schema"] = None
        except AttributeError as error:
            self.contents.remarks[
                f"{type_name} on {topic} has no field {error.name!r}: it was recorded with"
                " another version of the interfaces"
            ] = None

    def _look_into(self, message: RawMessage, type_name: str, content: Any) -> None:
        contents, topic = self.contents, message.channel.topic
        if type_name == SETUP_TYPE:
            contents.setups[message.data] = content
        elif type_name == STREAM_TYPE:
            watch = contents.streams.setdefault(topic, StreamWatch())
            watch.add(int(content.first_sample), count_points(content.hammer))
        elif type_name == STATE_TYPE:
            lost = int(getattr(content, "messages_lost", 0))
            contents.messages_lost = max(contents.messages_lost, lost)
        elif type_name == NOTE_TYPE and topic.endswith("/note"):
            contents.notes.append(Note(message.log_time, str(content.data)))


def _check_kind(scan: Scan) -> None:
    """Refuse what was never a recording of ROS 2, however damaged."""
    path, header, channels = scan.path, scan.header, scan.channels.values()
    if header is None and scan.chunks == 0 and not channels:
        raise FileError(f"{path} is no MCAP recording, or nothing of it is left")
    if (
        header is not None
        and header.profile != PROFILE
        and not any(channel.is_ros for channel in channels)
    ):
        raise FileError(
            f"{path} is an MCAP file of profile {header.profile!r}: it should be {PROFILE!r}"
        )
