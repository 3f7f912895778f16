"""What a recording holds, sound or damaged, and what was lost; its sound part in a new one."""

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from operator import attrgetter
from pathlib import Path
from typing import Any

from impact_rig import __version__
from impact_rig.core.errors import FileError
from impact_rig.recordings.hits import (
    HIT_TYPES,
    BlockCount,
    HitWatch,
    RecordedHit,
)
from impact_rig.recordings.messages import SETUP_TYPE, STREAM_TYPE, count_points
from impact_rig.recordings.new_file import list_successors, write_new_file
from impact_rig.recordings.records import Attachment, Channel, MetadataRecord, RawMessage
from impact_rig.recordings.scan import PROFILE, Report, Scan
from impact_rig.recordings.schemas import decode_message
from impact_rig.recordings.writer import HEALTH_RECORD, RecordingWriter

RECOVERY_RECORD = "impact_rig/recovery"
"""Metadata record that tells what a recording was recovered from, and what was lost."""


@dataclass
class TopicContents:
    """One topic of a recording: its sound messages, received from when to when."""

    name: str
    type_name: str
    messages: int = 0
    lost: int = 0  # further messages that are known to have been written
    start_time: int = 0  # [ns since the epoch]
    end_time: int = 0  # [ns since the epoch]
    first_sequence: int = 0
    last_sequence: int = 0

    def take(self, message: RawMessage) -> None:
        """Count a message."""
        if not self.messages:
            self.first_sequence, self.start_time = message.sequence, message.log_time
        self.last_sequence = message.sequence
        self.start_time = min(self.start_time, message.log_time)
        self.end_time = max(self.end_time, message.log_time)
        self.messages += 1

    @property
    def rate(self) -> float:
        """Messages per second [Hz]; NaN below two messages."""
        duration = (self.end_time - self.start_time) * 1e-9
        return (self.messages - 1) / duration if self.messages > 1 and duration > 0 else math.nan


@dataclass(frozen=True)
class Note:
    """What an operator said, and when [ns since the epoch]."""

    time: int
    text: str


@dataclass
class Contents:
    """What a recording holds, and what is wrong with it."""

    scan: Scan  # of all of the file
    topics: list[TopicContents] = field(default_factory=list)  # by name
    hits: tuple[RecordedHit, ...] = ()  # in the order in which they happened
    streams: dict[str, BlockCount] = field(default_factory=dict)  # running streams, by topic
    metadata: list[MetadataRecord] = field(default_factory=list)
    attachments: list[Attachment] = field(default_factory=list)  # each content once
    notes: list[Note] = field(default_factory=list)
    setups: dict[bytes, Any] = field(default_factory=dict)  # decoded, by their bytes in the file
    messages_lost: int = 0  # that the middleware dropped on the way to the recorder
    remarks: dict[str, None] = field(default_factory=dict)  # other hints for the reader, as keys

    @property
    def problems(self) -> tuple[str, ...]:
        """What is wrong with it, in words; empty: it is sound."""
        return tuple(_list_problems(self.scan, sum(topic.lost for topic in self.topics)))

    @property
    def is_sound(self) -> bool:
        """Whether everything that was written is there and every reader finds it."""
        return not self.problems

    @property
    def is_whole(self) -> bool:
        """Whether all messages that were written are there, as far as that can be told."""
        is_original = all(record.name != RECOVERY_RECORD for record in self.metadata)
        return is_original and self.scan.is_closed and not self.lost

    @property
    def unread(self) -> int:
        """Bytes that could not be read."""
        return sum(damage.size for damage in self.scan.damages)

    @property
    def messages(self) -> int:
        """Those that are sound [-]."""
        return sum(topic.messages for topic in self.topics)

    @property
    def lost(self) -> int:
        """Further ones that are known to have been written [-]."""
        return sum(topic.lost for topic in self.topics) + self.scan.unknown

    @property
    def start_time(self) -> int:
        """Of the first message, nanoseconds since the epoch; 0: there is none."""
        return min((topic.start_time for topic in self.topics if topic.messages), default=0)

    @property
    def end_time(self) -> int:
        """Of the last message, nanoseconds since the epoch; 0: there is none."""
        return max((topic.end_time for topic in self.topics if topic.messages), default=0)


