"""The quantities that tables and figures compare."""

from dataclasses import dataclass
from typing import Any

from impact_rig.core.quantity import Quantity
from impact_rig.results.numbers import SCALES, format_quantity

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
