"""Conversion between messages and core types: a message has the fields of its record.

Only attributes are read and set, of messages of rclpy or of a file reader: a node and a recording
give bit-identical numbers.
"""

from array import array
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from impact_rig.core.given.errors import ParameterError, RigError
from impact_rig.core.given.records import (
    DISARMED,
    NO_SPEED,
    NOT_ARMED,
    Block,
    ChannelBlock,
    HitLabel,
    MeasuredSpeed,
    Origin,
    RawArray,
    Truth,
)
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.overrules import Overrule, Verdict
from impact_rig.recordings.fields import (
    MessageMaker,
    fill_message,
    from_message,
    set_stamp,
    stamp_from_msg,
)
from impact_rig.recordings.schemas import MessageDefinition, find_message_definition, parse_schema
from impact_rig.version import __version__

PACKAGE = "impact_rig_msgs/msg/"
SETUP_TYPE = PACKAGE + "RigSetup"
BLOCK_TYPE = PACKAGE + "AccelerationBlock"
STREAM_TYPE = PACKAGE + "StreamBlock"
VIRTUAL_IMPACT_TYPE = PACKAGE + "VirtualImpact"
OVERRULE_TYPE = PACKAGE + "Overrule"
"""Types that tell the rig's topics in a recording, whatever they were remapped to."""
CONVERSION_ERRORS = (RigError, AttributeError, TypeError, ValueError, OverflowError)
"""Errors on a message whose fields are not of this version, or cannot be meant."""
LONGEST_TEXT = 200
"""Letters of an overrule's reason and of its person's name that are kept, our choice."""


def campaign_id_from_msg(message: Any) -> bytes:
    """Return the id of the campaign that a message belongs to."""
    return bytes(message.campaign_id.uuid)


def label_from_msg(message: Any) -> HitLabel:
    """Return the hit that a message with record, sample, impact and attempt belongs to."""
    return _make_label(
        str(message.sample), int(message.record), int(message.impact), int(message.attempt)
    )


# All blocks of a hit share one.
_make_label = lru_cache(1000)(HitLabel)


class RecordedTruth(NamedTuple):
    """What is recorded of the truth of one hit of the virtual rig."""

    label: HitLabel
    truth: Truth


def truth_from_msg(message: Any) -> RecordedTruth:
    """Return the truth of a `VirtualImpact`."""
    truth = Truth(message.contact_time, message.peak_force, faults=tuple(map(str, message.faults)))
    return RecordedTruth(label_from_msg(message), truth)


def origin_from_msg(message: Any) -> Origin:
    """Return the origin of a block or verdict.

    Raises
    ------
    ParameterError
        If it is of no known kind.
    """
    found = message.origin
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


def speed_from_msg(message: Any) -> MeasuredSpeed:
    """Return the impact speed of a block or verdict; 0 and NaN: it was not measured."""
    if not getattr(message, "impact_speed", 0.0) > 0.0:  # older recordings have none
        return NO_SPEED
    return MeasuredSpeed(float(message.impact_speed), float(message.impact_speed_uncertainty))


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
        # Recordings before have neither field, or not the sentence.
        disarmed=getattr(message, "why_disarmed", "")
        or (DISARMED if getattr(message, "disarmed", False) else ""),
        last=bool(message.last),
        stamp=stamp_from_msg(message.header.stamp),
        origin=origin_from_msg(message),
        impact_speed=speed_from_msg(message),
    )


def setup_from_msg(message: Any) -> RigSetup:
    """Return a `RigSetup` message as a `RigSetup`.

    Raises
    ------
    ParameterError
        If a mass, a setting or the sample set cannot be meant.
    """
    return from_message(RigSetup, message)


