"""Releases, states and health that come in, as one of our types.

Findings are in `impact_rig.nodes.findings`: here no physics is loaded.
"""

import math
from dataclasses import replace

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from impact_rig_msgs import msg

from impact_rig.core.given.errors import ParameterError
from impact_rig.recordings.messages import NANOSECONDS, from_message, stamp_from_msg
from impact_rig.status.states import CampaignStatus, HammerStatus, Level, NodeHealth


def hammer_from_msg(message: msg.HammerState) -> HammerStatus:
    """Return the hammer's state."""
    return replace(
        from_message(HammerStatus, message),
        since=stamp_from_msg(message.since) / NANOSECONDS,
        stopped_at=_time_from_msg(message.stopped_at),
        stamp=stamp_from_msg(message.header.stamp),
    )


def campaign_from_msg(message: msg.CampaignState) -> CampaignStatus:
    """Return a campaign's state without its newest verdict."""
    return replace(
        from_message(CampaignStatus, message),
        until=_time_from_msg(message.until),
        stamp=stamp_from_msg(message.header.stamp),
    )


def _time_from_msg(stamp: Time) -> float:
    """Return seconds since the epoch; NaN: none is stated."""
    return stamp_from_msg(stamp) / NANOSECONDS or math.nan


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


def check_release(message: msg.HammerRelease) -> msg.HammerRelease:
    """Return a release with times that can be waited for."""
    for name in ("swing_time", "latest_contact"):
        value = getattr(message, name)
        if not (math.isfinite(value) and value >= 0.0):
            raise ParameterError(f"{name} is {value:g} s: it must be zero or more")
    return message
