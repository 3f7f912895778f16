"""Conversion between the rig's messages and core types.

They read attributes only, of messages decoded by rclpy or by a file reader: a node and a recording
give bit-identical numbers.
"""

from collections.abc import Callable
from dataclasses import asdict
from functools import cache, lru_cache
from typing import Any, NamedTuple, TypeVar, get_type_hints

import numpy as np
from rosbags.typesys.store import Typestore

from impact_rig import __version__
from impact_rig.core.quantity import list_stored
from impact_rig.core.records import (
    NOT_ARMED,
    UNSTATED,
    Block,
    ChannelBlock,
    HitLabel,
    Origin,
    RawArray,
)
from impact_rig.core.sensors import Sensor
from impact_rig.core.setup import AnalysisSettings, RigSetup, Sample, SampleSet
from impact_rig.recordings.schemas import (
    MessageDefinition,
    find_message_definition,
    parse_schema,
)

PACKAGE = "impact_rig_msgs/msg/"
SETUP_TYPE = PACKAGE + "RigSetup"
BLOCK_TYPE = PACKAGE + "AccelerationBlock"
STREAM_TYPE = PACKAGE + "StreamBlock"
VIRTUAL_IMPACT_TYPE = PACKAGE + "VirtualImpact"
"""Types that tell the rig's topics in a recording, whatever they were remapped to."""
NANOSECONDS = 1_000_000_000
NO_ID = bytes(16)
"""Of no campaign, and of what was recorded before there were ids: an id like another."""

_T = TypeVar("_T")


