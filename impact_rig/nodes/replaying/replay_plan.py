"""What a replay publishes, in order: one pass through the chosen part of a recording."""

import heapq
from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from impact_rig.core.errors import FileError, ParameterError
from impact_rig.core.hits.overrule import find_label
from impact_rig.core.signals.record import NOT_ARMED, HitLabel
from impact_rig.nodes.replaying.replay_topics import ReplayTopic
from impact_rig.nodes.replaying.replayed_stream import ReplayedStream
from impact_rig.recording.interfaces.channel import Channel
from impact_rig.recording.interfaces.messages import label_from_msg
from impact_rig.recording.interfaces.schema_decoder import SchemaDecoder
from impact_rig.recording.reading.mcap_reader import (
    BLOCK_TYPE,
    SETUP_TYPE,
    VIRTUAL_IMPACT_TYPE,
    is_stream,
)
from impact_rig.recording.reading.raw_records import RawMessage
from impact_rig.recording.reading.source import RecordingSource

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


class ReplayPlan:
    """The messages of one pass.

    Parameters
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

    def __init__(
        self,
        source: RecordingSource,
        topics: Mapping[int, ReplayTopic],
        *,
        start: int | None = None,
        end: int | None = None,
        choice: HitChoice | None = None,
    ) -> None:
        self._source = source
        self._topics = topics
        self._start = start
        self._end = end
        self._choice = choice
        self._decoder = SchemaDecoder()

    def read_cues(self) -> Iterator[Cue]:
        """Yield the messages of one pass.

        Raises
        ------
        FileError
            If the recording is damaged, or a message does not fit its schema.
        """
        is_cut = False
        stream = ReplayedStream()
        for message in self._read_messages():
            if is_stream(message.channel):
                yield from self._find_hits(stream, message)
                continue
            if message.channel.type_name == SETUP_TYPE:
                stream.begin(self._decoder.decode(message.channel, message.data))
            label, is_last = self._look_into(message)
            if label is not None and self._choice is not None and not self._choice.holds(label):
                is_cut = True
                continue
            yield Cue(
                message.channel.id,
                max(message.log_time, self._start or 0),
                self._convert(message),
                label.record if label and message.channel.type_name == BLOCK_TYPE else None,
                is_last,
                message.channel.type_name == SETUP_TYPE,
                is_cut,
            )
            is_cut = False

    def _find_hits(self, stream: ReplayedStream, message: RawMessage) -> Iterator[Cue]:
        """Yield the blocks of the hit that a block of a running stream completes."""
        block = self._decoder.decode(message.channel, message.data)
        time = max(message.log_time, self._start or 0)
        for label, is_last, data in stream.cut(block):
            if self._choice is None or self._choice.holds(label):
                yield Cue(message.channel.id, time, data, label.record, is_last)

    def _read_messages(self) -> Iterator[RawMessage]:
        if self._start is not None:
            yield from self._read_latched(self._start)
        yield from self._source.read_messages(
            lambda channel: channel.id in self._topics,
            start_time=self._start,
            end_time=self._end,
        )

    def _read_latched(self, start: int) -> list[RawMessage]:
        """Return what subscribers who come at the start still get, in its order."""

        def is_latched(channel: Channel) -> bool:
            return channel.id in self._topics and self._topics[channel.id].latched > 0

        kept: dict[int, deque[RawMessage]] = {}
        for message in self._source.read_messages(is_latched, end_time=start):
            number = message.channel.id
            kept.setdefault(number, deque(maxlen=self._topics[number].latched)).append(message)
        return list(heapq.merge(*kept.values(), key=lambda message: message.log_time))

    def _look_into(self, message: RawMessage) -> tuple[HitLabel | None, bool]:
        """Return the hit that a message belongs to, and whether it ends the record."""
        kind = message.channel.type_name
        if kind != BLOCK_TYPE and (self._choice is None or kind not in HIT_TYPES):
            return None, False
        return _read_label(self._decoder, message)

    def _convert(self, message: RawMessage) -> bytes:
        converter = self._topics[message.channel.id].converter
        return message.data if converter is None else converter.convert(message.data)


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
