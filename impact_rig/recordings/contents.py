"""The contents and the losses of a run, sound or damaged, and a sound copy of it."""

import json
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from impact_rig.core.given.errors import FileError
from impact_rig.recordings.hits import HIT_TYPES, BlockCount, HitWatch, RecordedHit
from impact_rig.recordings.messages import (
    CONVERSION_ERRORS,
    SETUP_TYPE,
    STREAM_TYPE,
    count_points,
)
from impact_rig.recordings.new_file import list_successors, write_new_file
from impact_rig.recordings.records import (
    HEALTH_RECORD,
    RECOVERY_RECORD,
    Attachment,
    Channel,
    MetadataRecord,
    RawMessage,
)
from impact_rig.recordings.run import (
    Run,
    choose_namespace,
    find_owner,
    list_namespaces,
    report_from,
)
from impact_rig.recordings.scan import PROFILES, Pass, Report, Scan, Wanted, describe_profile
from impact_rig.recordings.schemas import decode_message
from impact_rig.recordings.writer import RecordingWriter
from impact_rig.version import __version__


@dataclass
class TopicContents:
    """One topic of a run: its sound messages, received from when to when."""

    name: str
    type_name: str
    messages: int = 0
    lost: int = 0  # further messages that are known to have been written
    start_time: int = 0  # [ns since the epoch]
    end_time: int = 0  # [ns since the epoch]

    def take(self, message: RawMessage) -> None:
        """Count a message."""
        start = self.start_time if self.messages else message.log_time
        self.start_time = min(start, message.log_time)
        self.end_time = max(self.end_time, message.log_time)
        self.messages += 1

    @property
    def rate(self) -> float:
        """Messages per second [Hz]; NaN below two messages."""
        duration = (self.end_time - self.start_time) * 1e-9
        return (self.messages - 1) / duration if self.messages > 1 and duration > 0 else math.nan


@dataclass(frozen=True)
class OperatorNote:
    """What an operator said for the recording."""

    time: int  # [ns since the epoch]
    text: str


@dataclass
class Contents:
    """The contents of a run, and what is wrong with it."""

    run: Run
    scans: tuple[Scan, ...]  # of all of its files
    passes: list[Pass] = field(default_factory=list)  # through them, as far as it was read
    topics: dict[str, TopicContents] = field(default_factory=dict)  # by name
    hits: tuple[RecordedHit, ...] = ()  # in the order in which they happened
    repeated: int = 0  # blocks that are there twice, byte by byte
    streams: dict[str, BlockCount] = field(default_factory=dict)  # running streams, by topic
    metadata: list[MetadataRecord] = field(default_factory=list)
    attachments: list[Attachment] = field(default_factory=list)  # each content once
    notes: list[OperatorNote] = field(default_factory=list)
    setups: dict[bytes, Any] = field(default_factory=dict)  # decoded, by their bytes in the file
    messages_lost: int = 0  # that the middleware dropped on the way to the recorder
    known_items: set[int] = field(default_factory=set)  # hashes of metadata and attachments
    remarks: dict[str, None] = field(default_factory=dict)  # other hints for the reader, as keys

    @property
    def problems(self) -> tuple[str, ...]:
        """Its damages, in words; empty: it is sound."""
        told = []
        for reading in self.passes:
            name = f"{reading.scan.path.name}: " if len(self.scans) > 1 else ""
            told += [f"{name}{problem}" for problem in _list_file_problems(reading)]
        lost = sum(topic.lost for topic in self.topics.values())
        if lost and not any(reading.damages for reading in self.passes):
            told.append(f"{lost} messages are missing: their numbers, or the index, tell")
        return tuple(told)

    @property
    def years_apart(self) -> float | None:
        """Between its first message and its last, if no run lasts so long; None: it may."""
        apart = self.end_time - self.start_time
        return apart / A_YEAR if apart > LONGEST_RUN else None

    @property
    def is_live(self) -> bool:
        """Whether it is being recorded."""
        return self.scans[-1].is_live

    @property
    def is_sound(self) -> bool:
        """Whether everything that was written is there and every reader finds it."""
        return not self.problems

    @property
    def is_whole(self) -> bool:
        """Whether all messages that were written are there, as far as that can be told."""
        is_original = all(record.name != RECOVERY_RECORD for record in self.metadata)
        return is_original and all(scan.is_closed for scan in self.scans) and not self.lost

    @property
    def size(self) -> int:
        """Size of all files [byte]."""
        return sum(scan.size for scan in self.scans)

    @property
    def unread(self) -> int:
        """Bytes that could not be read."""
        return sum(damage.size for reading in self.passes for damage in reading.damages)

    @property
    def messages(self) -> int:
        """Those that are sound [-]."""
        return sum(topic.messages for topic in self.topics.values())

    @property
    def lost(self) -> int:
        """Further ones that are known to have been written [-]."""
        return sum(topic.lost for topic in self.topics.values()) + sum(
            reading.unknown for reading in self.passes
        )

    @property
    def start_time(self) -> int:
        """Time of the first message, nanoseconds since the epoch; 0: there is none."""
        times = (topic.start_time for topic in self.topics.values() if topic.messages)
        return min(times, default=0)

    @property
    def end_time(self) -> int:
        """Time of the last message, nanoseconds since the epoch; 0: there is none."""
        times = (topic.end_time for topic in self.topics.values() if topic.messages)
        return max(times, default=0)


