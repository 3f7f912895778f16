"""The topics of an MCAP file, as its records announce them, and which of them are wanted."""

from collections.abc import Callable
from pathlib import Path

from mcap.records import Channel as ChannelRecord
from mcap.records import Schema

from impact_rig.core.errors import FileError
from impact_rig.recording.interfaces.channel import Channel
from impact_rig.recording.reading.mcap_records import DamageError, read_small
from impact_rig.recording.reading.mcap_summary import Summary

Wanted = Callable[[Channel], bool]
"""Tells whether a channel's messages are to be read."""

MAX_NAME = 512
"""Longest name of a topic or a type [characters], our choice: DDS takes 255."""
_NUMBER_SIZE = 2
"""Of the number that a schema or a channel begins with [byte]."""


class TopicTable:
    """Takes the records that announce topics, in the order of the file.

    Parameters
    ----------
    path : Path
        Of the file, for errors.
    wanted : callable
        Asked once for each channel.

    Attributes
    ----------
    channels : dict
        All that were announced, by number.
    chosen : dict
        The wanted ones among them; None for the others.
    """

    def __init__(self, path: Path, wanted: Wanted) -> None:
        self._path = path
        self._wanted = wanted
        self._schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.chosen: dict[int, Channel | None] = {}

    def add_schema(self, content: bytes) -> None:
        """Take a schema; the first one of a number holds.

        Raises
        ------
        DamageError
            If it is damaged.
        """
        if int.from_bytes(content[:_NUMBER_SIZE], "little") in self._schemas:
            return
        schema = read_small(Schema, content)
        if schema is None:
            raise DamageError("the description of a type makes no sense")
        self._schemas[schema.id] = schema

    def add_channel(self, content: bytes) -> None:
        """Take a channel; the first one of a number holds.

        Raises
        ------
        DamageError
            If it is damaged, or its schema was not announced.
        FileError
            If it is wanted, but not in `cdr` with a schema in `ros2msg`.
        """
        if int.from_bytes(content[:_NUMBER_SIZE], "little") in self.channels:
            return
        record = read_small(ChannelRecord, content)
        if record is None:
            raise DamageError("the description of a topic makes no sense")
        self._add(record)

    def add_summary(self, summary: Summary) -> None:
        """Take all that the index at the end of a file announces; raises as `add_channel`."""
        self._schemas.update(summary.schemas)
        for record in summary.channels.values():
            self._add(record)

    def _add(self, record: ChannelRecord) -> None:
        schema = self._schemas.get(record.schema_id)
        if schema is None:
            if record.schema_id:
                raise DamageError(f"topic {record.topic!r} has no schema")
            schema = Schema(id=0, name="", encoding="", data=b"")
        channel = Channel(
            id=record.id,
            topic=record.topic,
            type_name=schema.name,
            schema=schema.data.decode(errors="replace"),
            metadata=dict(record.metadata),
        )
        if not all(map(_is_name, (channel.topic, channel.type_name))):
            raise DamageError("the name of a topic or of its type makes no sense")
        is_wanted = self._wanted(channel)
        if is_wanted and (record.message_encoding, schema.encoding) != ("cdr", "ros2msg"):
            raise FileError(
                f"{self._path}: topic {record.topic!r} is in {record.message_encoding!r} with a"
                f" schema in {schema.encoding!r}: 'cdr' and 'ros2msg' can be read"
            )
        self.channels[channel.id] = channel
        self.chosen[channel.id] = channel if is_wanted else None


def _is_name(text: str) -> bool:
    """Tell whether a name can be shown: ROS 2 has no others."""
    return len(text) <= MAX_NAME and text.isprintable()
