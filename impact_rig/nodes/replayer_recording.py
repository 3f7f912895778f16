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
    NO_ID,
    SETUP_TYPE,
    STREAM_TYPE,
    block_from_msg,
    campaign_id_from_msg,
    setup_from_msg,
)
from impact_rig.recordings.reader import holds_blocks, is_stream, list_namespaces
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.schemas import SchemaDecoder, check_interfaces, find_message_definition
from impact_rig.recordings.source import find_recordings

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
    time: int  # of its reception, since the first message [ns]
    data: bytes  # serialised


class RecordingToReplay:
    """The inputs in the recording of one rig; of a run that was resumed, all its files in turn.

    Of a running stream in which no impacts were found before, the impacts are replayed.

    Parameters
    ----------
    path : Path
        See `find_recordings`.

    Raises
    ------
    FileError
        If there is none, it is damaged, holds nothing to replay or several rigs, or is of another
        version of the interfaces. So does every method that reads.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        files = [Scan(part) for part in find_recordings(path)]
        namespaces = list_namespaces(files[0])
        if len(namespaces) > 1:
            raise FileError(
                f"{path} holds several rigs, in the namespaces {', '.join(namespaces)}:"
                " `ros2 bag play` plays the topics of one"
            )
        prefix = namespaces[0].rstrip("/") + "/" if namespaces else "/"
        self._files = [(file, _find_topics(file, prefix)) for file in files]
        self.topics = {topic.name: topic for _, found in self._files for topic in found.values()}
        if interfaces.ACCELERATION.name not in self.topics:
            raise FileError(f"{path} holds nothing to replay: no hits of a rig")
        self.warnings = tuple(warning for file in files for warning in file.warnings)
        self.size = sum(file.size for file in files)  # [byte]
        ranges = [file.read_time_range() for file in files]
        self.duration = sum(last - first for first, last in ranges)  # [ns], of all files

    def read_messages(
        self, report: Callable[[int], None] = lambda _: None
    ) -> Iterator[RecordedMessage]:
        """Yield the messages in file order; `report` gets now and then how far this is [byte]."""
        decoder = SchemaDecoder()
        cutter: StreamCutter | None = None
        campaign = NO_ID
        done = elapsed = 0
        for file, topics in self._files:
            first, last = file.read_time_range()
            for message in file.read_messages(
                lambda channel, topics=topics: channel.id in topics,  # type: ignore[misc]
                lambda size, done=done: report(done + size),  # type: ignore[misc]
            ):
                channel, time = message.channel, elapsed + message.log_time - first
                topic = topics[channel.id]
                if is_stream(channel):
                    segment = decoder.decode(channel, message.data)
                    identity = identity_from_msg(segment)
                    for cut in cutter.feed(block_from_msg(segment)) if cutter else ():
                        data = serialize_message(block_to_msg(cut, identity))
                        yield RecordedMessage(topic, time, data)
                    continue
                if channel.type_name == SETUP_TYPE:
                    setup = decoder.decode(channel, message.data)
                    cutter = StreamCutter(setup_from_msg(setup).analysis)
                    before, campaign = campaign, campaign_id_from_msg(setup)
                    # A run that was resumed has the set-up of its campaign in each file.
                    if campaign == before != NO_ID:
                        continue
                yield RecordedMessage(topic, time, message.data)
            done += file.size
            elapsed += last - first


def _find_topics(file: Scan, prefix: str) -> dict[int, Topic]:
    """Return what is replayed of a file, by the numbers of its channels."""
    by_type = {name_type(topic.type): topic for topic in INPUTS}
    if not holds_blocks(file):
        by_type[STREAM_TYPE] = interfaces.ACCELERATION
    topics: dict[int, Topic] = {}
    for channel in file.read_channels():
        topic = by_type.get(channel.type_name)
        if topic is None or not channel.topic.startswith(prefix):
            continue
        try:
            check_interfaces(channel, find_message_definition(channel.type_name))
        except FileError as error:
            raise FileError(f"{file.path}: {error}") from None
        topics[channel.id] = topic
    return topics
