"""Numbers as people read them, rounded to what is known, and the quantities that are compared."""

import math
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from impact_rig.core.given.quantity import POSITIVE, Quantity
from impact_rig.core.given.records import IMPORTED, Origin

MISSING = "-"
"""Stands where a number was not determined."""
MICRO = 1e6
"""Seconds to microseconds."""
MEGA = 1e-6
"""N/m to MN/m."""
SCALES = {
    "": 1.0, "%": 1.0, "µs": MICRO, "µm": MICRO, "µJ": MICRO, "MN/m": MEGA, "N s/m": 1.0, "N": 1.0,
    "m/s²": 1.0, "cm/s": 1e2, "kHz": 1e-3, "mN s": 1e3, "g": 1e3,
}  # fmt: skip
"""From SI units to the units of tables."""
SMALLEST_ERROR = 1e-4
"""Mean square error below which no more is said than that [%], our choice: a hundredth of a
thousandth of the paper's smallest bound says nothing more of a model."""
MOST_FREEDOM = 999
"""Degrees of freedom above which k is that of a normal distribution [-]."""
UNCERTAINTY_DIGITS = 2
"""Significant digits of an uncertainty [-], GUM 7.2.6: more would claim too much."""


EARLIEST_TIME = 631_152_000_000_000_000
"""1990-01-01 [ns since the epoch]: files without a date are imported as of 1970."""


def is_dated(nanoseconds: int) -> bool:
    """Return whether a time of a recording is a date."""
    return nanoseconds >= EARLIEST_TIME


