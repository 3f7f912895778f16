"""Which accepted hits of one sample are outliers, and which are the most consistent.

A flawless hit may still differ from the others: the hammer met an edge, the sample had moved. Its
contact time, its hammer peak and its pulse's ratio of widths are compared with the medians of all
accepted hits of the sample.

The scatter is S = 1.4826 MAD, which a few outliers do not widen. With few hits S may be small by
chance, so a hit is an outlier where its deviation exceeds both

- T(n) S, with T(n) such that of n normal hits each is left out with a probability of 1e-4, and
- T(inf) times the floor, the least scatter that is taken seriously, so that a very repeatable rig
  does not reject over nothing. This can but lower the probability.

The first is why five hits find only gross outliers (T = 166), ten find what others would (T = 16).
"""

import math
from array import array
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.hits.reasons import Reason, Rejection
from impact_rig.core.signals.record import FloatArray

FEWEST_HITS = 5
"""Hits that a test needs, the tested one included [-], our choice: of four, the median absolute
deviation says next to nothing."""
SPREAD_OF_MEDIAN = 1.4826
"""Standard deviation over median absolute deviation of many normal values [-]."""
FALSE_ALARM = 1e-4
"""Probability that a good hit is left out, all quantities together [-], our choice."""
THRESHOLDS = {
    5: 166.0, 6: 42.0, 7: 44.0, 8: 22.7, 9: 22.9, 10: 15.7, 11: 16.0, 12: 12.5, 13: 12.4,
    14: 10.6, 15: 10.7, 16: 9.3, 18: 8.5, 20: 7.9, 25: 7.1, 30: 6.4, 40: 5.8, 50: 5.4, 100: 4.8,
}  # fmt: skip
"""T(n) [-]: the deviation from the median over S that one of n normal values exceeds with a
probability of a third of `FALSE_ALARM`, since there are three quantities. Found by simulating 4e7
values for each n, rounded up by 1 to 3 %. Between them it is linear in 1 / n."""
ENDLESS_THRESHOLD = 4.2
"""T of many values [-]: the two-sided quantile of the normal distribution is 4.15."""
_INVERSE_COUNTS = (0.0, *(1.0 / count for count in reversed(THRESHOLDS)))
_INVERSE_THRESHOLDS = (ENDLESS_THRESHOLD, *reversed(THRESHOLDS.values()))
"""T over 1 / n, ascending."""


@dataclass(frozen=True)
class Quantity:
    """What hits are compared by.

    Attributes
    ----------
    name, unit : str
        For people.
    attribute : str
        Of `JudgedHit`.
    unit_scale : float
        Printed unit over SI unit [-].
    floor : float
        Least standard deviation that is taken seriously, part of the median [-]; our choice.
    """

    name: str
    unit: str
    attribute: str
    unit_scale: float
    floor: float


QUANTITIES = (
    Quantity("tau_p", " µs", "contact_time", 1e6, 0.005),
    Quantity("hammer peak", " m/s^2", "hammer_peak", 1.0, 0.03),
    Quantity("w10/w50", "", "width_ratio", 1.0, 0.01),
)
"""Floors: the contact time is repeated within 0.3 % by a good rig, the speed of a pendulum within
2 %, and 12 bits tell the ratio of widths within a part of 1 %."""


def compute_threshold(count: int) -> float:
    """Return T(n) for `count` hits [-], see `THRESHOLDS`."""
    return float(np.interp(1.0 / count, _INVERSE_COUNTS, _INVERSE_THRESHOLDS))


@dataclass(frozen=True)
class Criterion:
    """What makes an outlier in one quantity.

    Attributes
    ----------
    quantity : Quantity
        Which.
    column : int
        Of the figures.
    count : int
        Hits that have it.
    median, spread : float
        Median, and robust standard deviation or its floor [SI units].
    threshold : float
        Deviation from the median that makes an outlier, over the spread [-].
    """

    quantity: Quantity
    column: int
    count: int
    median: float
    spread: float
    threshold: float

    def compute_deviation(self, value: float) -> float:
        """Return how far a value is from the median, over the spread [-]."""
        return abs(value - self.median) / self.spread

    def is_met_by(self, value: float) -> bool:
        """Whether a value makes an outlier; NaN, which is not known, does not."""
        return self.compute_deviation(value) > self.threshold


def read_figures(hit: JudgedHit) -> tuple[float, ...]:
    """Return the figures that a hit is compared by, in the order of `QUANTITIES` [SI units]."""
    return tuple(getattr(hit, quantity.attribute) for quantity in QUANTITIES)


