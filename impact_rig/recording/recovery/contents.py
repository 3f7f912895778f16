"""What a recording holds, how sound it is, and what was lost of it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from impact_rig.recording.reading.raw_records import MetadataRecord
from impact_rig.recording.recovery.found import Damage
from impact_rig.recording.recovery.recorded_hits import HitState, RecordedHit

RECOVERY_RECORD = "impact_rig/recovery"
"""Metadata record that tells what a recording was recovered from, and what was lost."""


@dataclass(frozen=True)
class TopicContents:
    """One topic of a recording.

    Attributes
    ----------
    name, type_name : str
        In full.
    schema : str
        Of its type.
    metadata : mapping
        `offered_qos_profiles` and `topic_type_hash` for ROS 2.
    messages : int
        Those that are sound [-].
    unverified : int
        Those that fit the schema, but no checksum vouches for them [-].
    lost : int
        Further ones that are known to have been written [-].
    start_time, end_time : int
        Earliest and latest time of reception of the sound ones, nanoseconds since the epoch.
    """

    name: str
    type_name: str
    schema: str
    metadata: Mapping[str, str]
    messages: int = 0
    unverified: int = 0
    lost: int = 0
    start_time: int = 0
    end_time: int = 0

    @property
    def rate(self) -> float:
        """Messages per second [Hz]; NaN below two messages."""
        duration = (self.end_time - self.start_time) * 1e-9
        return (self.messages - 1) / duration if self.messages > 1 and duration > 0 else math.nan


@dataclass(frozen=True)
class FileContents:
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
    messages : int
        Those that are sound [-].
    start_time, end_time : int
        Earliest and latest time of their reception, nanoseconds since the epoch.
    is_closed, has_index : bool
        Whether it has an end, and an index that can be used.
    damages : tuple of Damage
        What cannot be read.
    problems : tuple of str
        Everything that is wrong with it, in words.
    """

    path: Path
    size: int
    library: str
    compression: tuple[str, ...]
    chunks: int
    messages: int
    start_time: int
    end_time: int
    is_closed: bool
    has_index: bool
    damages: tuple[Damage, ...]
    problems: tuple[str, ...]

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
class RecordedStream:
    """What there is of a running stream.

    Attributes
    ----------
    topic : str
        In full.
    blocks, points : int
        How many, the points per channel [-].
    gaps, missing_points : int
        Jumps between its blocks, and the points they leave out per channel [-].
    """

    topic: str
    blocks: int
    points: int
    gaps: int
    missing_points: int


@dataclass(frozen=True)
class Note:
    """What an operator said, and when [ns since the epoch]."""

    time: int
    text: str


@dataclass(frozen=True)
class Contents:
    """What a recording holds.

    Attributes
    ----------
    path : Path
        As it was named: a file or a folder.
    files : tuple of FileContents
        In the order of recording.
    missing_files : tuple of str
        Files of the folder that are not there.
    topics : tuple of TopicContents
        By name.
    hits : tuple of RecordedHit
        In the order in which they happened.
    streams : tuple of RecordedStream
        By topic.
    metadata : tuple of MetadataRecord
        As found.
    attachments : tuple of AttachmentEntry
        As found.
    notes : tuple of Note
        The operator's.
    setups : tuple
        The set-up messages, decoded, each once.
    messages_lost : int
        What the middleware dropped on the way to the recorder [-].
    unknown_messages : int
        Messages whose topic is not described anywhere [-].
    remarks : tuple of str
        What else a reader should know, in words.
    """

    path: Path
    files: tuple[FileContents, ...]
    missing_files: tuple[str, ...]
    topics: tuple[TopicContents, ...]
    hits: tuple[RecordedHit, ...]
    streams: tuple[RecordedStream, ...]
    metadata: tuple[MetadataRecord, ...]
    attachments: tuple[AttachmentEntry, ...]
    notes: tuple[Note, ...]
    setups: tuple[Any, ...]
    messages_lost: int
    unknown_messages: int
    remarks: tuple[str, ...]

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
        return (
            is_original and is_closed and not (self.missing_files or self.unverified or self.lost)
        )

    @property
    def messages(self) -> int:
        """Those that are sound [-]."""
        return sum(topic.messages for topic in self.topics)

    @property
    def unverified(self) -> int:
        """Those that fit their schema, but no checksum vouches for them [-]."""
        return sum(topic.unverified for topic in self.topics)

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
