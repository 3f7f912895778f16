"""Findings in hits and notes on estimates: a code decides, a sentence explains it to people."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import Enum


class Reason(Enum):
    """Why a hit is rejected, or what was found in it."""

    NO_TRIGGER = "no_trigger"
    DISARMED = "disarmed"
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
    SMOOTHED = "smoothed"
    FEW_POINTS = "few_points"
    UNSTEADY_ZERO = "unsteady_zero"
    OTHER_KIND = "other_kind"
    COPY = "copy"
    POLARITY = "polarity"
    INCONSISTENT = "inconsistent"
    OTHER_SAMPLE = "other_sample"
    OPERATIONAL_CHECK = "operational_check"
    OPERATOR = "operator"


class Subject(Enum):
    """Subject of a note on an estimate."""

    K1 = "k1"
    K2 = "k2"
    C1 = "c1"
    C2 = "c2"
    STIFFNESS_AND_DAMPING = "k and c"
    HITS = "hits"
    PULSE_SHAPE = "pulse shape"
    CONTACT_LAW = "contact law"
    FREE_DECAY = "free decay"
    MOMENTA = "momenta"
    MASS = "mass"
    OPERATIONAL_CHECK = "operational check"
    IMPACT_SPEED = "impact speed"
    CONTROL_SAMPLE = "control sample"
    SENSOR = "sensor"
    CONVERTER = "converter"
    DELAY = "delay"
    GROUPS = "groups"
    TREND = "trend"
    SCATTER = "scatter of the traces"
    ESTIMATOR = "estimator"
    UNCERTAINTY = "uncertainty"
    ASSUMED_GAIN = "assumed gain"
    ASSUMED_MASS = "assumed mass"


@dataclass(frozen=True)
class Finding:
    """A finding in a hit, with a sentence that has the figures."""

    reason: Reason
    explanation: str
    # It was corrected, or looks like something harmless; neither compared nor written.
    is_harmless: bool = field(default=False, compare=False)

    def __repr__(self) -> str:
        """Return ``code: sentence``."""
        return f"{self.reason.value}: {self.explanation}"


@dataclass(frozen=True)
class Note:
    """A note on an estimate, with a sentence that has the figures."""

    about: Reason | Subject  # a reason: what was found in its hits
    explanation: str

    def __repr__(self) -> str:
        """Return ``code: sentence``."""
        return f"{self.about.value}: {self.explanation}"


def join_findings(findings: Iterable[Finding | Note]) -> str:
    """Return them on one line."""
    return "; ".join(map(str, findings))