def overrule_from_msg(message: Any) -> Overrule:
    """Return a person's verdict on a hit.

    Raises
    ------
    ParameterError
        If the verdict is none.
    """
    if message.verdict > max(Verdict):
        known = ", ".join(f"{item.value} ({item.name.lower()})" for item in Verdict)
        raise ParameterError(f"verdict is {message.verdict}: it must be one of {known}")
    # On one line, whatever was typed.
    reason, who = (" ".join(text.split())[:LONGEST_TEXT] for text in (message.reason, message.who))
    stamp = stamp_from_msg(message.header.stamp)
    return Overrule(int(message.record), Verdict(message.verdict), reason, who, stamp)


def count_points(message: Any) -> int:
    """Return how many points an `AccelerationBlock` or a `StreamBlock` has in each channel."""
    return max(len(message.hammer.counts), len(message.hammer.values))


def setup_to_msg(setup: RigSetup, make: MessageMaker) -> Any:
    """Return a set-up as a message without a stamp."""
    message = fill_message(make("RigSetup"), setup, make)
    message.software_version = __version__
    return message


def fill_block(message: Any, block: Block) -> None:
    """Write a block into an `AccelerationBlock` or `StreamBlock`.

    Its channels keep their memory if that is as long: to get some costs more than to copy a block
    into it.
    """
    set_stamp(message, block.stamp)
    fill_message(message, block.label)
    message.first_sample = block.first_sample
    message.sampling_rate = block.sampling_rate
    message.last = block.last
    message.disarmed, message.why_disarmed = bool(block.disarmed), block.disarmed
    message.impact_speed = block.impact_speed.value
    message.impact_speed_uncertainty = block.impact_speed.standard
    fill_message(message.origin, block.origin)
    _fill_channel(message.hammer, block.hammer)
    _fill_channel(message.specimen, block.specimen)


def _fill_channel(message: Any, channel: ChannelBlock) -> None:
    output = channel.output
    nothing = output[:0]
    is_counted = output.dtype == np.int32
    message.counts = _fill(message.counts, output if is_counted else nothing)
    message.values = _fill(message.values, nothing if is_counted else output)
    message.scale = channel.scale
    message.offset = channel.offset
    message.full_scale = channel.full_scale
    message.overload = channel.overloaded


def _fill(room: Any, output: RawArray) -> Any:
    """Return an array that holds a channel's output: the one there is, or a new one."""
    if isinstance(room, np.ndarray):  # rosbags takes numpy's
        return np.ascontiguousarray(output, room.dtype)
    if output.size and len(room) == output.size:
        np.frombuffer(room, dtype=output.dtype)[:] = output
        return room
    # rclpy takes an array.array as it is; it would check numpy's item by item.
    fresh = array(room.typecode)
    fresh.frombytes(np.ascontiguousarray(output).view(np.uint8).data)
    return fresh


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
        """Return a set-up as a message with a stamp [ns since the epoch]."""
        message = setup_to_msg(setup, lambda name: self._make(PACKAGE + name))
        set_stamp(message, stamp)
        return bytes(self._store.serialize_cdr(message, SETUP_TYPE))

    def encode_block(self, block: Block) -> bytes:
        """Return a block as a message, stamped with its first point's time."""
        message = self._make(BLOCK_TYPE)
        message.triggered = block.triggered
        fill_block(message, block)
        return bytes(self._store.serialize_cdr(message, BLOCK_TYPE))

    def _make(self, type_name: str) -> Any:
        """Return a message of zeros and empty texts."""
        _, fields = self._store.fielddefs[type_name]
        values = (self._make_value(kind, content) for _, (kind, content) in fields)
        return self._store.types[type_name](*values)

    def _make_value(self, kind: Nodetype, content: Any) -> Any:
        if kind == Nodetype.NAME:
            return self._make(content)
        if kind == Nodetype.BASE:
            return "" if content[0] == "string" else np.dtype(content[0]).type()
        (inner, name), length = content  # a sequence has none
        is_list = inner == Nodetype.NAME or name[0] == "string"
        return [] if is_list else np.zeros(length, name[0])
