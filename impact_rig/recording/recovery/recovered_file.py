"""Writes what is sound in one damaged file to a new one."""

import json
import os
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from mcap.records import Attachment
from mcap.writer import CompressionType, Writer

from impact_rig import __version__
from impact_rig.recording.interfaces.qos_profiles import parse_offered_qos
from impact_rig.recording.recovery.contents import RECOVERY_RECORD, FileContents
from impact_rig.recording.recovery.file_tally import PROFILE
from impact_rig.recording.recovery.found import ChunkEnd, Found, FoundMessage
from impact_rig.recording.recovery.found_topics import Topic
from impact_rig.recording.recovery.inspection import MessageCheck
from impact_rig.recording.recovery.salvage import Salvage
from impact_rig.recording.writing.bag_metadata import (
    NO_TIME,
    FileSummary,
    TopicSummary,
    format_bag_metadata,
)

LIBRARY = f"impact_rig-recover {__version__}"
"""What the new files say wrote them: in these, numbers of messages may be left out."""
LARGEST_CHUNK = 1 << 26
"""Where a chunk is finished although that of the damaged file was larger [byte], our choice."""
BAG_RECORD = "rosbag2"
"""Metadata record of rosbag2 with the counts of the file: it is made anew."""


def write_recovered_file(
    path: Path,
    name: str,
    source: FileContents,
    check: MessageCheck,
    fields: dict[str, str],
    unverified: dict[str, list[int]],
    report: Callable[[int], None],
) -> None:
    """Write everything that is sound in a file to a new one, chunk by chunk.

    Parameters
    ----------
    path : Path
        Where to write.
    name : str
        Of the new file, once it is complete.
    source : FileContents
        The damaged one.
    check : MessageCheck
        Tells which messages are kept.
    fields : dict
        What the new file says of the recovery.
    unverified : dict
        The numbers of kept messages that no checksum vouches for are added here, by topic.
    report : callable
        Told how many bytes were looked at, now and then.

    Raises
    ------
    FileError
        If the damaged file cannot be read.
    OSError
        If the new one cannot be written.
    """
    compression = source.compression[0] if source.compression else "zstd"
    if compression.upper() not in CompressionType.__members__:
        compression = "zstd"
    with path.open("xb") as file:
        output = _Output(
            Writer(
                file, chunk_size=LARGEST_CHUNK, compression=CompressionType[compression.upper()]
            )
        )
        salvage = Salvage(source.path, report)
        for found in salvage.read():
            if isinstance(found, FoundMessage) and not found.is_vouched:
                if not check.is_kept(found):
                    continue
                unverified.setdefault(found.topic.channel.topic, []).append(found.sequence)
            output.add(found)
        for topic in salvage.topics.values():
            output.find_channel(topic)
        kept = json.dumps(unverified, ensure_ascii=False)
        output.finish(name, {**fields, "library": source.library, "unverified": kept})
        file.flush()
        os.fsync(file.fileno())


class _Output:
    """The new file: topics get their numbers as they come."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._writer.start(PROFILE, LIBRARY)
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._channels: dict[int, tuple[Topic, int]] = {}
        self._counts: Counter[int] = Counter()
        self._start_time, self._end_time = NO_TIME, 0

    def add(self, found: Found) -> None:
        """Write what was found."""
        if isinstance(found, FoundMessage):
            number = self.find_channel(found.topic)
            self._counts[number] += 1
            self._start_time = min(self._start_time, found.log_time)
            self._end_time = max(self._end_time, found.log_time)
            self._writer.add_message(
                number, found.log_time, found.data, found.publish_time, found.sequence
            )
        elif isinstance(found, ChunkEnd):
            self._writer.flush()
        elif isinstance(found, Attachment):
            self._writer.add_attachment(
                found.create_time, found.log_time, found.name, found.media_type, found.data
            )
        elif found.name != BAG_RECORD:
            self._writer.add_metadata(found.name, found.metadata)

    def find_channel(self, topic: Topic) -> int:
        """Return the number of a topic's channel, which is announced if it is new."""
        known = self._channels.get(topic.channel.id)
        if known is not None and known[0][:2] == topic[:2]:
            return known[1]
        schema, channel = topic.schema, topic.channel
        schema_id = 0
        if schema is not None:
            key = (schema.name, schema.data)
            if key not in self._schemas:
                self._schemas[key] = self._writer.register_schema(
                    schema.name, schema.encoding, schema.data
                )
            schema_id = self._schemas[key]
        number = self._writer.register_channel(
            channel.topic, channel.message_encoding, schema_id, dict(channel.metadata)
        )
        self._channels[channel.id] = topic, number
        return number

    def finish(self, name: str, fields: dict[str, str]) -> None:
        """Write what the file says of itself, and its index."""
        self._writer.flush()
        self._writer.add_metadata(RECOVERY_RECORD, fields)
        topics = [
            TopicSummary(
                topic.channel.topic,
                topic.schema.name if topic.schema is not None else "",
                topic.channel.metadata.get("topic_type_hash", ""),
                parse_offered_qos(topic.channel.metadata.get("offered_qos_profiles", "")),
                self._counts[number],
            )
            for topic, number in self._channels.values()
        ]
        files = [FileSummary(name, self._counts.total(), self._start_time, self._end_time)]
        text = format_bag_metadata(files, topics)
        self._writer.add_metadata(BAG_RECORD, {"serialized_metadata": text})
        self._writer.finish()