def stamp_from_msg(stamp: Any) -> int:
    """Return a `builtin_interfaces/Time` as nanoseconds since the epoch."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def campaign_id_from_msg(message: Any) -> bytes:
    """Return the id of the campaign that a message belongs to; older recordings have none."""
    found = getattr(message, "campaign_id", None)
    return NO_ID if found is None else bytes(found.uuid)


def label_from_msg(message: Any) -> HitLabel:
    """Return the hit that a message with record, sample, impact and attempt belongs to."""
    return HitLabel(
        sample=str(message.sample),
        record=int(message.record),
        impact=int(message.impact),
        attempt=int(message.attempt),
    )


def origin_from_msg(message: Any) -> Origin:
    """Return the origin of a block or verdict; older recordings have none.

    Raises
    ------
    ParameterError
        If it is of no known kind.
    """
    found = getattr(message, "origin", None)
    if found is None:
        return UNSTATED
    return _make_origin(found.kind, found.source, found.file, found.place)


# All blocks of a source share one.
_make_origin = lru_cache(1000)(Origin)


def _channel_from_msg(message: Any) -> ChannelBlock:
    values = message.values
    output: RawArray = (
        np.asarray(values, dtype=np.float64).view()
        if len(values)
        else np.frombuffer(memoryview(message.counts), dtype=np.int32)
    )
    # The message's own memory: received messages are not changed.
    output.setflags(write=False)
    return ChannelBlock(
        output=output,
        scale=float(message.scale),
        offset=float(message.offset),
        full_scale=float(message.full_scale),
        overloaded=bool(message.overload),
    )


def block_from_msg(message: Any) -> Block:
    """Return an `AccelerationBlock` or `StreamBlock`, as a `Block` that reads its own counts.

    Raises
    ------
    SignalError
        If the channels differ in length or the calibration cannot be meant.
    ParameterError
        If the sampling rate is not a positive number.
    """
    return Block(
        label=label_from_msg(message) if message.record else NOT_ARMED,
        first_sample=int(message.first_sample),
        sampling_rate=float(message.sampling_rate),
        hammer=_channel_from_msg(message.hammer),
        specimen=_channel_from_msg(message.specimen),
        triggered=bool(getattr(message, "triggered", True)),  # a stream has no trigger
        last=bool(message.last),
        stamp=stamp_from_msg(message.header.stamp),
        origin=origin_from_msg(message),
    )


def setup_from_msg(message: Any) -> RigSetup:
    """Return a `RigSetup` message as a `RigSetup`.

    Raises
    ------
    ParameterError
        If a mass, a setting or the sample set cannot be meant.
    """
    return _read(
        RigSetup,
        message,
        samples=_read(
            SampleSet, message, samples=tuple(_read(Sample, item) for item in message.samples)
        ),
        analysis=_read(AnalysisSettings, message.analysis),
        sensors=tuple(_read(Sensor, item) for item in message.sensors),
    )


def _read(kind: type[_T], message: Any, **made: Any) -> _T:
    """Return a dataclass of numbers and texts by the fields of a message; `made` are not there."""
    hints, stored = _list_hints(kind), list_stored(kind)
    plain = {name: hints[name] for name in stored if name not in made}
    return kind(**{name: hint(getattr(message, name)) for name, hint in plain.items()}, **made)


_list_hints: Callable[[Any], dict[str, Any]] = cache(get_type_hints)


class BlockHead(NamedTuple):
    """A block without its points."""

    label: HitLabel
    first_sample: int
    points: int  # in the hammer's channel
    stamp: int  # of its first point [ns since the epoch]
    last: bool  # it ends the record, or the arming
    origin: Origin
    stream_id: bytes


def head_from_msg(message: Any) -> BlockHead:
    """Return what an `AccelerationBlock` or a `StreamBlock` says beside its points."""
    hammer = message.hammer
    return BlockHead(
        label=label_from_msg(message),
        first_sample=int(message.first_sample),
        points=max(len(hammer.counts), len(hammer.values)),
        stamp=stamp_from_msg(message.header.stamp),
        last=bool(message.last),
        origin=origin_from_msg(message),
        stream_id=bytes(message.stream_id.uuid) if hasattr(message, "stream_id") else NO_ID,
    )


class MessageEncoder:
    """Serialises set-ups and blocks as the rig's nodes publish them.

    Raises
    ------
    FileError
        If the rig's interfaces are not installed, or cannot be understood.
    """

    def __init__(self) -> None:
        self._store = Typestore()
        self.setup_definition = self._register(SETUP_TYPE)
        self.block_definition = self._register(BLOCK_TYPE)

    def _register(self, type_name: str) -> MessageDefinition:
        definition = find_message_definition(type_name)
        self._store.register(parse_schema(type_name, definition.text))
        return definition

    def encode_setup(self, setup: RigSetup, stamp: int) -> bytes:
        """Return a set-up as a message.

        Parameters
        ----------
        setup : RigSetup
            Masses, samples, settings.
        stamp : int
            Nanoseconds since the epoch.
        """
        message = self._make(
            SETUP_TYPE,
            header=self._make_header(stamp),
            campaign_id=self._make_id(),
            plan=self._make(
                PACKAGE + "CampaignPlan",
                samples=[],
                impacts=0,
                attempts_per_impact=0,
                confirm_samples=False,
            ),
            software_version=__version__,
            samples=[self._make(PACKAGE + "Sample", **vars(it)) for it in setup.samples.samples],
            analysis=self._make(PACKAGE + "AnalysisSettings", **list_stored(setup.analysis)),
            sensors=[self._make(PACKAGE + "Sensor", **vars(item)) for item in setup.sensors],
            **_list_plain(setup),
            **_list_plain(setup.samples),
        )
        return bytes(self._store.serialize_cdr(message, SETUP_TYPE))

    def encode_block(self, block: Block) -> bytes:
        """Return a block as a message, stamped with its first point's time."""
        message = self._make(
            BLOCK_TYPE,
            header=self._make_header(block.stamp),
            campaign_id=self._make_id(),
            stream_id=self._make_id(),
            **asdict(block.label),
            first_sample=block.first_sample,
            sampling_rate=block.sampling_rate,
            triggered=block.triggered,
            last=block.last,
            origin=self._make(PACKAGE + "Origin", **asdict(block.origin)),
            hammer=self._make_channel(block.hammer),
            specimen=self._make_channel(block.specimen),
        )
        return bytes(self._store.serialize_cdr(message, BLOCK_TYPE))

    def _make_channel(self, channel: ChannelBlock) -> Any:
        is_counted = channel.output.dtype == np.int32
        return self._make(
            PACKAGE + "Channel",
            counts=channel.output if is_counted else np.empty(0, np.int32),
            values=np.empty(0) if is_counted else np.ascontiguousarray(channel.output),
            scale=channel.scale,
            offset=channel.offset,
            full_scale=channel.full_scale,
            overload=channel.overloaded,
        )

    def _make_id(self) -> Any:
        """Return the id of no campaign, and of no stream."""
        return self._make("unique_identifier_msgs/msg/UUID", uuid=np.zeros(16, np.uint8))

    def _make_header(self, stamp: int) -> Any:
        seconds, rest = divmod(stamp, NANOSECONDS)
        time = self._make("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest)
        return self._make("std_msgs/msg/Header", stamp=time, frame_id="")

    def _make(self, type_name: str, **values: Any) -> Any:
        return self._store.types[type_name](**values)


def _list_plain(record: Any) -> dict[str, Any]:
    """Return the numbers and texts of a dataclass by their names."""
    return {
        name: value for name, value in vars(record).items() if isinstance(value, int | float | str)
    }
