"""A recording, opened to be replayed: its topics, the chosen hits, the messages in their order."""

import heapq
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message

from impact_rig.core.errors import FileError, ParameterError
from impact_rig.core.hits.overrule import find_label
from impact_rig.core.signals.record import NOT_ARMED, HitLabel
from impact_rig.core.signals.stream_cutter import StreamCutter
from impact_rig.nodes import interfaces
from impact_rig.nodes.messages import block_to_msg
from impact_rig.nodes.topics import describe_qos, import_type, make_qos, name_type
from impact_rig.recordings.messages import (
    BLOCK_TYPE,
    NANOSECONDS,
    SETUP_TYPE,
    STREAM_TYPE,
    VIRTUAL_IMPACT_TYPE,
    block_from_msg,
    label_from_msg,
    setup_from_msg,
)
from impact_rig.recordings.qos import DEFAULT_DEPTH, choose_qos, parse_offered_qos
from impact_rig.recordings.reader import holds_blocks, is_stream, list_namespaces, make_relative
from impact_rig.recordings.records import Channel, RawMessage
from impact_rig.recordings.schemas import SchemaDecoder, check_interfaces, find_message_definition
from impact_rig.recordings.source import RecordingSource, open_source

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
    """

    channel: Channel
    name: str
    type: Any
    qos: QoSProfile

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
        Told what is left out.

    Raises
    ------
    FileError
        If an estimator's input was recorded with another version of the interfaces, or there is
        nothing to publish.
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
    found = (chosen,) if chosen else list_namespaces(source)
    if len(found) > 1:
        raise FileError(
            f"{source.path} holds several rigs, in the namespaces {', '.join(found)}: choose one"
            " by the parameter recorded_namespace"
        )
    return "/" + (found[0] if found else "").strip("/")


def _make_topic(channel: Channel, name: str, known: interfaces.Topic | None) -> ReplayTopic:
    if is_stream(channel):
        hits = interfaces.ACCELERATION
        return ReplayTopic(channel, hits.name, hits.type, hits.qos)
    kind = import_type(channel.type_name)
    check_interfaces(channel, find_message_definition(channel.type_name))
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
    )


HIT_TYPES = frozenset(
    {
        BLOCK_TYPE,
        VIRTUAL_IMPACT_TYPE,
        "impact_rig_msgs/msg/HammerRelease",
        "impact_rig_msgs/msg/Impact",
        "impact_rig_msgs/msg/RecordStored",
    }
)
"""Messages that belong to one hit."""


class Cue(NamedTuple):
    """One message that is to be published.

    Attributes
    ----------
    channel : int
        Number of its channel in the recording.
    time : int
        When it is due, nanoseconds since the epoch, by the recording's clock.
    data : bytes
        Serialised, in today's form.
    record : int or None
        Of which it is a block; None: it is none.
    is_last : bool
        It ends its record.
    is_setup : bool
        It is a set-up.
    is_cut : bool
        A hit was left out before it: the time that took is not waited for.
    """

    channel: int
    time: int
    data: bytes
    record: int | None = None
    is_last: bool = False
    is_setup: bool = False
    is_cut: bool = False


@dataclass(frozen=True)
class HitChoice:
    """Which hits are replayed.

    Attributes
    ----------
    samples : frozenset of str
        All hits of these.
    labels : frozenset of HitLabel
        And these.
    """

    samples: frozenset[str]
    labels: frozenset[HitLabel]

    def holds(self, label: HitLabel) -> bool:
        """Return whether a hit is replayed."""
        return label.sample in self.samples or label in self.labels


@dataclass(frozen=True)
class ReplayPlan:
    """The messages of one pass.

    Attributes
    ----------
    source : RecordingSource
        The recording.
    topics : mapping
        What is published, by channel number.
    start, end : int or None
        Only what was logged from the one to before the other, nanoseconds since the epoch.
        What a late subscriber still gets of the time before the start comes first.
    choice : HitChoice or None
        Only these hits; None: all.
    """

    source: RecordingSource
    topics: Mapping[int, ReplayTopic]
    start: int | None
    end: int | None
    choice: HitChoice | None

    def read_cues(self) -> Iterator[Cue]:
        """Yield the messages of one pass.

        Raises
        ------
        FileError
            If the recording is damaged, or a message does not fit its schema.
        """
        decoder, is_cut = SchemaDecoder(), False
        cutter: StreamCutter | None = None
        for message in self._read_messages():
            channel, time = message.channel, max(message.log_time, self.start or 0)
            if is_stream(channel):
                # So a replay as fast as its subscribers take it waits for each hit, and not for a
                # stream.
                block = block_from_msg(decoder.decode(channel, message.data))
                for cut in cutter.feed(block) if cutter else ():
                    if self._holds(cut.label):
                        data = serialize_message(block_to_msg(cut))
                        yield Cue(channel.id, time, data, cut.label.record, cut.last)
                continue
            is_setup, is_block = channel.type_name == SETUP_TYPE, channel.type_name == BLOCK_TYPE
            if is_setup:
                setup = setup_from_msg(decoder.decode(channel, message.data))
                cutter = StreamCutter(setup.analysis)
            label, is_last = None, False
            if is_block or (self.choice is not None and channel.type_name in HIT_TYPES):
                label, is_last = _read_label(decoder, message)
            if label is not None and not self._holds(label):
                is_cut = True
                continue
            record = label.record if label is not None and is_block else None
            yield Cue(channel.id, time, message.data, record, is_last, is_setup, is_cut)
            is_cut = False

    def _holds(self, label: HitLabel) -> bool:
        return self.choice is None or self.choice.holds(label)

    def _read_messages(self) -> Iterator[RawMessage]:
        if self.start is not None:
            yield from self._read_latched(self.start)
        yield from self.source.read_messages(
            lambda channel: channel.id in self.topics, start_time=self.start, end_time=self.end
        )

    def _read_latched(self, start: int) -> list[RawMessage]:
        """Return what subscribers who come at the start still get, in its order."""

        def is_latched(channel: Channel) -> bool:
            return channel.id in self.topics and self.topics[channel.id].latched > 0

        kept: dict[int, deque[RawMessage]] = {}
        for message in self.source.read_messages(is_latched, end_time=start):
            number = message.channel.id
            kept.setdefault(number, deque(maxlen=self.topics[number].latched)).append(message)
        return list(heapq.merge(*kept.values(), key=lambda message: message.log_time))


def choose_hits(
    source: RecordingSource,
    channels: Collection[int],
    samples: Sequence[str],
    names: Sequence[str],
) -> HitChoice | None:
    """Find the hits that a person names; None: nothing is named.

    Parameters
    ----------
    source : RecordingSource
        The recording, all of which is read.
    channels : collection of int
        Numbers of the channels that hold the rig's blocks, or its stream.
    samples : sequence of str
        Names: all hits of these.
    names : sequence of str
        Of single hits; see `find_label`.

    Raises
    ------
    FileError
        If the recording is damaged.
    ParameterError
        If there is no such sample or hit, or several hits are called so.
    """
    if not samples and not names:
        return None
    decoder = SchemaDecoder()
    labels = {
        _read_label(decoder, message)[0]: None
        for message in source.read_messages(lambda channel: channel.id in channels)
    }
    labels.pop(NOT_ARMED, None)
    known = list(dict.fromkeys(label.sample for label in labels))
    for sample in samples:
        if sample not in known:
            raise ParameterError(
                f"{source.path} holds no hit of a sample {sample!r}: there are {', '.join(known)}"
            )
    return HitChoice(
        frozenset(samples), frozenset(find_label(name, list(labels)) for name in names)
    )


def _read_label(decoder: SchemaDecoder, message: RawMessage) -> tuple[HitLabel, bool]:
    """Return the hit that a message belongs to, and whether it ends the hit's record."""
    decoded = decoder.decode(message.channel, message.data)
    try:
        return label_from_msg(decoded), bool(getattr(decoded, "last", False))
    except AttributeError as error:
        raise FileError(
            f"{message.channel.type_name} on {message.channel.topic} has no field {error.name!r}"
        ) from None


