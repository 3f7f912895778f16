"""Figures: what was measured how often, what was asked, and whether it is reached."""

import math
from dataclasses import dataclass
from enum import Enum
from statistics import median, quantiles


class Bound(Enum):
    """On which side of a goal the figure must lie."""

    AT_MOST = "at most"
    AT_LEAST = "at least"


@dataclass(frozen=True)
class Goal:
    """What is asked of a figure.

    Attributes
    ----------
    bound : Bound
        On which side of the limit it must lie.
    limit : float
        In the figure's unit.
    """

    bound: Bound
    limit: float

    def __str__(self) -> str:
        """Return the goal in words."""
        return f"{self.bound.value} {self.limit:g}"

    def is_reached(self, value: float) -> bool:
        """Return whether a value meets the goal; one that was not determined does not."""
        if not math.isfinite(value):
            return False
        return value <= self.limit if self.bound is Bound.AT_MOST else value >= self.limit


@dataclass(frozen=True)
class Figure:
    """One figure.

    Attributes
    ----------
    name : str
        What was measured.
    values : tuple of float
        Each measurement, in the order in which they were made; at least one.
    unit : str
        "" for numbers and ratios.
    goal : Goal or None
        For the median; None: nothing is asked.
    note : str
        What must be known to read it.
    """

    name: str
    values: tuple[float, ...]
    unit: str = ""
    goal: Goal | None = None
    note: str = ""

    @property
    def median(self) -> float:
        """Of the measurements, in `unit`."""
        return median(self.values)

    @property
    def quartiles(self) -> tuple[float, float]:
        """Between which half of the measurements lie, in `unit`: their spread."""
        if len(self.values) == 1:
            return self.values[0], self.values[0]
        low, _, high = quantiles(self.values, n=4, method="inclusive")
        return low, high

    @property
    def is_reached(self) -> bool | None:
        """Whether the median meets the goal; None: there is none."""
        return None if self.goal is None else self.goal.is_reached(self.median)


def at_most(limit: float) -> Goal:
    """Return the goal of a figure that must not be larger."""
    return Goal(Bound.AT_MOST, limit)


def at_least(limit: float) -> Goal:
    """Return the goal of a figure that must not be smaller."""
    return Goal(Bound.AT_LEAST, limit)
