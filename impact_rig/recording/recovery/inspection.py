"""Reads all of a recording, as far as it goes, and says what it holds."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from mcap.records import Attachment, Metadata

from impact_rig.core.errors import FileError
from impact_rig.recording.interfaces.schema_decoder import SchemaDecoder
from impact_rig.recording.reading.bag_files import find_bag_files
from impact_rig.recording.reading.mcap_reader import SETUP_TYPE, STREAM_TYPE
from impact_rig.recording.reading.raw_records import MetadataRecord
from impact_rig.recording.recovery.contents import (
    AttachmentEntry,
    Contents,
    FileContents,
    Note,
    RecordedStream,
    TopicContents,
)
from impact_rig.recording.recovery.file_tally import PROFILE, ChannelTally, FileTally
from impact_rig.recording.recovery.found import ChunkEnd, Found, FoundMessage
from impact_rig.recording.recovery.found_topics import Topic
from impact_rig.recording.recovery.recorded_hits import HIT_TYPES, HitWatch, count_points
from impact_rig.recording.recovery.salvage import Salvage
from impact_rig.recording.writing.stream_watch import StreamWatch

NOTE_TYPE = "std_msgs/msg/String"
STATE_TYPE = "impact_rig_msgs/msg/RecorderState"
_DECODED = HIT_TYPES | {STREAM_TYPE, NOTE_TYPE, STATE_TYPE}


def inspect_recording(
    path: Path, *, keep_unverified: bool = False, report: Callable[[int], None] = lambda _: None
) -> Contents:
    """Read all of a recording, checksums included, and say what it holds.

    Parameters
    ----------
    path : Path
        Of the file, or of a folder as rosbag2 writes it; see `find_recording`.
    keep_unverified : bool
        Whether a message that fits its schema belongs to its hit although no checksum vouches
        for it.
    report : callable, optional
        Told how many bytes were looked at, now and then.

    Raises
    ------
    FileError
        If there is no such file, or nothing in it is of MCAP and ROS 2.
    """
    files, missing = find_bag_files(path) if path.is_dir() else ((path,), ())
    inspection = _Inspection(MessageCheck(keep_unverified=keep_unverified))
    errors = []
    done = 0
    for file in files:
        salvage = Salvage(file, lambda place, done=done: report(done + place))  # type: ignore[misc]
        try:
            inspection.read(salvage)
        except FileError as error:
            inspection.add_stranger(salvage, error)
            errors.append(error)
        done += salvage.size
    if len(errors) == len(files):
        raise errors[0]
    return inspection.finish(path, missing)


class MessageCheck:
    """Tells which messages are kept, and decodes them.

    Parameters
    ----------
    keep_unverified : bool
        Whether a message that fits its schema is kept although no checksum vouches for it.
    """

    def __init__(self, *, keep_unverified: bool) -> None:
        self.keep_unverified = keep_unverified
        self._decoder = SchemaDecoder()

    def is_kept(self, message: FoundMessage) -> bool:
        """Return whether a message belongs to a recording that was recovered."""
        return message.is_vouched or (self.keep_unverified and self.decode(message) is not None)

    def decode(self, message: FoundMessage) -> Any:
        """Return what a message says; None: it does not fit its schema."""
        if not message.topic.is_ros:
            return None
        try:
            return self._decoder.decode(message.topic.as_channel(), message.data)
        except FileError:
            return None


class _Inspection:
    """Collects what the files of a recording hold."""

    def __init__(self, check: MessageCheck) -> None:
        self._check = check
        self._watch = HitWatch()
        self._streams: dict[str, StreamWatch] = {}
        self._files: list[FileContents] = []
        self._topics: dict[tuple[str, str], TopicContents] = {}
        self._metadata: list[MetadataRecord] = []
        self._attachments: dict[AttachmentEntry, None] = {}
        self._notes: list[Note] = []
        self._setups: dict[bytes, Any] = {}
        self._messages_lost = 0
        self._unknown = 0
        self._remarks: dict[str, None] = {}

    def read(self, salvage: Salvage) -> None:
        """Take one file.

        Raises
        ------
        FileError
            If nothing in it is of MCAP and ROS 2.
        """
        tally = FileTally()
        for found in salvage.read():
            self._take(found, tally)
        _check_kind(salvage)
        lost = tally.count_lost(salvage)
        for number, topic in salvage.topics.items():
            self._add_counts(topic, tally.channels[number], lost.get(number, 0))
        self._unknown += salvage.unknown.total()
        self._files.append(tally.describe(salvage, lost))

    def add_stranger(self, salvage: Salvage, error: FileError) -> None:
        """Note a file of the folder in which nothing is left."""
        contents = FileTally().describe(salvage, {})
        self._files.append(replace(contents, problems=(str(error),)))

    def finish(self, path: Path, missing: Iterable[str]) -> Contents:
        """Return what was found."""
        contents = Contents(
            path=path,
            files=tuple(self._files),
            missing_files=tuple(missing),
            topics=tuple(sorted(self._topics.values(), key=lambda topic: topic.name)),
            hits=(),
            streams=tuple(
                RecordedStream(topic, watch.blocks, watch.points, watch.gaps, watch.missing_points)
                for topic, watch in sorted(self._streams.items())
            ),
            metadata=tuple(self._metadata),
            attachments=tuple(self._attachments),
            notes=tuple(self._notes),
            setups=tuple(self._setups.values()),
            messages_lost=self._messages_lost,
            unknown_messages=self._unknown,
            remarks=tuple(self._remarks),
        )
        return replace(contents, hits=self._watch.list_hits(is_whole=contents.is_whole))

    def _take(self, found: Found, tally: FileTally) -> None:
        if isinstance(found, FoundMessage):
            self._take_message(found, tally)
        elif isinstance(found, ChunkEnd):
            tally.add_chunk(found)
        elif isinstance(found, Metadata):
            record = MetadataRecord(found.name, dict(found.metadata))
            if record not in self._metadata:
                self._metadata.append(record)
        elif isinstance(found, Attachment):
            self._attachments[AttachmentEntry(found.name, found.media_type, len(found.data))] = (
                None
            )

    def _take_message(self, message: FoundMessage, tally: FileTally) -> None:
        schema = message.topic.schema
        type_name = schema.name if schema is not None else ""
        is_looked_into = type_name in _DECODED or not message.is_vouched
        content = self._check.decode(message) if is_looked_into else None
        tally.add_message(message, is_decodable=content is not None)
        if type_name not in _DECODED:
            return
        topic = message.topic.channel.topic
        if content is None:
            if message.is_vouched:
                self._remarks[f"messages on {topic} do not fit their schema"] = None
            return
        is_kept = message.is_vouched or self._check.keep_unverified
        try:
            if type_name in HIT_TYPES:
                self._watch.add(topic, type_name, content, message.data, is_kept=is_kept)
            if is_kept:
                self._look_into(message, type_name, content)
        except AttributeError as error:
            self._remarks[
                f"{type_name} on {topic} has no field {error.name!r}: it was recorded with"
                " another version of the interfaces"
            ] = None

    def _look_into(self, message: FoundMessage, type_name: str, content: Any) -> None:
        if type_name == SETUP_TYPE:
            self._setups[message.data] = content
        elif type_name == STREAM_TYPE:
            watch = self._streams.setdefault(message.topic.channel.topic, StreamWatch())
            watch.add(int(content.first_sample), count_points(content.hammer))
        elif type_name == STATE_TYPE:
            lost = int(getattr(content, "messages_lost", 0))
            self._messages_lost = max(self._messages_lost, lost)
        elif type_name == NOTE_TYPE and message.topic.channel.topic.endswith("/note"):
            self._notes.append(Note(message.log_time, str(content.data)))

    def _add_counts(self, topic: Topic, tally: ChannelTally, lost: int) -> None:
        channel = topic.as_channel()
        key = (channel.topic, channel.type_name)
        known = self._topics.get(key)
        if known is None:
            known = TopicContents(*key, channel.schema, channel.metadata)
        has_times = known.messages > 0 and tally.messages > 0
        self._topics[key] = replace(
            known,
            messages=known.messages + tally.messages,
            unverified=known.unverified + tally.unverified,
            lost=known.lost + lost,
            start_time=min(known.start_time, tally.start_time)
            if has_times
            else known.start_time or tally.start_time,
            end_time=max(known.end_time, tally.end_time),
        )


def _check_kind(salvage: Salvage) -> None:
    """Refuse what was never a recording of ROS 2, however damaged."""
    path, header = salvage.path, salvage.header
    if salvage.size == 0:
        raise FileError(f"{path} is empty: it should be an MCAP recording")
    topics = salvage.topics.values()
    if header is None and salvage.chunks == 0 and not topics:
        raise FileError(f"{path} is no MCAP recording, or nothing of it is left")
    is_ros = any(topic.is_ros for topic in topics)
    if header is not None and header.profile != PROFILE and not is_ros:
        raise FileError(
            f"{path} is an MCAP file of profile {header.profile!r}: it should be {PROFILE!r}"
        )
