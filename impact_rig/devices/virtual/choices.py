"""Names of the virtual rig's plants and faults; a light module, which every help imports."""

from enum import Enum

IDENTITY = "virtual rig"
"""Name of the virtual rig."""


class Plant(Enum):
    """Physics of the virtual rig."""

    PUBLISHED = "published"
    DYNAMICS = "dynamics"
    DYNAMICS_PRINTED = "dynamics_printed"
    CONTACT = "contact"


class Fault(Enum):
    """Faults that the virtual rig can inject."""

    DOUBLE_HIT = "double_hit"
    OVERLOAD = "overload"
    WEAK_HIT = "weak_hit"
    MISSED_TRIGGER = "missed_trigger"
    DEAD_CHANNEL = "dead_channel"
    LOST_BLOCK = "lost_block"