class SortedFigures:
    """Figures of hits in ascending order, so that medians and outliers are found at once.

    A hit costs a binary search in each quantity; outliers stand at the ends.
    """

    def __init__(self) -> None:
        self._columns: tuple[array[float], ...] = tuple(array("d") for _ in QUANTITIES)
        self._numbers: tuple[array[int], ...] = tuple(array("q") for _ in QUANTITIES)

    def add(self, number: int, figures: Sequence[float]) -> None:
        """Take in a hit; what is not known is left out."""
        for column, numbers, value in zip(self._columns, self._numbers, figures, strict=True):
            if math.isfinite(value):
                place = bisect_left(column, value)
                column.insert(place, value)
                numbers.insert(place, number)

    def remove(self, number: int, figures: Sequence[float]) -> None:
        """Take out a hit."""
        for column, numbers, value in zip(self._columns, self._numbers, figures, strict=True):
            if math.isfinite(value):
                place = numbers.index(number, bisect_left(column, value))
                del column[place], numbers[place]

    def compute_criteria(self) -> tuple[Criterion, ...]:
        """Return the criteria of the quantities that enough of the hits have."""
        criteria = []
        for index, (quantity, column) in enumerate(zip(QUANTITIES, self._columns, strict=True)):
            count = len(column)
            if count >= FEWEST_HITS:
                threshold = compute_threshold(count)
                floor = quantity.floor * ENDLESS_THRESHOLD / threshold
                spread = _compute_spread(column, floor)
                criteria.append(Criterion(quantity, index, count, *spread, threshold))
        return tuple(criteria)

    def compute_criteria_with(self, figures: Sequence[float]) -> tuple[Criterion, ...]:
        """Return the same with one more hit, this once."""
        self.add(-1, figures)
        criteria = self.compute_criteria()
        self.remove(-1, figures)
        return criteria

    def find_outliers(self, criteria: Sequence[Criterion]) -> frozenset[int]:
        """Return the numbers of the hits that are outliers in any quantity."""
        found: set[int] = set()
        for criterion in criteria:
            column = self._columns[criterion.column]
            numbers = self._numbers[criterion.column]
            for places in (range(len(column)), reversed(range(len(column)))):
                for place in places:
                    if not criterion.is_met_by(column[place]):
                        break
                    found.add(numbers[place])
        return frozenset(found)

    def compute_distances(self, figures: FloatArray) -> FloatArray:
        """Return hits' sums of squared deviations from the medians, in standard deviations.

        Parameters
        ----------
        figures : ndarray, shape (hits, quantities)
            What is not known counts nothing.

        Returns
        -------
        ndarray, shape (hits,)
        """
        total = np.zeros(len(figures))
        for values, quantity, column in zip(figures.T, QUANTITIES, self._columns, strict=True):
            if column:
                median, spread = _compute_spread(column, quantity.floor)
                total += np.nan_to_num((values - median) / spread) ** 2
        return total


def explain_outlier(
    figures: Sequence[float], criteria: Sequence[Criterion]
) -> tuple[Rejection, ...]:
    """Return a reason for each quantity in which a hit is an outlier."""
    found = []
    for criterion in criteria:
        quantity, value = criterion.quantity, figures[criterion.column]
        if criterion.is_met_by(value):
            shown, median = (
                f"{number * quantity.unit_scale:.4g}{quantity.unit}"
                for number in (value, criterion.median)
            )
            found.append(
                Rejection(
                    Reason.INCONSISTENT,
                    f"{quantity.name} {shown} is {criterion.compute_deviation(value):.1f} robust"
                    f" standard deviations from the median {median} of {criterion.count} hits",
                )
            )
    return tuple(found)


def _compute_spread(values: Sequence[float], floor: float) -> tuple[float, float]:
    """Return median and robust standard deviation, which is `floor` of the median at least.

    Of ascending values, since those nearest to the median are then neighbours.
    """
    low, high = (len(values) - 1) // 2, len(values) // 2
    median = (values[low] + values[high]) / 2.0
    deviation = _compute_reach(values, median, low + 1)
    if high > low:
        deviation = (deviation + _compute_reach(values, median, high + 1)) / 2.0
    return median, max(SPREAD_OF_MEDIAN * deviation, floor * abs(median))


def _compute_reach(values: Sequence[float], median: float, count: int) -> float:
    """Return how far the `count` nearest of ascending values lie from the median at most.

    They are neighbours. The farther up they begin, the nearer is the first and the farther the
    last: the best begin where both are equally far, or just before.
    """

    def compute_excess(first: int) -> float:
        return (values[first + count - 1] - median) - (median - values[first])

    places = range(len(values) - count + 1)
    balanced = bisect_left(places, 0.0, key=compute_excess)
    return min(
        max(median - values[first], values[first + count - 1] - median)
        for first in (balanced - 1, balanced)
        if first in places
    )