MOST_PLACES = 10
"""How many damaged places are described in words, our choice."""
A_YEAR = 365 * 86_400 * 1_000_000_000  # [ns]
LONGEST_RUN = 10 * A_YEAR
"""Longer than any run [ns], our choice: a time of zero, or a rolled over one, is farther off."""
MOST_NOTES, LONGEST_NOTE = 1000, 1000
"""How many notes, and of each how many characters, are kept, our choice: people type them."""
MOST_SETUPS = 100
"""How many different set-ups are kept, our choice: each campaign has one."""
NOTE_TYPE = "std_msgs/msg/String"
STATE_TYPE = "impact_rig_msgs/msg/RecorderState"
_DECODED = HIT_TYPES | {STREAM_TYPE, NOTE_TYPE, STATE_TYPE}


def inspect_run(run: Run, *, report: Report = lambda _: None) -> Contents:
    """Read all of a run, checksums included, and return its contents.

    Parameters
    ----------
    run : Run
        Its files may be damaged. Where a rig was chosen, it alone is looked at.
    report : callable, optional
        Called now and then with how much was read [byte].

    Raises
    ------
    FileError
        If there is no such file, or nothing in it is of MCAP and ROS 2.
    """
    contents = Contents(
        run, tuple(Scan(path, is_strict=False, by_time=True) for path in run.files)
    )
    wanted, watch = _choose_topics(contents), HitWatch()
    for reading in _read_files(contents, wanted, report):
        found, ends = Counter[int](), Counter[int]()  # messages, and last number + 1, by channel
        contents.passes.append(reading)
        for item in reading:
            if isinstance(item, RawMessage):
                _find_topic(contents, item.channel).take(item)
                found[item.channel.id] += 1
                ends[item.channel.id] = max(ends[item.channel.id], item.sequence + 1)
                if item.channel.type_name in _DECODED:
                    _add_message(contents, watch, item)
            else:
                _add_file_item(contents, item)
        _check_kind(reading)
        written = ends if reading.scan.is_of_recorder else Counter[int]()
        statistics = reading.scan.statistics
        if counts := Counter(statistics.channel_message_counts if statistics else {}):
            reading.uncounted = (found - counts).total()
            written |= counts
        for channel in filter(wanted, reading.channels.values()):
            lost = written[channel.id] - found[channel.id]
            _find_topic(contents, channel).lost += max(lost, 0)
    contents.topics = dict(sorted(contents.topics.items()))
    contents.hits = watch.list_hits(is_whole=contents.is_whole, is_live=contents.is_live)
    contents.repeated = watch.repeated
    return contents


def _read_files(
    contents: Contents, wanted: Wanted, report: Report, before: int = 0
) -> Iterator[Pass]:
    """Yield one reading of each file; so much was read before [byte]."""
    for scan in contents.scans:
        yield scan.read(wanted, partial(report_from, report, before))
        before += scan.size


def _choose_topics(contents: Contents) -> Wanted:
    """Return which topics are looked at: all, or those of the rig that was chosen."""
    if contents.run.wanted is None:
        return lambda _: True
    channels = [channel for scan in contents.scans for channel in scan.read_channels()]
    found = list_namespaces(channels)
    chosen = choose_namespace(contents.run.path, found, contents.run.wanted)
    return lambda channel: find_owner(channel.topic, found) == chosen


def _find_topic(contents: Contents, channel: Channel) -> TopicContents:
    fresh = TopicContents(channel.topic, channel.type_name)
    return contents.topics.setdefault(channel.topic, fresh)


def _add_file_item(contents: Contents, item: Attachment | MetadataRecord) -> None:
    content = item.data if isinstance(item, Attachment) else tuple(sorted(item.fields.items()))
    if (key := hash((item.name, content))) in contents.known_items:
        return
    contents.known_items.add(key)
    if isinstance(item, Attachment):
        contents.attachments.append(item)
    else:
        contents.metadata.append(item)
        lost = item.fields.get("messages_lost", "") if item.name == HEALTH_RECORD else ""
        if lost.isdecimal():
            # A state is published when it changes; this was written at the very end.
            contents.messages_lost = max(contents.messages_lost, int(lost))


def _add_message(contents: Contents, watch: HitWatch, message: RawMessage) -> None:
    """Add what a message says, or a remark that it cannot be read."""
    topic, type_name = message.channel.topic, message.channel.type_name
    try:
        content = decode_message(message)
        if type_name in HIT_TYPES:
            watch.add(topic, type_name, content, message.data)
        _add_content(contents, message, content)
    except FileError:
        contents.remarks[f"messages on {topic} do not fit their schema"] = None
    except CONVERSION_ERRORS as error:
        said = f"{type_name} on {topic} was recorded with another version of the interfaces"
        contents.remarks[f"{said}: {error}"] = None


