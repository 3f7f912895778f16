"""Set-up and blocks as messages of rclpy, by `impact_rig.recordings.messages`, which reads them.

Results are in
`impact_rig.nodes.result_messages`: a node that only passes blocks on loads no physics, which takes
most of a node's start.
"""

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from builtin_interfaces.msg import Time
from impact_rig_msgs import msg

from impact_rig.core.given.records import Block
from impact_rig.core.given.setup import RigSetup
from impact_rig.nodes.identity import NO_IDENTITY, Identity
from impact_rig.recordings import messages as recorded

if TYPE_CHECKING:
    # Who only passes on what others have measured needs no virtual rig.
    from impact_rig.devices.virtual.rig import VirtualHit


def make_message(name: str) -> Any:
    """Return a new message of the rig, by the name of its type."""
    return getattr(msg, name)()


def stamp_to_msg(nanoseconds: int) -> Time:
    """Return nanoseconds since the epoch as a `builtin_interfaces/Time`."""
    seconds, rest = divmod(nanoseconds, recorded.NANOSECONDS)
    return Time(sec=seconds, nanosec=rest)


def setup_to_msg(setup: RigSetup, stamp: Time) -> msg.RigSetup:
    """Return a rig's set-up as a message."""
    message: msg.RigSetup = recorded.setup_to_msg(setup, make_message)
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
    """Write a block, and the ids of its campaign and stream, into a message."""
    identity.fill(message)
    recorded.fill_block(message, block)


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
    return identity.fill(message, stamp)
