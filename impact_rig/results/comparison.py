"""What changed from one run to another, beyond its uncertainty."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from impact_rig.core.estimation.paper_method import HammerEstimate
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.quantity import UNKNOWN, Quantity, list_stored
from impact_rig.results.campaign import Results
from impact_rig.results.numbers import SCALES, format_quantity

LARGEST_NORMALISED_ERROR = 1.0
"""|En| up to which two values agree [-], ISO 13528, 9.7, with U at 95 %."""
HAMMER_NAME = "hammer"
"""Stands where a sample's name stands."""


@dataclass(frozen=True)
class Measurand:
    """A quantity that tables and figures compare.

    Attributes
    ----------
    name, symbol, unit : str
        In words, in equations, and the unit it is shown in.
    digits : int
        Decimals of a value without uncertainty.
    field : str
        Its name in the estimates of samples and hammer.
    """

    name: str
    symbol: str
    unit: str
    digits: int
    field: str

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
    """One quantity of one body in two runs; NaN: not determined in one of them.

    Attributes
    ----------
    difference : float
        Of the later from the first [SI unit].
    expanded : float
        Of the difference, sqrt(U1^2 + U2^2) [SI unit]: as if the runs had nothing in common.
    """

    difference: float
    expanded: float

    @property
    def normalised_error(self) -> float:
        """En: the difference over its expanded uncertainty [-]; NaN: cannot be told."""
        if not self.expanded > 0.0:
            return math.nan
        return self.difference / self.expanded

    @property
    def is_beyond_uncertainty(self) -> bool:
        """Whether |En| is above 1."""
        return abs(self.normalised_error) > LARGEST_NORMALISED_ERROR


@dataclass(frozen=True)
class ComparedQuantity:
    """One quantity of one body in all runs.

    Attributes
    ----------
    body : str
        Name of the sample, or `HAMMER_NAME`.
    quantity : Measurand
        Which.
    found : tuple of Quantity
        By run [SI unit]; NaN: not determined, or not measured there.
    changes : tuple of Change
        Of the second run from the first, of the third from the first, and so on.
    """

    body: str
    quantity: Measurand
    found: tuple[Quantity, ...]
    changes: tuple[Change, ...]


@dataclass(frozen=True)
class SetupDifference:
    """Something in the set-up that is not the same in all runs.

    Attributes
    ----------
    sample : str
        Whose it is; empty: of the rig or the settings.
    field : str
        As the set-up calls it.
    values : tuple of float or str, or None
        By run; None: there is none.
    """

    sample: str
    field: str
    values: tuple[float | str | None, ...]


def compare_runs(runs: Sequence[Results]) -> tuple[ComparedQuantity, ...]:
    """Compare every quantity that at least two runs determined with the first run.

    Parameters
    ----------
    runs : sequence of Results
        Two or more, the first of them held against the others.

    Returns
    -------
    tuple of ComparedQuantity
        Sample by sample in the order in which they first appear, the hammer last.
    """
    names = dict.fromkeys(sample.name for results in runs for sample in results.samples)
    compared = [
        _compare(name, quantity, [_find_sample(results, name) for results in runs])
        for name in names
        for quantity in SAMPLE_MEASURANDS
    ]
    compared += [
        _compare(HAMMER_NAME, quantity, [results.hammer for results in runs])
        for quantity in HAMMER_MEASURANDS
    ]
    return tuple(item for item in compared if sum(one.is_known for one in item.found) > 1)


def find_setup_differences(runs: Sequence[Results]) -> tuple[SetupDifference, ...]:
    """Return what of masses, settings and samples is not the same in all runs.

    Names and descriptions may differ: they change no number.
    """
    flat = [_flatten_setup(results) for results in runs]
    keys = dict.fromkeys(key for setup in flat for key in setup)
    differences = (SetupDifference(*key, tuple(setup.get(key) for setup in flat)) for key in keys)
    # What is not known (NaN) is not known alike.
    return tuple(item for item in differences if len(set(map(repr, item.values))) > 1)


def _find_sample(results: Results, name: str) -> SampleEstimate | None:
    return next((sample for sample in results.samples if sample.name == name), None)


def _compare(
    body: str, quantity: Measurand, bodies: Sequence[SampleEstimate | HammerEstimate | None]
) -> ComparedQuantity:
    found = [UNKNOWN if item is None else quantity.read(item) for item in bodies]
    changes = tuple(
        Change(item.value - found[0].value, math.hypot(item.expanded, found[0].expanded))
        for item in found[1:]
    )
    return ComparedQuantity(body, quantity, tuple(found), changes)


def _flatten_setup(results: Results) -> dict[tuple[str, str], float | str]:
    """Return every field that numbers depend on, by sample or sensor and name."""
    setup = results.setup
    without = {"name", "description", "samples", "analysis", "sensors"}
    flat = {
        ("", name): value
        for record in (setup, setup.samples, setup.analysis)
        for name, value in list_stored(record).items()
        if name not in without
    }
    for sample in setup.samples.samples:
        flat |= {
            (sample.name, key): value
            for key, value in list_stored(sample).items()
            if key != "name"
        }
    for sensor in setup.sensors:
        place = f"{sensor.channel} sensor"
        flat |= {
            (place, key): value for key, value in list_stored(sensor).items() if key != "channel"
        }
    return flat
