"""What changed from one run to another, beyond its uncertainty."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from impact_rig.core.quantity import Quantity
from impact_rig.results.campaign import Results
from impact_rig.results.numbers import SCALES, format_quantity

LARGEST_NORMALISED_ERROR = 1.0
"""|En| up to which two values agree [-], ISO 13528, 9.7, with U at 95 %."""
HAMMER_NAME = "hammer"
"""Stands where a sample's name stands."""


@dataclass(frozen=True)
class Measurand:
    """A quantity that tables and figures compare."""

    name: str  # in words
    symbol: str  # in equations
    unit: str  # as shown
    digits: int  # decimals of a value without uncertainty
    field: str  # its name in the estimates of samples and hammer

    @property
    def scale(self) -> float:
        """From the SI unit to the unit it is shown in [-]."""
        return SCALES[self.unit]

    @property
    def sample_symbol(self) -> str:
        """The symbol with the index of the sample, 2, for what both bodies have."""
        return self.symbol if self.field == "contact_time" else f"{self.symbol}2"

    def read(self, body: Any) -> Quantity:
        """Return what was found of it in a sample or the hammer, or by one method."""
        found: Quantity = getattr(body, self.field)
        return found

    def read_reference(self, reference: Any) -> float:
        """Return what is expected of it [SI unit]."""
        return float(getattr(reference, self.field))

    def format(self, found: Quantity) -> str:
        """Return a value with its uncertainty, in the unit it is shown in."""
        return format_quantity(found, self.digits, self.scale)


CONTACT_TIME = Measurand("contact time", "τp", "µs", 2, "contact_time")
STIFFNESS = Measurand("stiffness", "k", "MN/m", 2, "stiffness")
DAMPING_COEFFICIENT = Measurand("damping coefficient", "c", "N s/m", 1, "damping_coefficient")
SAMPLE_MEASURANDS = (CONTACT_TIME, STIFFNESS, DAMPING_COEFFICIENT)
HAMMER_MEASURANDS = (STIFFNESS, DAMPING_COEFFICIENT)


@dataclass(frozen=True)
class Change:
    """One quantity of one body in two runs, both of which determined it."""

    body: str  # name of the sample, or `HAMMER_NAME`
    quantity: Measurand
    first: Quantity  # [SI unit]
    second: Quantity  # [SI unit]

    @property
    def difference(self) -> Quantity:
        """Of the second run from the first [SI unit]; U as if they had nothing in common."""
        expanded = math.hypot(self.first.expanded, self.second.expanded)
        return Quantity(self.second.value - self.first.value, expanded=expanded)

    @property
    def normalised_error(self) -> float:
        """En: the difference over its expanded uncertainty [-]; NaN without an uncertainty."""
        found = self.difference
        return found.value / found.expanded if found.expanded > 0.0 else math.nan

    @property
    def is_beyond_uncertainty(self) -> bool:
        """Whether |En| is above 1."""
        return abs(self.normalised_error) > LARGEST_NORMALISED_ERROR


def compare_runs(first: Results, second: Results) -> tuple[Change, ...]:
    """Compare every quantity that both runs determined: sample by sample, the hammer last."""
    seconds = {sample.name: sample for sample in second.samples}
    bodies: list[tuple[str, Sequence[Measurand], Any, Any]] = [
        (sample.name, SAMPLE_MEASURANDS, sample, seconds[sample.name])
        for sample in first.samples
        if sample.name in seconds
    ]
    bodies.append((HAMMER_NAME, HAMMER_MEASURANDS, first.hammer, second.hammer))
    changes = (
        Change(name, quantity, quantity.read(one), quantity.read(other))
        for name, quantities, one, other in bodies
        for quantity in quantities
    )
    return tuple(item for item in changes if item.first.is_known and item.second.is_known)