MOST_PLACES = 10
"""How many damaged places are described in words, our choice."""
NOTE_TYPE = "std_msgs/msg/String"
STATE_TYPE = "impact_rig_msgs/msg/RecorderState"
_DECODED = HIT_TYPES | {STREAM_TYPE, NOTE_TYPE, STATE_TYPE}


def inspect_recording(path: Path, *, report: Report = lambda _: None) -> Contents:
    """Read all of a recording, checksums included, and say what it holds.

    Parameters
    ----------
    path : Path
        Of the file.
    report : callable, optional
        Called now and then with how much was read [byte].

    Raises
    ------
    FileError
        If there is no such file, or nothing in it is of MCAP and ROS 2.
    """
    contents = Contents(scan := Scan(path, is_strict=False))
    watch = HitWatch()
    topics: dict[int, TopicContents] = {}

    def find_topic(channel: Channel) -> TopicContents:
        if channel.id not in topics:
            topics[channel.id] = TopicContents(channel.topic, channel.type_name)
        return topics[channel.id]

    for item in scan.read(report=report):
        if isinstance(item, RawMessage):
            find_topic(item.channel).take(item)
            if item.channel.type_name in _DECODED:
                _add_message(contents, watch, item)
        elif isinstance(item, Attachment):
            known = [(other.name, other.data) for other in contents.attachments]
            if (item.name, item.data) not in known:
                contents.attachments.append(item)
        elif item not in contents.metadata:
            contents.metadata.append(item)
            lost = item.fields.get("messages_lost", "") if item.name == HEALTH_RECORD else ""
            if lost.isdecimal():
                # A state is published when it changes; this was written at the very end.
                contents.messages_lost = max(contents.messages_lost, int(lost))
    _check_kind(scan)
    contents.topics = sorted(map(find_topic, scan.channels.values()), key=attrgetter("name"))
    _count_lost(scan, topics)
    contents.hits = watch.list_hits(is_whole=contents.is_whole)
    return contents


def _add_message(contents: Contents, watch: HitWatch, message: RawMessage) -> None:
    topic, type_name = message.channel.topic, message.channel.type_name
    try:
        content = decode_message(message)
        if type_name in HIT_TYPES:
            watch.add(topic, type_name, content, message.data)
        if type_name == SETUP_TYPE:
            contents.setups[message.data] = content
        elif type_name == STREAM_TYPE:
            stream = contents.streams.setdefault(topic, BlockCount())
            stream.add(int(content.first_sample), count_points(content))
        elif type_name == STATE_TYPE:
            contents.messages_lost = max(contents.messages_lost, int(content.messages_lost))
        elif type_name == NOTE_TYPE and topic.endswith("/note"):
            contents.notes.append(Note(message.log_time, str(content.data)))
    except FileError:
        contents.remarks[f"messages on {topic} do not fit their schema"] = None
    except AttributeError as error:
        contents.remarks[
            f"{type_name} on {topic} has no field {error.name!r}: it was recorded with"
            " another version of the interfaces"
        ] = None


def _count_lost(scan: Scan, topics: Mapping[int, TopicContents]) -> None:
    """Count the further messages of each topic that are known to have been written."""
    written: Counter[int] = Counter()
    if scan.summary is not None and scan.summary.statistics is not None:
        written |= Counter(scan.summary.statistics.channel_message_counts)
    # Our recorder numbers messages without gaps.
    is_ours = scan.header is not None and scan.header.library.split(" ")[0] == "impact_rig"
    for number, topic in topics.items():
        span = topic.last_sequence - topic.first_sequence + 1 if is_ours and topic.messages else 0
        topic.lost = max(written[number] - topic.messages, span - topic.messages, 0)