def format_time(nanoseconds: int) -> str:
    """Return a moment in universal time, alike on every machine."""
    moment = datetime.fromtimestamp(nanoseconds // 1_000_000_000, tz=UTC)
    return f"{moment:%Y-%m-%d %H:%M:%S} UTC"


def format_date(nanoseconds: int, origin: Origin) -> str:
    """Return when hits were recorded; empty: not known, as of imported hits without a date."""
    if not is_dated(nanoseconds):
        return ""
    # Many files do not say in which time zone.
    return format_time(nanoseconds) + ", if the files' clock was UTC" * (origin.kind == IMPORTED)


def format_number(value: float, digits: int) -> str:
    """Return a number with `digits` decimals, or a dash for what was not determined."""
    return f"{value:z.{digits}f}" if math.isfinite(value) else MISSING


def show_unit(unit: str) -> str:
    """Return a unit as it is printed."""
    return unit.replace("^2", "²")


def is_beyond_rounding(expanded: float, value: float) -> bool:
    """Return whether an uncertainty is more than what a float leaves open of its value."""
    return expanded > max(1e-16 * abs(value), POSITIVE)


def format_uncertain(value: float, expanded: float, digits: int) -> str:
    """Return ``value ± expanded``, both rounded to the second digit of the uncertainty.

    Parameters
    ----------
    value : float
        In the unit in which it is shown.
    expanded : float
        Half-width of the 95 % interval; without one the value stands alone.
    digits : int
        Decimals of a value without uncertainty.

    Returns
    -------
    str
        A dash for a value that was not determined.
    """
    if not math.isfinite(value):
        return MISSING
    if not (math.isfinite(expanded) and is_beyond_rounding(expanded, value)):
        return format_number(value, digits)
    return " ± ".join(_round_alike(expanded, value, expanded))


def _round_alike(width: float, *numbers: float) -> list[str]:
    """Return numbers rounded to the second digit of a width."""
    # Python's own rounding says where the second digit of the rounded uncertainty stands.
    exponent = int(f"{width:.{UNCERTAINTY_DIGITS - 1}e}".partition("e")[2])
    place = UNCERTAINTY_DIGITS - 1 - exponent
    return [f"{round(number, place):z.{max(place, 0)}f}" for number in numbers]


def format_quantity(quantity: Quantity, digits: int, scale: float = 1.0) -> str:
    """Return a value with its uncertainty as `format_uncertain` does, `scale` times both.

    An interval that reaches farther to one side is printed by both half-widths: ``0.45 +0.44
    -0.18``, with ``+∞`` where it is open.
    """
    value = quantity.value * scale
    if quantity.is_even:
        return format_uncertain(value, quantity.expanded * scale, digits)
    below, above = (quantity.compute_half_width(to) * scale for to in (-math.inf, math.inf))
    if math.isinf(above):
        return "{} +∞ -{}".format(*_round_alike(below, value, below))
    return "{} +{} -{}".format(*_round_alike(min(below, above), value, above, below))


def format_rounded(quantity: Quantity, digits: int, scale: float = 1.0) -> str:
    """Return a value rounded as `format_quantity` does, alone."""
    width = min(quantity.compute_half_width(to) for to in (-math.inf, math.inf))
    if not (math.isfinite(width) and is_beyond_rounding(width, quantity.value)):
        return format_number(quantity.value * scale, digits)
    (text,) = _round_alike(width * scale, quantity.value * scale)
    return text


def format_relative(quantity: Quantity) -> str:
    """Return the expanded uncertainty in per cent of the value."""
    part = 100.0 * quantity.expanded / abs(quantity.value) if quantity.value else math.nan
    return f"{part:.2g}" if math.isfinite(part) else MISSING


def format_coverage(quantity: Quantity) -> str:
    """Return the coverage factor k of an expanded uncertainty (GUM 7.2.3)."""
    is_uncertain = is_beyond_rounding(quantity.standard, quantity.value)
    return format_number(quantity.expanded / quantity.standard, 2) if is_uncertain else MISSING


def format_freedom(quantity: Quantity) -> str:
    """Return the effective degrees of freedom, cut to a whole number (GUM G.4.2)."""
    freedom = quantity.degrees_of_freedom
    if freedom > MOST_FREEDOM:
        return f"> {MOST_FREEDOM}"
    return str(math.floor(freedom)) if math.isfinite(freedom) else MISSING


def format_error(value: float) -> str:
    """Return an error with two significant digits: they reach over four decades."""
    if not math.isfinite(value):
        return MISSING
    return f"{value:#.2g}".rstrip(".") if value >= SMALLEST_ERROR else f"< {SMALLEST_ERROR:.4f}"


def format_count(count: int, thing: str) -> str:
    """Return how many things there are: ``1 hit``, ``10 hits``."""
    return f"{count} {thing}" if count == 1 else f"{count} {thing}s"


ONE_HIT = ", one hit"
"""Follows a number by one hit: its ± is that of this hit."""
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
        return f"{self.symbol}2" if self in HAMMER_MEASURANDS else self.symbol

    def read(self, body: Any) -> Quantity:
        """Return its value in a sample or the hammer, by the paper or one method."""
        found: Quantity = getattr(getattr(body, "paper", body), self.field)
        return found

    def find_method(self, sample: Any) -> str:
        """Return the method that its value in a sample is by; empty: it is not determined."""
        return sample.paper.damping_method if self is DAMPING_COEFFICIENT else "versed-sine"

    def read_reference(self, reference: Any) -> float:
        """Return its expected value [SI unit]."""
        return float(getattr(reference, self.field))

    def format(self, found: Quantity) -> str:
        """Return a value with its uncertainty, in the unit it is shown in."""
        return format_quantity(found, self.digits, self.scale)


CONTACT_TIME = Measurand("contact time", "τp", "µs", 2, "contact_time")
STIFFNESS = Measurand("stiffness", "k", "MN/m", 2, "stiffness")
DAMPING_COEFFICIENT = Measurand("damping coefficient", "c", "N s/m", 1, "damping_coefficient")
SAMPLE_MEASURANDS = (CONTACT_TIME, STIFFNESS, DAMPING_COEFFICIENT)
HAMMER_MEASURANDS = (STIFFNESS, DAMPING_COEFFICIENT)
