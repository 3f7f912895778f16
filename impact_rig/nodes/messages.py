"""Set-up and blocks as messages.

They are read by `impact_rig.recordings.messages`, as a recording's. Results are in
`impact_rig.nodes.result_messages`: a node that only passes blocks on loads no physics, which takes
most of a node's start.
"""

from array import array
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from builtin_interfaces.msg import Time
from impact_rig_msgs import msg

from impact_rig import __version__
from impact_rig.core.records import Block, ChannelBlock, RawArray
from impact_rig.core.sensors import Sensor
from impact_rig.core.setup import AnalysisSettings, RigSetup, Sample
from impact_rig.nodes.identity import NO_IDENTITY, Identity
from impact_rig.results.wire import fill_message

if TYPE_CHECKING:
    # Who only passes on what others have measured needs no virtual rig.
    from impact_rig.devices.virtual.rig import VirtualHit

MESSAGES: dict[type, type] = {
    AnalysisSettings: msg.AnalysisSettings,
    RigSetup: msg.RigSetup,
    Sample: msg.Sample,
    Sensor: msg.Sensor,
}
"""Parts of a set-up, and the messages that carry them."""


def stamp_to_msg(nanoseconds: int) -> Time:
    """Return nanoseconds since the epoch as a `builtin_interfaces/Time`."""
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    return Time(sec=seconds, nanosec=rest)


def setup_to_msg(setup: RigSetup, stamp: Time) -> msg.RigSetup:
    """Return a rig's set-up as a message."""
    message = msg.RigSetup()
    fill_message(message, setup, MESSAGES)
    message.software_version = __version__
    message.header.stamp = stamp
    return message


def block_to_msg(block: Block, identity: Identity = NO_IDENTITY) -> msg.AccelerationBlock:
    """Return a block of a hit as a message, stamped with its first point's time."""
    message = msg.AccelerationBlock(triggered=block.triggered)
    fill_block(message, block, identity)
    return message


def fill_block(
    message: msg.AccelerationBlock | msg.StreamBlock, block: Block, identity: Identity
) -> None:
    """Let a message hold another block.

    Its channels keep their memory if that is as long: to get some costs more than to copy a block
    into it.
    """
    identity.fill(message)
    message.header.stamp = stamp_to_msg(block.stamp)
    message.record = block.label.record
    message.sample = block.label.sample
    message.impact = block.label.impact
    message.attempt = block.label.attempt
    message.first_sample = block.first_sample
    message.sampling_rate = block.sampling_rate
    message.last = block.last
    fill_message(message.origin, block.origin, {})
    _fill_channel(message.hammer, block.hammer)
    _fill_channel(message.specimen, block.specimen)


def _fill_channel(message: msg.Channel, channel: ChannelBlock) -> None:
    output = channel.output
    nothing = output[:0]
    is_counted = output.dtype == np.int32
    message.counts = _fill(message.counts, output if is_counted else nothing)
    message.values = _fill(message.values, nothing if is_counted else output)
    message.scale = channel.scale
    message.offset = channel.offset
    message.full_scale = channel.full_scale
    message.overload = channel.overloaded


def _fill(room: "array[Any]", output: RawArray) -> "array[Any]":
    """Return an array that holds a channel's output: the one there is, or a new one."""
    if output.size and len(room) == output.size:
        np.frombuffer(room, dtype=output.dtype)[:] = output
        return room
    # An array.array is taken over as it is; numpy would be checked item by item.
    fresh = array(room.typecode)
    fresh.frombytes(np.ascontiguousarray(output).view(np.uint8).data)
    return fresh


def virtual_hit_to_msg(
    virtual: "VirtualHit", stamp: Time, identity: Identity = NO_IDENTITY
) -> msg.VirtualImpact:
    """Return the truth behind a simulated hit as a message."""
    message = msg.VirtualImpact(
        **asdict(virtual.label),
        faults=[fault.value for fault in virtual.faults],
        contact_time=virtual.model.contact_time,
        peak_force=virtual.model.peak_force,
    )
    message.header.stamp = stamp
    identity.fill(message)
    return message
