"""Why a hit is not in the mean: light, since tables name it too."""

from dataclasses import dataclass
from enum import Enum


class Reason(Enum):
    """Why a hit is rejected, or what was found in it."""

    NO_TRIGGER = "no_trigger"
    GAP = "gap"
    NON_FINITE = "non_finite"
    DEAD_CHANNEL = "dead_channel"
    NO_PULSE = "no_pulse"
    OVERLOAD = "overload"
    DROPOUT = "dropout"
    WEAK = "weak"
    STRONG = "strong"
    TRUNCATED = "truncated"
    DOUBLE_HIT = "double_hit"
    ZERO_SHIFT = "zero_shift"
    DROOP = "droop"
    DRIFT = "drift"
    RINGING = "ringing"
    UNSTEADY_ZERO = "unsteady_zero"
    POLARITY = "polarity"
    INCONSISTENT = "inconsistent"
    SURPLUS = "surplus"
    OPERATOR = "operator"


@dataclass(frozen=True)
class Rejection:
    """One reason against a hit.

    Attributes
    ----------
    reason : Reason
        For programs.
    explanation : str
        For people, with the figures.
    """

    reason: Reason
    explanation: str

    def __str__(self) -> str:
        """Return ``code: explanation``."""
        return f"{self.reason.value}: {self.explanation}"
