"""Set-up, blocks, states and health as messages of rclpy, and back.

Results are in `impact_rig.nodes.result_messages`: a node that only passes blocks on loads no
physics, which takes most of a node's start.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from impact_rig_msgs import msg

from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.records import Block
from impact_rig.core.given.setup import RigSetup
from impact_rig.nodes.identity import NO_IDENTITY, Identity
from impact_rig.recordings import messages as recorded
from impact_rig.recordings.fields import NANOSECONDS, from_message, stamp_from_msg
from impact_rig.status.states import CampaignStatus, HammerStatus, Level, NodeHealth

if TYPE_CHECKING:
    # Who only passes on what others have measured needs no virtual rig.
    from impact_rig.devices.virtual.rig import VirtualHit

T = TypeVar("T", HammerStatus, CampaignStatus)


def make_message(name: str) -> Any:
    """Return a new message of the rig, by the name of its type."""
    return getattr(msg, name)()


def stamp_to_msg(nanoseconds: int) -> Time:
    """Return nanoseconds since the epoch as a `builtin_interfaces/Time`."""
    seconds, rest = divmod(nanoseconds, NANOSECONDS)
    return Time(sec=seconds, nanosec=rest)


def setup_to_msg(setup: RigSetup, stamp: Time) -> msg.RigSetup:
    """Return a rig's set-up as a message."""
    message: msg.RigSetup = recorded.setup_to_msg(setup, make_message)
    message.header.stamp = stamp
    return message


def block_to_msg(block: Block, identity: Identity = NO_IDENTITY) -> msg.AccelerationBlock:
    """Return a block of a hit as a message, stamped with its first point's time."""
    message = identity.fill(msg.AccelerationBlock(triggered=block.triggered))
    recorded.fill_block(message, block)
    return message


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


def _read_state(kind: type[T], times: Sequence[str], message: Any) -> T:
    """Return a state with its times [s since the epoch]; NaN: none is stated."""
    found: dict[str, Any] = {
        name: stamp_from_msg(getattr(message, name)) / NANOSECONDS or math.nan for name in times
    }
    return replace(
        from_message(kind, message), stamp=stamp_from_msg(message.header.stamp), **found
    )


hammer_from_msg = partial(_read_state, HammerStatus, ("since", "stopped_at"))
campaign_from_msg = partial(_read_state, CampaignStatus, ("until",))


def health_from_msg(message: DiagnosticArray) -> tuple[NodeHealth, ...]:
    """Return the diagnostics of nodes, with their full names."""
    return tuple(
        NodeHealth(
            name=status.name,
            level=Level(int.from_bytes(status.level)),  # rclpy has a byte as bytes
            message=status.message,
            values=tuple((item.key, item.value) for item in status.values),
        )
        for status in message.status
    )


OWN_ESTIMATOR = "impact_rig"
"""Name of the rig's own estimator in its answers."""


def describe_estimator(name: str) -> str | None:
    """Return whose results these are; None: those of the rig's own estimator."""
    if name == OWN_ESTIMATOR:
        return None
    return f"verdicts and numbers are by {name or 'an estimator without a name'}, not by the rig's"


def check_release(message: msg.HammerRelease) -> msg.HammerRelease:
    """Return a release with times that can be waited for."""
    for name in ("swing_time", "latest_contact"):
        value = getattr(message, name)
        if not (math.isfinite(value) and value >= 0.0):
            raise ParameterError(f"{name} is {value:g} s: it must be zero or more")
    return message