def _add_content(contents: Contents, message: RawMessage, content: Any) -> None:
    """Add what a decoded message says beside its part in a hit."""
    topic, type_name = message.channel.topic, message.channel.type_name
    if type_name == SETUP_TYPE and len(contents.setups) < MOST_SETUPS:
        contents.setups[message.data] = content
    elif type_name == STREAM_TYPE:
        stream = contents.streams.setdefault(topic, BlockCount())
        stream.add(int(content.first_sample), count_points(content))
    elif type_name == STATE_TYPE:
        contents.messages_lost = max(contents.messages_lost, int(content.messages_lost))
    elif type_name == NOTE_TYPE and topic.endswith("/note"):
        if len(contents.notes) < MOST_NOTES:
            contents.notes.append(OperatorNote(message.log_time, content.data[:LONGEST_NOTE]))
        else:
            contents.remarks[f"only the first {MOST_NOTES} notes are shown"] = None


def _list_file_problems(reading: Pass) -> Iterator[str]:
    scan, damages = reading.scan, reading.damages
    if not (scan.is_closed or scan.is_live):
        yield "it was never closed, its end is missing"
    if scan.is_closed and scan.summary is None:
        yield "it has no index at its end that could be used"
    if scan.header is not None and scan.header.profile not in PROFILES:
        yield f"its profile is {scan.header.profile!r}: it should be {PROFILES[0]!r}"
    if scan.summary is not None and scan.summary.chunk_indexes:
        listed = {
            each.chunk_start_offset: each.chunk_length for each in scan.summary.chunk_indexes
        }
        if listed != reading.chunks:
            right = len(listed.items() & reading.chunks.items())
            yield (
                f"its index names {right} of {len(reading.chunks)} chunks rightly: programs that"
                " go by it miss messages"
            )
    if reading.uncounted:
        yield f"its index leaves {reading.uncounted} messages uncounted: programs may skip them"
    yield from map(str, damages[:MOST_PLACES])
    if len(damages) > MOST_PLACES:
        yield f"{len(damages) - MOST_PLACES} further places cannot be read"
    if reading.unknown:
        yield f"the topic of {reading.unknown} messages is not described any more"


def _check_kind(reading: Pass) -> None:
    """Refuse a file that was never a recording of ROS 2, damaged or not."""
    path, header = reading.scan.path, reading.scan.header
    channels = reading.channels.values()
    if header is None and not reading.chunks and not channels:
        raise FileError(f"{path} is no MCAP recording, or nothing of it is left")
    if (
        header is not None
        and header.profile not in PROFILES
        and not any(channel.is_ros for channel in channels)
    ):
        raise FileError(describe_profile(path, header.profile))


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


LIBRARY = f"impact_rig-recover {__version__}"
"""Writer in the new file: its messages may not be numbered without gaps."""


def recover_run(run: Run, output: Path, *, report: Report = lambda _: None) -> Contents:
    """Write everything that is sound in a run to one new recording, which any reader opens.

    Topics, offered QoS, hashes, messages, their order, times and numbers, metadata and
    attachments are taken over as they are; what no checksum vouches for is left out.

    Parameters
    ----------
    run : Run
        Its files are only read. Where a rig was chosen, it alone is copied.
    output : Path
        Of the new file.
    report : callable, optional
        Called now and then with how much was read [byte]; the files are read twice.

    Returns
    -------
    Contents
        What was found in the run; its problems are what is left out.

    Raises
    ------
    FileError
        If nothing can be recovered, or the output exists already or cannot be written.
    """
    contents = inspect_run(run, report=report)
    if not contents.messages:
        raise FileError(f"nothing of {run.path} can be recovered: {'; '.join(contents.problems)}")
    with write_new_file(output) as part, RecordingWriter(part, library=LIBRARY) as writer:
        _copy(contents, writer, report)
        if not contents.is_sound:
            problems = json.dumps(contents.problems, ensure_ascii=False)
            fields = {"recovered_from": run.path.name, "problems": problems}
            writer.add_metadata(RECOVERY_RECORD, fields)
    return contents


def _copy(contents: Contents, writer: RecordingWriter, report: Report) -> None:
    wanted = _choose_topics(contents)
    for reading in _read_files(contents, wanted, report, contents.size):
        for item in reading:
            if isinstance(item, RawMessage):
                times = (item.log_time, item.publish_time)
                writer.add_message(writer.announce(item.channel), item.data, *times, item.sequence)
            elif isinstance(item, Attachment):
                writer.add_attachment(item.name, item.media_type, item.data, item.log_time)
            elif item.name != "rosbag2":  # has the counts of the file, which may no longer be true
                writer.add_metadata(item.name, item.fields)
        for channel in filter(wanted, reading.channels.values()):
            writer.announce(channel)