@dataclass(frozen=True)
class RecordingToReplay:
    """What is known of a recording before it is replayed.

    Attributes
    ----------
    source : RecordingSource
        Where it is.
    topics : mapping
        What is published, by channel number.
    choice : HitChoice or None
        Only these hits; None: all.
    first_time, last_time : int
        Of its messages, nanoseconds since the epoch.
    warnings : tuple of str
        What the user should know.
    """

    source: RecordingSource
    topics: Mapping[int, ReplayTopic]
    choice: HitChoice | None
    first_time: int
    last_time: int
    warnings: tuple[str, ...]

    @property
    def duration(self) -> float:
        """From the first message to the last [s]."""
        return self.compute_position(self.last_time)

    @property
    def has_truths(self) -> bool:
        """Whether it holds the truth behind simulated hits."""
        return any(
            topic.channel.type_name == VIRTUAL_IMPACT_TYPE for topic in self.topics.values()
        )

    @property
    def block_names(self) -> tuple[str, ...]:
        """Names of the topics that hold the rig's blocks."""
        return tuple(
            topic.name
            for topic in self.topics.values()
            if topic.channel.type_name in (BLOCK_TYPE, STREAM_TYPE)
        )

    def compute_position(self, moment: int) -> float:
        """Return how long after the first message something was recorded [s]."""
        return (moment - self.first_time) / NANOSECONDS

    def read_campaign_times(self) -> list[tuple[float, float]]:
        """Return from when to when each campaign with blocks was recorded.

        A set-up begins a campaign; what comes before the first one is part of it, as in the
        analysis of the file.

        Returns
        -------
        list of (start, end)
            Since the first message [s]; an end of 0: the recording's.

        Raises
        ------
        FileError
            If the recording is damaged, or holds no set-up.
        """
        kinds = {number: topic.channel.type_name for number, topic in self.topics.items()}
        begins: list[float] = []
        with_blocks: set[int] = set()
        for message in self.source.read_messages(
            lambda channel: kinds.get(channel.id) in (SETUP_TYPE, BLOCK_TYPE, STREAM_TYPE)
        ):
            if message.channel.type_name == SETUP_TYPE:
                begins.append(self.compute_position(message.log_time) if begins else 0.0)
            else:
                with_blocks.add(max(len(begins) - 1, 0))
        if not begins:
            raise FileError(
                f"{self.source.path} holds no set-up of a rig: without masses and settings its"
                " blocks cannot be evaluated"
            )
        ends = [*begins[1:], 0.0]
        return [(begins[number], ends[number]) for number in sorted(with_blocks)]

    def make_plan(self, start: float, end: float) -> ReplayPlan:
        """Return what is published of a part of it.

        Parameters
        ----------
        start, end : float
            Since its first message [s]; an end of 0: all of it.

        Raises
        ------
        ParameterError
            If it is shorter, or the end is not after the start.
        """
        if start > self.duration:
            raise ParameterError(f"start is {start:g} s: the recording takes {self.duration:g} s")
        if end and end <= start:
            raise ParameterError(f"end is {end:g} s: it must be later than start, {start:g} s")
        return ReplayPlan(
            self.source,
            self.topics,
            start=self.first_time + round(start * NANOSECONDS) if start else None,
            end=self.first_time + round(end * NANOSECONDS) if end else None,
            choice=self.choice,
        )


