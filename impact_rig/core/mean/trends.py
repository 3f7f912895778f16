"""A series has an order and groups: what changes from hit to hit, and by how much."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from impact_rig.core.given.findings import Note, Subject
from impact_rig.core.given.records import FloatArray
from impact_rig.core.hit.detection import SPREAD_OF_MEDIAN
from impact_rig.core.mean.mean_hit import MeanHit

FEWEST_HITS = 5
"""Hits that show a trend, two groups or an odd one among them [-], our choice."""
CHANCE = 2.7e-3
"""Probability of a trend by chance [-]: that of |t| > 3 in a long series."""


@dataclass(frozen=True)
class Course:
    """Trend of a series of hits."""

    peak_standard: float = 0.0  # standard uncertainty of the mean peak by its trend [-]
    width_standard: float = 0.0  # the same of w50
    warnings: tuple[Note, ...] = ()


STEADY = Course()
"""Course of a series with neither trend nor groups."""


def follow_series(mean: MeanHit, ratios: FloatArray | None = None) -> Course:
    """Return trends and groups of the hits of a mean.

    Parameters
    ----------
    ratios : ndarray, shape (hits,), optional
        Of the momenta of sample and hammer.
    """
    if len(mean.hits) < FEWEST_HITS:
        return STEADY
    peaks = np.log([abs(hit.pulse.peak) for hit in mean.hits])
    widths = np.log([hit.pulse.half_amplitude_width for hit in mean.hits])
    groups = describe_groups(peaks, widths)
    shown = {"peak": peaks, "width w50": widths}
    if ratios is not None and np.all(np.isfinite(ratios)) and np.all(ratios > 0.0):
        shown["momentum ratio"] = np.log(ratios)
    # Two groups, one after the other, are no trend.
    changes = {name: 0.0 if groups else find_trend(values) for name, values in shown.items()}
    told = [
        f"the {name} changes by {100.0 * change:+.2g} % over the series, more than chance makes"
        for name, change in changes.items()
        if change
    ]
    warnings = [Note(Subject.GROUPS, groups)] if groups else []
    if told:
        what = (
            f"{'; '.join(told)}: a sensor that warms up, a sample that wears, a hammer that"
            " is released otherwise; half of it is in the ±"
        )
        warnings.append(Note(Subject.TREND, what))
    # The true value lies anywhere between both ends, evenly distributed.
    parts = [abs(changes[name]) / 2.0 / math.sqrt(3.0) for name in ("peak", "width w50")]
    return Course(parts[0], parts[1], tuple(warnings))


def find_trend(values: FloatArray) -> float:
    """Return how far values, shape (n,), go from the first to the last; 0: no more than chance."""
    count = values.size
    slope, error = _fit_line(np.arange(count), values)
    limit = float(scipy.special.stdtrit(count - 2, 1.0 - CHANCE / 2.0))
    return slope * (count - 1) if abs(slope) > limit * error else 0.0


def _fit_line(places: NDArray[Any], values: FloatArray) -> tuple[float, float]:
    """Return the slope of values over places, both of shape (n,), and its standard error."""
    centred = places - places.mean()
    spread = float(centred @ centred)
    slope = float(centred @ values) / spread
    left = values - values.mean() - slope * centred
    return slope, math.sqrt(float(left @ left) / (values.size - 2) / spread)


def describe_groups(peaks: FloatArray, widths: FloatArray) -> str | None:
    """Say that the hits are of two strengths, by logarithms of shape (n,); None: of one."""
    order = np.sort(peaks)
    places = range(2, peaks.size - 1)
    split = max(places, key=lambda place: float(order[place] - order[place - 1]), default=0)
    if not split:
        return None
    weak, strong = order[:split], order[split:]
    within = math.sqrt((weak.var() * weak.size + strong.var() * strong.size) / (peaks.size - 2))
    apart = float(strong.mean() - weak.mean())
    # Of one group, the halves are 1.6 of their own deviations apart, seldom 6.
    if apart < max(8.0 * within, 0.1):
        return None
    power, error = _fit_line(peaks, widths)
    # Hertz: the duration goes as F^(-1/6), of a linear spring it does not change.
    near = max(3.0 * error, 0.02)
    kind = "as of two contacts"
    if abs(power + 1.0 / 6.0) < near:
        kind = "as of one contact by Hertz at two speeds"
    elif abs(power) < near:
        kind = "as of one linear spring at two speeds"
    return (
        f"two groups of strength: {weak.size} hits, and {strong.size} that are"
        f" {math.exp(apart):.2g} times as strong; w50 goes as the peak to the power of"
        f" {power:.2f} ± {2.0 * error:.2f}, {kind}. Means are of neither: analyze them apart"
    )


def check_hits(mean: MeanHit, values: FloatArray, least: float, told: str) -> tuple[Note, ...]:
    """Warn of hits whose value differs from the others'.

    Parameters
    ----------
    values : ndarray, shape (hits,)
        One for each of those that show the scatter.
    least : float
        Difference from the median that is nothing odd.
    told : str
        What is odd, with {} for the hits.
    """
    if values.size < FEWEST_HITS or not np.all(np.isfinite(values)):
        return ()
    away = np.abs(values - np.median(values))
    odd = away > max(6.0 * SPREAD_OF_MEDIAN * float(np.median(away)), least)
    labels = [mean.hits[place].label for place in np.flatnonzero(odd)]
    hits = [f"{label.impact}.{label.attempt}" for label in labels if label is not None]
    if not hits:
        return ()
    named = f"hit{'s' if len(hits) > 1 else ''} {' and '.join(hits)}"
    return (Note(Subject.HITS, told.format(named)),)
