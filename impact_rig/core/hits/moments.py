"""Count, mean and scatter of values that come one at a time, and are not kept."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from impact_rig.core.signals.record import FloatArray


@dataclass(frozen=True)
class Moments:
    """What is left of values, by Welford's recurrence (Technometrics 4, 1962).

    Attributes
    ----------
    count : int
        So many.
    mean : float
        Theirs [unit of the values].
    squares : float
        Sum of their squared deviations from it [its square].
    """

    count: int = 0
    mean: float = 0.0
    squares: float = 0.0

    def add(self, value: float) -> Self:
        """Return these values and one more."""
        count = self.count + 1
        mean = self.mean + (value - self.mean) / count
        squares = self.squares + (value - self.mean) * (value - mean)
        return type(self)(count, mean, squares)

    def find_deviation(self, others: FloatArray) -> float:
        """Return the standard deviation of these values and others; NaN: fewer than two.

        Parameters
        ----------
        others : ndarray, shape (n,)
            Those that are kept.
        """
        count = self.count + others.size
        if count <= 1:
            return math.nan
        squares = self.squares
        if others.size:
            mean = float(others.mean())
            squares += float(np.square(others - mean).sum())
            squares += (mean - self.mean) ** 2 * self.count * others.size / count
        return math.sqrt(squares / (count - 1))