def open_recording(
    path: Path,
    *,
    namespace: str,
    is_everything: bool,
    samples: Sequence[str],
    hits: Sequence[str],
) -> RecordingToReplay:
    """Open a recording.

    Parameters
    ----------
    path : Path
        Of a file or a folder; see `find_recording`.
    namespace : str
        Of the rig in it; empty: it is found.
    is_everything : bool
        Whether all its topics are published, not only what an estimator works from.
    samples, hits : sequence of str
        Only these hits, by name; both empty: all.

    Raises
    ------
    FileError
        If there is none, it is damaged, or holds nothing to replay.
    ParameterError
        If there is no such sample or hit.
    """
    source = open_source(path)
    warnings = list(source.warnings)
    topics = choose_topics(
        source,
        choose_namespace(source, namespace),
        is_everything=is_everything,
        warn=warnings.append,
    )
    blocks = {
        topic.channel.id
        for topic in topics
        if topic.channel.type_name in (BLOCK_TYPE, STREAM_TYPE)
    }
    choice = choose_hits(source, blocks, samples, hits)
    first_time, last_time = source.read_time_range()
    return RecordingToReplay(
        source=source,
        topics={topic.channel.id: topic for topic in topics},
        choice=choice,
        first_time=first_time,
        last_time=last_time,
        warnings=tuple(warnings),
    )
