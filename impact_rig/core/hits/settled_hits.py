"""What is known of hits that are in a mean for good, when their traces are gone."""

from dataclasses import dataclass

import numpy as np

from impact_rig.core.hits.selection import Norm, find_outliers
from impact_rig.core.signals.record import FloatArray


@dataclass(frozen=True)
class SettledHits:
    """Hits that are in a mean and can be taken out of it no more.

    Attributes
    ----------
    count : int
        So many.
    outliers : int
        Those of them that are outliers by now: many hits tell more than the few that there were
        when they were settled.
    shift : float
        By how much these have moved the mean of all contact times, part of it [-].
    """

    count: int
    outliers: int
    shift: float


def look_at_settled(
    figures: FloatArray, norms: tuple[Norm, ...], settled: FloatArray, others: FloatArray
) -> SettledHits:
    """Hold settled hits against all that there are by now.

    Parameters
    ----------
    figures : ndarray, shape (hits, quantities)
        Of the settled hits, by which they are compared.
    norms : tuple of Norm
        Of all hits.
    settled, others : ndarray, shapes (hits,) and (n,)
        Contact times of the settled hits, and of the others in the mean [s].
    """
    is_outlier = find_outliers(figures, norms)
    shift = 0.0
    if is_outlier.any():
        good = np.concatenate((settled[~is_outlier], others))
        whole = np.concatenate((settled, others))
        shift = float(1.0 - good.mean() / whole.mean()) if good.size else 0.0
    return SettledHits(settled.size, int(is_outlier.sum()), shift)