def _list_problems(scan: Scan, lost: int) -> Iterator[str]:
    if not scan.is_closed:
        yield "it was never closed, its end is missing"
    elif scan.summary is None:
        yield "it has no index at its end that could be used"
    if scan.header is not None and scan.header.profile != PROFILE:
        yield f"its profile is {scan.header.profile!r}: it should be {PROFILE!r}"
    yield from map(str, scan.damages[:MOST_PLACES])
    if len(scan.damages) > MOST_PLACES:
        yield f"{len(scan.damages) - MOST_PLACES} further places cannot be read"
    if not scan.damages and lost:
        yield f"{lost} messages are missing: their numbers, or the index, tell"
    if scan.unknown:
        yield f"the topic of {scan.unknown} messages is not described any more"


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


LIBRARY = f"impact_rig-recover {__version__}"
"""What the new file says wrote it: its messages may not be numbered without gaps."""


def recover_recording(path: Path, output: Path, *, report: Report = lambda _: None) -> Contents:
    """Write everything that is sound in a recording to a new one, which any reader opens.

    Topics, offered QoS, hashes, messages, their order, times and numbers, metadata and
    attachments are taken over as they are; what no checksum vouches for is left out.

    Parameters
    ----------
    path : Path
        Of the recording; it is only read.
    output : Path
        Of the new file.
    report : callable, optional
        Called now and then with how much of the recording was read [byte]; it is read twice.

    Returns
    -------
    Contents
        What was found in the recording; its problems are what is left out.

    Raises
    ------
    FileError
        If nothing can be recovered, or the output exists already or cannot be written.
    """
    contents = inspect_recording(path, report=report)
    if not contents.messages:
        raise FileError(f"nothing of {path} can be recovered: {'; '.join(contents.problems)}")
    scan = contents.scan
    with write_new_file(output) as part, RecordingWriter(part, library=LIBRARY) as writer:
        _copy(scan, writer, lambda place: report(scan.size + place))
        if not contents.is_sound:
            problems = json.dumps(contents.problems, ensure_ascii=False)
            fields = {"recovered_from": path.name, "problems": problems}
            writer.add_metadata(RECOVERY_RECORD, fields)
    return contents


def _copy(scan: Scan, writer: RecordingWriter, report: Report) -> None:
    numbers: dict[int, int] = {}

    def announce(channel: Channel) -> int:
        if channel.id not in numbers:
            numbers[channel.id] = writer.announce(channel)
        return numbers[channel.id]

    for item in scan.read(report=report):
        if isinstance(item, RawMessage):
            times = (item.log_time, item.publish_time)
            writer.add_message(announce(item.channel), item.data, *times, item.sequence)
        elif isinstance(item, Attachment):
            writer.add_attachment(item.name, item.media_type, item.data, item.log_time)
        elif item.name != "rosbag2":  # has the counts of the file, which may no longer be true
            writer.add_metadata(item.name, item.fields)
    for channel in scan.channels.values():
        announce(channel)


def extract_attachments(contents: Contents, folder: Path) -> list[Path]:
    """Write the attachments of a recording to a folder, which is made.

    Folders in a name are left out. Others of the same name are numbered.

    Raises
    ------
    FileError
        If a file of that name exists already or cannot be written.
    """
    written: list[Path] = []
    for attachment in contents.attachments:
        name = attachment.name.replace("\\", "/").rpartition("/")[2]
        safe = "".join(letter if letter.isprintable() else "_" for letter in name).strip()
        names = list_successors(folder / (safe.lstrip(".") or "attachment"))
        target = next(path for path in names if path not in written)
        with write_new_file(target) as part:
            part.write_bytes(attachment.data)
        written.append(target)
    return written
