"""What every file of a split recording says again, so that each can be read alone."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

from impact_rig.recording.interfaces.message_definitions import MessageDefinition
from impact_rig.recording.interfaces.qos_profiles import OfferedQos
from impact_rig.recording.writing.bag_metadata import (
    FileSummary,
    TopicSummary,
    format_bag_metadata,
)
from impact_rig.recording.writing.mcap_writer import McapWriter

HEALTH_RECORD = "impact_rig/health"
"""Metadata record that tells how one file ended; the only one that is not repeated in the next."""


@dataclass
class Topic:
    """One topic, over all files.

    Attributes
    ----------
    name, definition, offers
        As announced.
    count : int
        How many of its messages were added; repeated ones do not count.
    last : tuple, optional
        Data, publish time and sequence of the message that the next file repeats.
    """

    name: str
    definition: MessageDefinition
    offers: tuple[OfferedQos, ...]
    count: int = 0
    last: tuple[bytes, int, int] | None = None

    def __post_init__(self) -> None:
        """Find out whether its last message holds until the next one comes."""
        self.is_state = any(
            offer.durability == "transient_local" and offer.depth == 1 for offer in self.offers
        )


class SplitContents:
    """Topics with the state each one tells, metadata and attachments.

    Attributes
    ----------
    topics : dict
        By the numbers of their channels, which are the same in each file.
    """

    def __init__(self) -> None:
        self.topics: dict[int, Topic] = {}
        self._metadata: dict[str, dict[str, str]] = {}
        self._attachments: dict[str, tuple[str, bytes, int]] = {}

    def add_channel(
        self,
        file: McapWriter,
        topic: str,
        definition: MessageDefinition,
        offers: tuple[OfferedQos, ...],
    ) -> int:
        """Announce a topic in a file, and in those to come."""
        channel = file.add_channel(topic, definition, offers)
        self.topics[channel] = Topic(topic, definition, offers)
        return channel

    def add_message(
        self, file: McapWriter, channel: int, data: bytes, log_time: int, publish_time: int
    ) -> None:
        """Add a message to a file; if it tells a state, it is repeated in the next."""
        topic = self.topics[channel]
        file.add_message(channel, data, log_time, publish_time, topic.count)
        if topic.is_state:
            topic.last = (data, publish_time, topic.count)
        topic.count += 1

    def add_metadata(self, file: McapWriter, name: str, fields: dict[str, str]) -> None:
        """Add a record to a file; the last one of each name is repeated in those to come."""
        file.add_metadata(name, fields)
        if name != HEALTH_RECORD:
            self._metadata[name] = dict(fields)

    def add_attachment(self, file: McapWriter, name: str, media_type: str, data: bytes) -> None:
        """Add an attachment to a file; the last one of each name is repeated."""
        moment = time.time_ns()
        file.add_attachment(name, media_type, data, moment)
        self._attachments[name] = (media_type, data, moment)

    def announce(self, file: McapWriter) -> None:
        """Announce all topics in a new file, under the numbers they have."""
        for topic in self.topics.values():
            file.add_channel(topic.name, topic.definition, topic.offers)

    def repeat(self, file: McapWriter, moment: int) -> None:
        """Write all else into a new file.

        A repeated message keeps its number in its topic and its time of sending; as its time of
        reception it gets `moment` [ns], so that the files' times follow one another.
        """
        for name, fields in self._metadata.items():
            file.add_metadata(name, fields)
        for name, (media_type, data, taken) in self._attachments.items():
            file.add_attachment(name, media_type, data, taken)
        for channel, topic in self.topics.items():
            if topic.last is not None:
                data, publish_time, sequence = topic.last
                file.add_message(channel, data, moment, publish_time, sequence)

    def finish(self, file: McapWriter) -> None:
        """Close a file, with what rosbag2 looks for in it."""
        try:
            if not file.has_failed:
                text = format_bag_metadata([summarize_file(file)], self.summarize([file]))
                file.add_metadata("rosbag2", {"serialized_metadata": text})
        finally:
            file.close()

    def summarize(self, files: Sequence[McapWriter]) -> list[TopicSummary]:
        """Return the topics with what some files together hold of them."""
        return [
            TopicSummary(
                name=topic.name,
                type_name=topic.definition.type_name,
                type_hash=topic.definition.type_hash,
                offers=topic.offers,
                messages=sum(file.count_messages(topic.name) for file in files),
            )
            for topic in self.topics.values()
        ]


def summarize_file(file: McapWriter) -> FileSummary:
    """Return what `metadata.yaml` says of a file."""
    return FileSummary(file.path.name, file.messages, file.start_time, file.end_time)
