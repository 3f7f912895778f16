"""Names of the virtual rig's plants and faults; a light module, which every help imports."""

from enum import Enum
from typing import Literal, TypedDict

IDENTITY = "virtual rig"
"""Name of the virtual rig."""


class Plant(Enum):
    """Physics of the virtual rig."""

    PUBLISHED = "published"
    DYNAMICS = "dynamics"
    DYNAMICS_PRINTED = "dynamics_printed"
    CONTACT = "contact"


PlantName = Literal["published", "dynamics", "dynamics_printed", "contact"]


class SourceKeys(TypedDict, total=False):
    """Keys of the table [source] of a virtual rig, as a program gives them; None: not given."""

    seed: int | None
    plant: PlantName | None
    draw: bool  # true masses, gains and clock are drawn within their ±, once for a seed
    faults: float | None  # probability of each, for each hit: `fault_probability` of the table
    contact_exponent: float  # n of the plant "contact" [-]
    restitution: float  # e of the plant "contact" [-]
    contact_time_scatter: float  # from hit to hit, standard, relative
    amplitude_scatter: float  # the same of the force
    noise: float  # standard deviation, part of full scale
    bits: int
    sampling_rate: str | float  # with a unit or [Hz]
    record_duration: str | float  # with a unit or [s]
    pre_trigger: str | float  # with a unit or [s]
    hammer_full_scale: str | float  # with a unit or [m/s^2]
    specimen_full_scale: str | float  # with a unit or [m/s^2]


class Fault(Enum):
    """Faults that the virtual rig can inject."""

    DOUBLE_HIT = "double_hit"
    OVERLOAD = "overload"
    WEAK_HIT = "weak_hit"
    MISSED_TRIGGER = "missed_trigger"
    DEAD_CHANNEL = "dead_channel"
    LOST_BLOCK = "lost_block"
