"""Which accepted hits of one sample belong together: outliers, and the most consistent ones.

A hit may be flawless and still be another one than its fellows: the hammer met an edge, the
sample had moved. It is told by its contact time, its hammer peak and its pulse's ratio of widths,
each held against the median of the sample's hits.

The scatter is S = 1.4826 MAD, which a few outliers do not widen. With few hits S may be small by
chance, so a hit is an outlier where its deviation exceeds both

- T(n) S, with T(n) such that of n normal hits each is left out with a probability of 1e-4, and
- T(inf) times the floor, the least scatter that is taken seriously, so that a very repeatable rig
  does not reject over nothing. This can but lower the probability.

The first is why five hits find only gross outliers (T = 166), ten find what others would (T = 16).
"""

import math
from array import array
from bisect import bisect_left, insort
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.hits.reasons import Reason, Rejection
from impact_rig.core.signals.record import FloatArray

FEWEST_FELLOWS = 5
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
LARGEST_ARRAY = 256
"""Of those that are made to find a scatter [values], our choice."""
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
    Quantity("tau_p", " us", "contact_time", 1e6, 0.005),
    Quantity("hammer peak", " m/s^2", "hammer_peak", 1.0, 0.03),
    Quantity("w10/w50", "", "width_ratio", 1.0, 0.01),
)
"""Floors: the contact time is repeated within 0.3 % by a good rig, the speed of a pendulum within
2 %, and 12 bits tell the ratio of widths within a part of 1 %."""


def find_threshold(count: int) -> float:
    """Return T(n) for `count` hits [-], see `THRESHOLDS`."""
    return float(np.interp(1.0 / count, _INVERSE_COUNTS, _INVERSE_THRESHOLDS))


@dataclass(frozen=True)
class Norm:
    """What fellows are like in one quantity.

    Attributes
    ----------
    quantity : Quantity
        Which.
    column : int
        Of the figures.
    count : int
        Fellows that have it.
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


def read_figures(hit: JudgedHit) -> FloatArray:
    """Return the figures that a hit is compared by, in the order of `QUANTITIES` [SI units]."""
    return np.array([getattr(hit, quantity.attribute) for quantity in QUANTITIES])


class Fellows:
    """Hits that others are held against, ten thousand of them in a tenth of a millisecond."""

    def __init__(self) -> None:
        # In ascending order. Whatever else holds on to one of these arrays keeps it from growing.
        self._columns: tuple[array[float], ...] = tuple(array("d") for _ in QUANTITIES)

    def add(self, figures: FloatArray) -> None:
        """Take in one more hit, see `read_figures`; what is not known is left out."""
        for column, value in zip(self._columns, figures.tolist(), strict=True):
            if math.isfinite(value):
                insort(column, value)

    def remove(self, figures: FloatArray) -> None:
        """Take out a hit with these figures."""
        for column, value in zip(self._columns, figures.tolist(), strict=True):
            if math.isfinite(value):
                del column[bisect_left(column, value)]

    def find_norms(self) -> tuple[Norm, ...]:
        """Return the norms of the quantities that enough of the hits have."""
        norms = []
        for index, (quantity, column) in enumerate(zip(QUANTITIES, self._columns, strict=True)):
            count = len(column)
            if count >= FEWEST_FELLOWS:
                threshold = find_threshold(count)
                floor = quantity.floor * ENDLESS_THRESHOLD / threshold
                spread = _find_spread(np.frombuffer(column), floor)
                norms.append(Norm(quantity, index, count, *spread, threshold))
        return tuple(norms)

    def find_norms_with(self, figures: FloatArray) -> tuple[Norm, ...]:
        """Return the same with one more hit, this once."""
        self.add(figures)
        norms = self.find_norms()
        self.remove(figures)
        return norms

    def find_distances(self, figures: FloatArray) -> FloatArray:
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
                median, spread = _find_spread(np.frombuffer(column), quantity.floor)
                total += np.nan_to_num((values - median) / spread) ** 2
        return total


def find_outliers(figures: FloatArray, norms: tuple[Norm, ...]) -> NDArray[np.bool_]:
    """Return which of the hits are outliers in any quantity, shape (hits,)."""
    found = np.zeros(len(figures), dtype=bool)
    for norm in norms:
        found |= _find_deviations(figures, norm) > norm.threshold
    return found


def find_doubtful(figures: FloatArray, norms: tuple[Norm, ...]) -> NDArray[np.bool_]:
    """Return which of the hits would be outliers if many had this scatter, shape (hits,).

    Of few hits the scatter is not known well enough to tell; more may show it.
    """
    found = np.zeros(len(figures), dtype=bool)
    for norm in norms:
        found |= _find_deviations(figures, norm) > ENDLESS_THRESHOLD
    return found


def _find_deviations(figures: FloatArray, norm: Norm) -> FloatArray:
    """Return how far hits are from the median, over the spread, shape (hits,).

    A figure that is not known is not held against a hit: NaN exceeds nothing.
    """
    deviations: FloatArray = np.abs(figures[:, norm.column] - norm.median) / norm.spread
    return deviations


def explain_outlier(figures: FloatArray, norms: tuple[Norm, ...]) -> tuple[Rejection, ...]:
    """Return what is held against one hit, shape (quantities,): a reason for each quantity."""
    found = []
    for norm in norms:
        quantity, value = norm.quantity, float(figures[norm.column])
        deviations = abs(value - norm.median) / norm.spread
        if deviations > norm.threshold:
            shown, median = (
                f"{number * quantity.unit_scale:.4g}{quantity.unit}"
                for number in (value, norm.median)
            )
            found.append(
                Rejection(
                    Reason.INCONSISTENT,
                    f"{quantity.name} {shown} is {deviations:.1f} robust standard deviations from"
                    f" the median {median} of {norm.count} hits",
                )
            )
    return tuple(found)


def _find_spread(values: FloatArray, floor: float) -> tuple[float, float]:
    """Return median and robust standard deviation, which is `floor` of the median at least.

    Of ascending values, since those nearest to the median are then neighbours.
    """
    low, high = (values.size - 1) // 2, values.size // 2
    median = float(values[low] + values[high]) / 2.0
    deviation = _find_deviation(values, median, low + 1)
    if high > low:
        deviation = (deviation + _find_deviation(values, median, high + 1)) / 2.0
    return median, max(SPREAD_OF_MEDIAN * deviation, floor * abs(median))


def _find_deviation(values: FloatArray, median: float, count: int) -> float:
    """Return how far the `count` nearest of ascending values lie from the median at most.

    They are neighbours. The farther up they begin, the nearer is the first and the farther the
    last: the best begin where both are equally far, or just before. That is looked for in steps,
    then between two of them: arrays as long as the series would leave their holes in the memory.
    """
    places = values.size - count + 1
    step = places // LARGEST_ARRAY + 1
    before = 0
    if step > 1:
        first, last = values[:places:step], values[count - 1 :: step]
        before = step * max(int(np.count_nonzero(last - median < median - first)) - 1, 0)
    after = before + step + 1 if step > 1 else places
    below = median - values[before : min(after, places)]
    above = values[before + count - 1 : after + count - 1] - median
    return float(np.maximum(below, above).min())
