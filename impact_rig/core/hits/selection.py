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

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.hits.verdict import Reason, Rejection
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


@dataclass(frozen=True)
class Selection:
    """What became of the hits of one sample.

    Attributes
    ----------
    kept : tuple of JudgedHit
        Those that are averaged, in the order of arrival.
    left_out : tuple of JudgedHit
        All others with their reasons, in the order of arrival.
    """

    kept: tuple[JudgedHit, ...]
    left_out: tuple[JudgedHit, ...]


def find_threshold(count: int) -> float:
    """Return T(n) for `count` hits [-], see `THRESHOLDS`."""
    counts = np.array(list(THRESHOLDS), dtype=np.float64)[::-1]
    values = np.array(list(THRESHOLDS.values()))[::-1]
    inverse = np.concatenate(([0.0], 1.0 / counts))
    return float(np.interp(1.0 / count, inverse, np.concatenate(([ENDLESS_THRESHOLD], values))))


def check_consistency(hit: JudgedHit, fellows: Sequence[JudgedHit]) -> tuple[Rejection, ...]:
    """Hold a hit against its fellows.

    Parameters
    ----------
    hit : JudgedHit
        Of the sample.
    fellows : sequence of JudgedHit
        Accepted hits of the same sample, `hit` itself included.

    Returns
    -------
    tuple of Rejection
        One for each quantity in which the hit is an outlier; none for fewer than five fellows.
    """
    return _find_outliers(hit, _find_norms(fellows))


def select_hits(hits: Sequence[JudgedHit], keep: int = 0) -> Selection:
    """Leave out the outliers among the accepted hits of one sample, then all but the best.

    Parameters
    ----------
    hits : sequence of JudgedHit
        Every hit of the sample in the order of arrival. One that a person has accepted stays in
        whatever its figures, and the others are not held against it.
    keep : int
        How many hits are kept at most: those with the least sum of squared deviations from the
        medians, each in standard deviations, after those that a person has accepted; 0: all.
    """
    reasons: dict[int, tuple[Rejection, ...]] = {}
    places = [i for i, hit in enumerate(hits) if hit.accepted and not hit.overruled]
    fellows = [hits[i] for i in places]
    norms = _find_norms(fellows)
    for place in places:
        reasons[place] = _find_outliers(hits[place], norms)
    consistent = [place for place in places if not reasons[place]]
    by_hand = sum(1 for hit in hits if hit.accepted and hit.overruled)
    if keep and len(consistent) + by_hand > keep:
        why = f"not among the {keep} most consistent of {len(consistent) + by_hand}"
        distances = _find_distances([hits[place] for place in consistent])
        # Of equal ones the earlier stay.
        order = np.argsort(distances, kind="stable")[max(keep - by_hand, 0) :]
        for index in order:
            reasons[consistent[int(index)]] = (Rejection(Reason.SURPLUS, why),)
    judged = [
        _complete_overruled(hit, fellows)
        if hit.accepted and hit.overruled
        else replace(hit, rejections=hit.rejections + reasons.get(i, ()))
        for i, hit in enumerate(hits)
    ]
    return Selection(
        kept=tuple(hit for hit in judged if hit.accepted),
        left_out=tuple(hit for hit in judged if not hit.accepted),
    )


def _complete_overruled(hit: JudgedHit, fellows: Sequence[JudgedHit]) -> JudgedHit:
    """Return a hit accepted by hand with what its fellows have against it, once."""
    if any(rejection.reason is Reason.INCONSISTENT for rejection in hit.overruled):
        return hit
    found = check_consistency(hit, (*fellows, hit))
    return replace(hit, overruled=(*found, *hit.overruled))


def _read(quantity: Quantity, hits: Sequence[JudgedHit]) -> FloatArray:
    values = np.array([getattr(hit, quantity.attribute) for hit in hits], dtype=np.float64)
    return values[np.isfinite(values)]


def _find_spread(values: FloatArray, floor: float) -> tuple[float, float]:
    """Return median and robust standard deviation, which is `floor` of the median at least."""
    median = float(np.median(values))
    spread = SPREAD_OF_MEDIAN * float(np.median(np.abs(values - median)))
    return median, max(spread, floor * abs(median))


@dataclass(frozen=True)
class _Norm:
    """What a quantity of the fellows is like: `count` of them have it."""

    quantity: Quantity
    count: int
    median: float
    spread: float
    threshold: float


def _find_norms(fellows: Sequence[JudgedHit]) -> list[_Norm]:
    """Return the norms of the quantities that enough fellows have."""
    norms = []
    for quantity in QUANTITIES:
        values = _read(quantity, fellows)
        if values.size >= FEWEST_FELLOWS:
            threshold = find_threshold(values.size)
            floor = quantity.floor * ENDLESS_THRESHOLD / threshold
            norms.append(_Norm(quantity, values.size, *_find_spread(values, floor), threshold))
    return norms


def _find_outliers(hit: JudgedHit, norms: Sequence[_Norm]) -> tuple[Rejection, ...]:
    found = []
    for norm in norms:
        quantity, value = norm.quantity, float(getattr(hit, norm.quantity.attribute))
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


def _find_distances(hits: Sequence[JudgedHit]) -> FloatArray:
    """Return each hit's sum of squared deviations, shape (n,); unknown figures count nothing."""
    total = np.zeros(len(hits))
    for quantity in QUANTITIES:
        values = _read(quantity, hits)
        if values.size == 0:
            continue
        median, spread = _find_spread(values, quantity.floor)
        every = np.array([getattr(hit, quantity.attribute) for hit in hits], dtype=np.float64)
        total += np.nan_to_num((every - median) / spread) ** 2
    return total
