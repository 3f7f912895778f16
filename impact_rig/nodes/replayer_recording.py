"""A recording, opened to be replayed: what an estimator works from, as it was recorded."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from rclpy.serialization import serialize_message

from impact_rig.core.errors import FileError
from impact_rig.core.stream import StreamCutter
from impact_rig.nodes import interfaces
from impact_rig.nodes.identity import identity_from_msg
from impact_rig.nodes.interfaces import Topic
from impact_rig.nodes.messages import block_to_msg
from impact_rig.nodes.topics import name_type
from impact_rig.recordings.messages import (
    NANOSECONDS,
    SETUP_TYPE,
    block_from_msg,
    setup_from_msg,
)
from impact_rig.recordings.reader import holds_blocks, is_stream, list_namespaces
from impact_rig.recordings.schemas import SchemaDecoder, check_interfaces, find_message_definition
from impact_rig.recordings.source import open_source

INPUTS = (
    interfaces.SETUP,
    interfaces.ACCELERATION,
    interfaces.RELEASE,
    interfaces.VIRTUAL_IMPACT,
)
"""What is replayed: all else in a recording are results and states."""


class RecordedMessage(NamedTuple):
    """One message that is to be published."""

    topic: Topic
    time: int  # of its reception, nanoseconds since the epoch
    data: bytes  # serialised


class RecordingToReplay:
    """The inputs in the recording of one rig.

    Of a running stream in which no impacts were found before, the impacts are replayed.

    Parameters
    ----------
    path : Path
        See `find_recording`.

    Raises
    ------
    FileError
        If there is none, it is damaged, holds nothing to replay or several rigs, or is of another
        version of the interfaces. So does every method that reads.
    """

    def __init__(self, path: Path) -> None:
        self._source = source = open_source(path)
        self.path = source.path
        self.warnings = source.warnings
        namespaces = list_namespaces(source)
        if len(namespaces) > 1:
            raise FileError(
                f"{path} holds several rigs, in the namespaces {', '.join(namespaces)}:"
                " `ros2 bag play` plays the topics of one"
            )
        prefix = namespaces[0].rstrip("/") + "/" if namespaces else "/"
        by_type = {name_type(topic.type): topic for topic in INPUTS}
        leaves_stream = holds_blocks(source)
        self._topics: dict[int, Topic] = {}
        for channel in source.read_channels():
            is_cut = is_stream(channel) and not leaves_stream
            topic = interfaces.ACCELERATION if is_cut else by_type.get(channel.type_name)
            if topic is None or not channel.topic.startswith(prefix):
                continue
            try:
                check_interfaces(channel, find_message_definition(channel.type_name))
            except FileError as error:
                raise FileError(f"{path}: {error}") from None
            self._topics[channel.id] = topic
        if interfaces.ACCELERATION not in self._topics.values():
            raise FileError(f"{path} holds nothing to replay: no hits of a rig")
        self.first_time, self.last_time = source.read_time_range()

    @property
    def topics(self) -> tuple[Topic, ...]:
        """What is published."""
        return tuple({topic.name: topic for topic in self._topics.values()}.values())

    @property
    def duration(self) -> float:
        """From the first message to the last [s]."""
        return self.compute_position(self.last_time)

    def compute_position(self, moment: int) -> float:
        """Return how long after the first message something was recorded [s]."""
        return (moment - self.first_time) / NANOSECONDS

    def read_messages(
        self, report: Callable[[int], None] = lambda _: None
    ) -> Iterator[RecordedMessage]:
        """Yield the messages in file order; `report` gets now and then how far this is [byte]."""
        decoder = SchemaDecoder()
        cutter: StreamCutter | None = None
        for message in self._source.read_messages(
            lambda channel: channel.id in self._topics, report=report
        ):
            channel, time = message.channel, message.log_time
            topic = self._topics[channel.id]
            if is_stream(channel):
                segment = decoder.decode(channel, message.data)
                identity = identity_from_msg(segment)
                for cut in cutter.feed(block_from_msg(segment)) if cutter else ():
                    data = serialize_message(block_to_msg(cut, identity))
                    yield RecordedMessage(topic, time, data)
                continue
            if channel.type_name == SETUP_TYPE:
                setup = setup_from_msg(decoder.decode(channel, message.data))
                cutter = StreamCutter(setup.analysis)
            yield RecordedMessage(topic, time, message.data)
