"""What changed from one run to another, beyond its uncertainty."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any

from impact_rig.results.campaign import Results
from impact_rig.results.estimates import HammerResults, SampleResults
from impact_rig.results.numbers import MEGA, MICRO

LARGEST_NORMALISED_ERROR = 1.0
"""|En| up to which two values agree [-], ISO 13528, 9.7, with U at 95 %."""
HAMMER_NAME = "hammer"
"""Stands where a sample's name stands."""


@dataclass(frozen=True)
class Quantity:
    """A quantity that runs are compared by.

    Attributes
    ----------
    name, symbol, unit : str
        In words, in equations, and the unit it is shown in.
    scale : float
        From SI units to that unit [-].
    digits : int
        Decimals of a value without uncertainty.
    read_value, read_expanded : callable
        Its value and the half-width of its 95 % interval, of a sample or the hammer.
    """

    name: str
    symbol: str
    unit: str
    scale: float
    digits: int
    read_value: Callable[[Any], float]
    read_expanded: Callable[[Any], float]


CONTACT_TIME = Quantity(
    "contact time",
    "τp",
    "µs",
    MICRO,
    2,
    lambda body: body.contact_time_s,
    lambda body: body.contact_time_expanded_s,
)
STIFFNESS = Quantity(
    "stiffness",
    "k",
    "MN/m",
    MEGA,
    2,
    lambda body: body.stiffness_n_per_m,
    lambda body: body.stiffness_expanded_n_per_m,
)
DAMPING_COEFFICIENT = Quantity(
    "damping coefficient",
    "c",
    "N s/m",
    1.0,
    1,
    lambda body: body.damping_coefficient_n_s_per_m,
    lambda body: body.damping_coefficient_expanded_n_s_per_m,
)
SAMPLE_QUANTITIES = (CONTACT_TIME, STIFFNESS, DAMPING_COEFFICIENT)
HAMMER_QUANTITIES = (STIFFNESS, DAMPING_COEFFICIENT)


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
    quantity : Quantity
        Which.
    values, expanded : tuple of float
        By run [SI unit]; NaN: not determined, or not measured there.
    changes : tuple of Change
        Of the second run from the first, of the third from the first, and so on.
    """

    body: str
    quantity: Quantity
    values: tuple[float, ...]
    expanded: tuple[float, ...]
    changes: tuple[Change, ...]


@dataclass(frozen=True)
class SetupDifference:
    """Something in the set-up that is not the same in all runs.

    Attributes
    ----------
    sample : str
        Whose it is; empty: of the rig or the settings.
    field : str
        As results.json calls it.
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
        for quantity in SAMPLE_QUANTITIES
    ]
    compared += [
        _compare(HAMMER_NAME, quantity, [results.hammer for results in runs])
        for quantity in HAMMER_QUANTITIES
    ]
    return tuple(item for item in compared if _count_known(item.values) > 1)


def find_setup_differences(runs: Sequence[Results]) -> tuple[SetupDifference, ...]:
    """Return what of masses, settings and samples is not the same in all runs.

    Names and descriptions may differ: they change no number.
    """
    flat = [_flatten_setup(results) for results in runs]
    keys = dict.fromkeys(key for setup in flat for key in setup)
    differences = (SetupDifference(*key, tuple(setup.get(key) for setup in flat)) for key in keys)
    # What is not known (NaN) is not known alike.
    return tuple(item for item in differences if len(set(map(repr, item.values))) > 1)


def _find_sample(results: Results, name: str) -> SampleResults | None:
    return next((sample for sample in results.samples if sample.name == name), None)


def _compare(
    body: str, quantity: Quantity, found: Sequence[SampleResults | HammerResults | None]
) -> ComparedQuantity:
    values = tuple(math.nan if item is None else quantity.read_value(item) for item in found)
    expanded = tuple(math.nan if item is None else quantity.read_expanded(item) for item in found)
    changes = tuple(
        Change(value - values[0], math.hypot(wide, expanded[0]))
        for value, wide in zip(values[1:], expanded[1:], strict=True)
    )
    return ComparedQuantity(body, quantity, values, expanded, changes)


def _count_known(values: Sequence[float]) -> int:
    return sum(math.isfinite(value) for value in values)


def _flatten_setup(results: Results) -> dict[tuple[str, str], float | str]:
    """Return every field that numbers depend on, by sample or sensor and name."""
    setup = results.setup
    without = {"name", "description", "samples", "analysis", "sensors"}
    flat = {("", name): value for name, value in _list_fields(setup) if name not in without}
    flat |= {("", name): value for name, value in _list_fields(setup.analysis)}
    for sample in setup.samples:
        flat |= {(sample.name, key): value for key, value in _list_fields(sample) if key != "name"}
    for sensor in setup.sensors:
        place = f"{sensor.channel} sensor"
        flat |= {(place, key): value for key, value in _list_fields(sensor) if key != "channel"}
    return flat


def _list_fields(record: Any) -> list[tuple[str, Any]]:
    return [(field.name, getattr(record, field.name)) for field in fields(record)]
