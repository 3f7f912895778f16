"""Which of a recording's topics are published again, and in which form."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile

from impact_rig.core.errors import FileError
from impact_rig.nodes import interfaces
from impact_rig.nodes.topics import describe_qos, import_type, make_qos, name_type
from impact_rig.recording.interfaces.channel import Channel
from impact_rig.recording.interfaces.interface_changes import InterfaceConverter
from impact_rig.recording.interfaces.message_definitions import (
    find_message_definition,
    is_same_definition,
)
from impact_rig.recording.interfaces.qos_profiles import (
    DEFAULT_DEPTH,
    choose_qos,
    parse_offered_qos,
)
from impact_rig.recording.reading.mcap_reader import (
    find_namespaces,
    holds_blocks,
    is_stream,
    make_relative,
)
from impact_rig.recording.reading.source import RecordingSource

INPUTS = {
    name_type(topic.type): topic
    for topic in (
        interfaces.SETUP,
        interfaces.ACCELERATION,
        interfaces.STREAM,
        interfaces.RELEASE,
        interfaces.VIRTUAL_IMPACT,
    )
}
"""What an estimator works from, by type: all else in a recording are results and states."""
OWN = frozenset({interfaces.REPLAYER_STATE.name, interfaces.CLOCK.name})
"""What the replayer says itself: where a recording holds that of an earlier replay, it is left
out."""


@dataclass(frozen=True)
class ReplayTopic:
    """One channel of a recording, to be published again.

    Attributes
    ----------
    channel : Channel
        In the recording.
    name : str
        Of the topic, relative to the replayer's namespace unless it lies outside.
    type : type
        Message class.
    qos : QoSProfile
        As recorded.
    converter : InterfaceConverter or None
        Makes today's messages of the recorded ones; None: they are the same.
    """

    channel: Channel
    name: str
    type: Any
    qos: QoSProfile
    converter: InterfaceConverter | None

    @property
    def latched(self) -> int:
        """How many of its last messages who comes late still gets [-]."""
        is_latched = self.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
        return self.qos.depth if is_latched else 0


def choose_topics(
    source: RecordingSource, namespace: str, *, is_everything: bool, warn: Callable[[str], None]
) -> tuple[ReplayTopic, ...]:
    """Return the topics that are published again.

    Parameters
    ----------
    source : RecordingSource
        The recording.
    namespace : str
        Of the rig in it.
    is_everything : bool
        Not only what an estimator works from.
    warn : callable
        Told what is left out or filled up.

    Raises
    ------
    FileError
        If an estimator's input was recorded with interfaces that cannot be made today's, or
        there is nothing to publish.
    """
    topics = []
    # Of a stream the impacts are published: where that was done already, it is left out.
    leaves_stream = holds_blocks(source)
    for channel in source.read_channels():
        if leaves_stream and is_stream(channel):
            continue
        name = make_relative(channel.topic, namespace)
        known = INPUTS.get(channel.type_name) if not name.startswith("/") else None
        if name in OWN or (known is None and not is_everything):
            continue
        try:
            topic = _make_topic(channel, name, known)
        except FileError as error:
            if known is not None:
                raise FileError(f"{source.path}: {error}") from None
            warn(f"{channel.topic} is not replayed: {error}")
            continue
        if topic.converter is not None:
            warn(str(topic.converter))
        topics.append(topic)
    if not topics:
        names = ", ".join(topic.name for topic in INPUTS.values())
        raise FileError(f"{source.path} holds nothing to replay: no topic of {names}")
    return tuple(topics)


def choose_namespace(source: RecordingSource, chosen: str) -> str:
    """Return the namespace of the rig in a recording: the chosen one, or the only one.

    Raises
    ------
    FileError
        If there are several, and none was chosen.
    """
    found = (chosen,) if chosen else find_namespaces(source)
    if len(found) > 1:
        raise FileError(
            f"{source.path} holds several rigs, in the namespaces {', '.join(found)}: choose one"
            " by the parameter recorded_namespace"
        )
    return "/" + (found[0] if found else "").strip("/")


def _make_topic(channel: Channel, name: str, known: interfaces.Topic | None) -> ReplayTopic:
    if is_stream(channel):
        hits = interfaces.ACCELERATION
        return ReplayTopic(channel, hits.name, hits.type, hits.qos, converter=None)
    kind = import_type(channel.type_name)
    installed = find_message_definition(channel.type_name).text
    is_same = is_same_definition(installed, channel.schema)
    offers = parse_offered_qos(channel.metadata.get("offered_qos_profiles", ""))
    if known is not None:
        # Who listens wants what the rig's own nodes offer, whatever another recorder noted.
        depth = max((offer.depth for offer in offers), default=0)
        offers = (replace(describe_qos(known.qos), depth=max(depth, known.qos.depth)),)
    return ReplayTopic(
        channel=channel,
        name=known.name if known else name,
        type=kind,
        qos=make_qos(choose_qos(offers), 1 if known else DEFAULT_DEPTH),
        converter=None if is_same else InterfaceConverter(channel, installed),
    )
