"""Set-ups, blocks, releases and states that come in, as one of our types.

Findings are in `impact_rig.nodes.findings`: here no physics is loaded.
"""

import math
from typing import NamedTuple

from impact_rig_msgs import msg

from impact_rig.core.errors import ParameterError
from impact_rig.core.records import HitLabel
from impact_rig.nodes.guarded_hammer import Disarming, HammerPlace
from impact_rig.recordings.messages import block_from_msg, label_from_msg, setup_from_msg

__all__ = ["block_from_msg", "setup_from_msg"]


def check_hammer_state(message: msg.HammerState) -> msg.HammerState:
    """Return a state whose numbers are those of a place and of a reason."""
    HammerPlace(message.state)
    Disarming(message.disarmed_by)
    return message


def check_acquisition_state(message: msg.AcquisitionState) -> msg.AcquisitionState:
    """Return a state whose number is one of the message's constants."""
    if message.state > message.FAULT:
        raise ParameterError(f"state is {message.state}: it must not be above {message.FAULT}")
    return message


def check_campaign_state(message: msg.CampaignState) -> msg.CampaignState:
    """Return a state whose numbers are among the message's constants."""
    for name, most in (("state", message.ENDED), ("task", message.RESUME)):
        if getattr(message, name) > most:
            found = getattr(message, name)
            raise ParameterError(f"{name} is {found}: it must not be above {most}")
    return message


def check_release(message: msg.HammerRelease) -> msg.HammerRelease:
    """Return a release with times that can be waited for."""
    for name in ("swing_time", "latest_contact"):
        value = getattr(message, name)
        if not (math.isfinite(value) and value >= 0.0):
            raise ParameterError(f"{name} is {value:g} s: it must be zero or more")
    return message


class Truth(NamedTuple):
    """What the virtual rig did on purpose in one hit."""

    label: HitLabel
    faults: tuple[str, ...]


def truth_from_msg(message: msg.VirtualImpact) -> Truth:
    """Return what the virtual rig did on purpose."""
    return Truth(label_from_msg(message), tuple(message.faults))
