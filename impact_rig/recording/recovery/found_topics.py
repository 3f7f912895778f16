"""The topics of a file that may be damaged, and how far their descriptions can be relied on."""

from typing import NamedTuple

from mcap.records import Channel as ChannelRecord
from mcap.records import Schema as SchemaRecord

from impact_rig.recording.interfaces.channel import Channel


class Topic(NamedTuple):
    """A topic as the file describes it.

    Attributes
    ----------
    channel : mcap.records.Channel
        Name, encoding, offered QoS and hash.
    schema : mcap.records.Schema, optional
        Of its type.
    is_vouched : bool
        Whether the description is what was written.
    """

    channel: ChannelRecord
    schema: SchemaRecord | None
    is_vouched: bool

    @property
    def is_ros(self) -> bool:
        """Whether its messages are those of ROS 2, and can be decoded."""
        return (
            self.schema is not None
            and self.channel.message_encoding == "cdr"
            and self.schema.encoding == "ros2msg"
        )

    def as_channel(self) -> Channel:
        """Return it as readers of sound recordings know it."""
        name, text = ("", b"") if self.schema is None else (self.schema.name, self.schema.data)
        return Channel(
            self.channel.id,
            self.channel.topic,
            name,
            text.decode(errors="replace"),
            self.channel.metadata,
        )


class FoundTopics:
    """Keeps the first description of each topic and type, but one that is vouched before all."""

    def __init__(self) -> None:
        self._schemas: dict[int, tuple[SchemaRecord, bool]] = {}
        self._channels: dict[int, tuple[ChannelRecord, bool]] = {}
        self._topics: dict[int, Topic] = {}

    @property
    def numbers(self) -> frozenset[int]:
        """Of the channels that are described."""
        return frozenset(self._channels)

    def list_topics(self) -> dict[int, Topic]:
        """Return the topics whose type is described too, by the numbers of their channels."""
        found = ((number, self.find(number)) for number in self._channels)
        return {number: topic for number, topic in found if topic is not None}

    def add_schema(self, record: SchemaRecord, *, is_vouched: bool) -> None:
        """Take the description of a type."""
        if record.id not in self._schemas or (is_vouched and not self._schemas[record.id][1]):
            self._schemas[record.id] = record, is_vouched
            self._topics.clear()

    def add_channel(self, record: ChannelRecord, *, is_vouched: bool) -> None:
        """Take the description of a topic."""
        if record.id not in self._channels or (is_vouched and not self._channels[record.id][1]):
            self._channels[record.id] = record, is_vouched
            self._topics.pop(record.id, None)

    def find(self, number: int) -> Topic | None:
        """Return the topic of a channel; None: it is not described as far as was read."""
        topic = self._topics.get(number)
        if topic is None and number in self._channels:
            channel, is_vouched = self._channels[number]
            if channel.schema_id != 0 and channel.schema_id not in self._schemas:
                return None
            schema, is_schema_vouched = self._schemas.get(channel.schema_id, (None, True))
            topic = Topic(channel, schema, is_vouched and is_schema_vouched)
            self._topics[number] = topic
        return topic
