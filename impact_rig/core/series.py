"""All hits of one sample: which are averaged, and which disagree with the others."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.detection import SPREAD_OF_MEDIAN
from impact_rig.core.hits import (
    FilteredHit,
    JudgedHit,
    MeanHit,
    TraceSum,
    make_mean,
    shift_hit,
    sum_up,
)
from impact_rig.core.pulse_width import measure_pulse
from impact_rig.core.records import FloatArray
from impact_rig.core.verdict import CHANNELS, Reason, Rejection

FEWEST_HITS = 5
"""Hits that a test needs, the tested one included [-], our choice: of four, the median absolute
deviation says next to nothing."""
THRESHOLDS = {
    5: 166.0, 6: 42.0, 7: 44.0, 8: 22.7, 9: 22.9, 10: 15.7, 11: 16.0, 12: 12.5, 13: 12.4,
    14: 10.6, 15: 10.7, 16: 9.3, 18: 8.5, 20: 7.9, 25: 7.1, 30: 6.4, 40: 5.8, 50: 5.4, 100: 4.8,
}  # fmt: skip
"""T(n) [-]: the deviation from the median over S that one of n normal values exceeds with a
probability of a third of 1e-4, since there are three quantities. Found by simulating 4e7
values for each n, rounded up by 1 to 3 %. Between them it is linear in 1 / n."""
ENDLESS_THRESHOLD = 4.2
"""T of many values [-]: the two-sided quantile of the normal distribution is 4.15."""
_INVERSE_COUNTS = (0.0, *(1.0 / count for count in reversed(THRESHOLDS)))
_INVERSE_THRESHOLDS = (ENDLESS_THRESHOLD, *reversed(THRESHOLDS.values()))
"""T over 1 / n, ascending."""
Values = TypeVar("Values", float, FloatArray)


@dataclass(frozen=True)
class Measure:
    """What hits are compared by."""

    name: str
    unit: str
    attribute: str  # of `JudgedHit`
    unit_scale: float  # printed unit over SI unit
    floor: float  # [median] least standard deviation that counts, our choice


MEASURES = (
    Measure("tau_p", " µs", "contact_time", 1e6, 0.005),
    Measure("hammer peak", " m/s^2", "hammer_peak", 1.0, 0.03),
    Measure("w10/w50", "", "width_ratio", 1.0, 0.01),
)
"""Floors: the contact time is repeated within 0.3 % by a good rig, the speed of a pendulum within
2 %, and 12 bits tell the ratio of widths within a part of 1 %."""


def compute_threshold(count: int) -> float:
    """Return T(n) for `count` hits [-], see `THRESHOLDS`."""
    return float(np.interp(1.0 / count, _INVERSE_COUNTS, _INVERSE_THRESHOLDS))


@dataclass(frozen=True)
class Criterion:
    """What makes an outlier in one quantity."""

    measure: Measure
    column: int  # of the figures
    count: int  # hits that have it
    median: float
    spread: float  # robust standard deviation, or its floor
    threshold: float  # deviation from the median that makes an outlier, over the spread

    def compute_deviation(self, values: Values) -> Values:
        """Return how far a value, or each of several, is from the median, over the spread [-]."""
        return abs(values - self.median) / self.spread


def read_figures(hit: JudgedHit) -> tuple[float, ...]:
    """Return the figures that a hit is compared by, in the order of `MEASURES` [SI units]."""
    return tuple(getattr(hit, measure.attribute) for measure in MEASURES)


def compute_criteria(figures: FloatArray) -> tuple[Criterion, ...]:
    """Return the criteria of the quantities that enough hits have; NaN is not known.

    Parameters
    ----------
    figures : ndarray, shape (hits, quantities)
        As `read_figures` has them.
    """
    criteria = []
    for column, measure in enumerate(MEASURES):
        values = _list_known(figures[:, column])
        if values.size >= FEWEST_HITS:
            threshold = compute_threshold(values.size)
            spread = _compute_spread(values, measure.floor * ENDLESS_THRESHOLD / threshold)
            criteria.append(Criterion(measure, column, values.size, *spread, threshold))
    return tuple(criteria)


def find_outliers(figures: FloatArray, criteria: Sequence[Criterion]) -> NDArray[np.bool_]:
    """Return which hits are outliers in any quantity, shape (hits,).

    Parameters
    ----------
    figures : ndarray, shape (hits, quantities)
        What is not known, NaN, makes no outlier.
    """
    found = np.zeros(len(figures), dtype=np.bool_)
    for criterion in criteria:
        deviations = criterion.compute_deviation(figures[:, criterion.column])
        found |= deviations > criterion.threshold
    return found


def compute_distances(figures: FloatArray) -> FloatArray:
    """Return hits' sums of squared deviations from the medians, in standard deviations.

    Parameters
    ----------
    figures : ndarray, shape (hits, quantities)
        What is not known, NaN, counts nothing.

    Returns
    -------
    ndarray, shape (hits,)
    """
    total = np.zeros(len(figures))
    for column, measure in enumerate(MEASURES):
        values = _list_known(figures[:, column])
        if values.size:
            median, spread = _compute_spread(values, measure.floor)
            total += np.nan_to_num((figures[:, column] - median) / spread) ** 2
    return total


def explain_outlier(
    figures: Sequence[float], criteria: Sequence[Criterion]
) -> tuple[Rejection, ...]:
    """Return a reason for each quantity in which a hit is an outlier."""
    found = []
    for criterion in criteria:
        measure, value = criterion.measure, figures[criterion.column]
        deviation = criterion.compute_deviation(value)
        if deviation > criterion.threshold:
            shown, median = (
                f"{number * measure.unit_scale:.4g}{measure.unit}"
                for number in (value, criterion.median)
            )
            found.append(
                Rejection(
                    Reason.INCONSISTENT,
                    f"{measure.name} {shown} is {deviation:.1f} robust"
                    f" standard deviations from the median {median} of {criterion.count} hits",
                )
            )
    return tuple(found)


def _list_known(values: FloatArray) -> FloatArray:
    return values[np.isfinite(values)]


def _compute_spread(values: FloatArray, floor: float) -> tuple[float, float]:
    """Return median and robust standard deviation, which is `floor` of the median at least."""
    median = float(np.median(values))
    deviation = float(np.median(abs(values - median)))
    return median, max(SPREAD_OF_MEDIAN * deviation, floor * abs(median))


SCATTER_HITS = 128
"""Hits of a mean that show the scatter at most [-], our choice: more than the 120 of a
whole published campaign."""

DOUBTS = (Reason.RINGING, Reason.UNSTEADY_ZERO)
"""Findings that are not corrected: they cannot be told from what is harmless."""
LEFT_AS_IT_IS = (Reason.SMOOTHED, Reason.TRUNCATED)
"""Findings that are worth a warning and are not corrected."""
LEAST_LIKENESS = 0.5
"""Correlation with the hits before over the contact, signs apart, from which on a channel tells
its polarity [-], our choice: good hits have 0.95 and more."""


@dataclass(frozen=True)
class Selection:
    """What became of the hits of one sample, in the order of arrival; without their traces."""

    kept: tuple[JudgedHit, ...]  # those that are averaged
    left_out: tuple[JudgedHit, ...]  # all others, with their reasons


class HitSeries:
    """Hits of one sample in the order of arrival.

    Parameters
    ----------
    keep : int
        How many hits are averaged at most: those with the least sum of squared deviations from
        the medians, each in standard deviations, after those accepted by hand; 0: all.
    """

    def __init__(self, keep: int = 0) -> None:
        self._keep = keep
        self._hits: list[JudgedHit] = []
        # Accepted hits have numbers, counted from 0: of each its row in the list of all hits,
        # its figures and its traces.
        self._rows: list[int] = []
        self._figures: list[tuple[float, ...]] = []
        self._traces: list[FilteredHit] = []
        self._criteria: tuple[Criterion, ...] = ()
        self._outliers: frozenset[int] = frozenset()
        self._surplus: frozenset[int] = frozenset()
        self._sum: TraceSum | None = None
        self._mean: MeanHit | None = None
        self._alone: FilteredHit | None = None  # the only accepted hit so far

    def __len__(self) -> int:
        """Return the number of hits, accepted or not."""
        return len(self._hits)

    @property
    def contact_time_spread(self) -> float:
        """Standard deviation of tau_p over the hits in the mean [s]; NaN: fewer than two."""
        times = [self._figures[number][0] for number in self._list_kept()]
        return float(np.std(times, ddof=1)) if len(times) > 1 else math.nan

    @property
    def overruled(self) -> tuple[JudgedHit, ...]:
        """Hits in the mean by hand, with all that is against them."""
        return tuple(hit for hit in self.select().kept if hit.overruled)

    def describe_findings(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Say what was corrected in the hits in the mean, and what could not be told."""
        kept = [self._hits[self._rows[number]] for number in self._list_kept()]
        found: dict[Reason, dict[int, str]] = {}
        for place, hit in enumerate(kept):
            for item in hit.findings:
                found.setdefault(item.reason, {})[place] = item.explanation
        corrected: list[str] = []
        doubtful: list[str] = []
        for reason, texts in found.items():
            is_doubt = reason in DOUBTS
            what = "in" if is_doubt or reason in LEFT_AS_IT_IS else "corrected in"
            last = texts[max(texts)]
            (doubtful if is_doubt else corrected).append(
                f"{reason.value} {what} {len(texts)} of {len(kept)} hits, in the last: {last}"
            )
        return tuple(corrected), tuple(doubtful)

    def match_polarity(self, hit: JudgedHit, *, turns: bool) -> JudgedHit:
        """Return an accepted hit with its polarity held against the hits in the mean so far.

        The first one says how the sensors are: a mean of both signs would be of neither.

        Parameters
        ----------
        hit : JudgedHit
            Accepted as far as it is judged alone.
        turns : bool
            Turn a channel of the other sign; False: reject the hit.
        """
        filtered = hit.filtered
        if filtered is None or self._sum is None:
            return hit
        turned = _find_turned(filtered, self._sum)
        if not turned:
            return hit
        names = " and ".join(CHANNELS[channel] for channel in turned)
        why = f"{names} of the other sign than in the hits before"
        if not turns:
            why += "; turns_polarity = true under [analysis] turns them"
            return replace(hit, rejections=(Rejection(Reason.POLARITY, why),))
        signs = np.ones((len(filtered.traces), 1))
        signs[turned] = -1.0
        traces = signs * filtered.traces
        traces.setflags(write=False)
        return replace(
            hit,
            filtered=replace(filtered, traces=traces, pulse=measure_pulse(traces[0])),
            findings=(*hit.findings, Rejection(Reason.POLARITY, why)),
        )

    def check(self, hit: JudgedHit) -> tuple[Rejection, ...]:
        """Return a reason for each quantity in which an accepted hit is an outlier so far."""
        figures = read_figures(hit)
        others = [self._figures[number] for number in self._list_compared()]
        return explain_outlier(figures, compute_criteria(np.array([*others, figures])))

    def add(self, hit: JudgedHit) -> None:
        """Take in a hit with its verdict; one accepted by hand stays in the mean."""
        self._hits.append(replace(hit, filtered=None))
        if not hit.accepted or hit.filtered is None:
            return
        number, traces = len(self._rows), shift_hit(hit.filtered)
        self._rows.append(len(self._hits) - 1)
        self._figures.append(read_figures(hit))
        self._traces.append(traces)
        self._alone = hit.filtered if number == 0 else None
        self._mean = None
        before = self._left_out
        self._choose()
        if self._left_out == before and self._sum is not None:
            self._sum = self._sum.add(traces)
        elif self._left_out != before | {number}:
            self._sum = sum_up([self._traces[kept] for kept in self._list_kept()])

    def compute_mean(self) -> MeanHit | None:
        """Return the mean hit; None: there is none in it.

        Raises
        ------
        SignalError
            If the hits do not belong together.
        """
        if self._mean is None and self._sum is not None:
            kept = [self._traces[number] for number in self._list_kept()]
            # Every one, every other, every fourth ...: a new hit seldom changes the others.
            step = 1 << max(math.ceil(len(kept) / SCATTER_HITS) - 1, 0).bit_length()
            self._mean = make_mean(self._sum, kept, step, self._alone)
        return self._mean

    def select(self) -> Selection:
        """Return which hits are in the mean so far, and why others are not."""
        kept, left_out = [], []
        numbers = {row: number for number, row in enumerate(self._rows)}
        for row, hit in enumerate(self._hits):
            number = numbers.get(row)
            if number is None:
                left_out.append(hit)
            elif number in self._left_out:
                left_out.append(replace(hit, rejections=self._explain(number)))
            else:
                kept.append(self._complete(hit) if hit.overruled else hit)
        return Selection(tuple(kept), tuple(left_out))

    def _explain(self, number: int) -> tuple[Rejection, ...]:
        """Return why an accepted hit is left out."""
        if number in self._outliers:
            return explain_outlier(self._figures[number], self._criteria)
        count = len(self._rows) - len(self._outliers)
        why = f"not among the {self._keep} most consistent of {count}"
        return (Rejection(Reason.SURPLUS, why),)

    def _complete(self, hit: JudgedHit) -> JudgedHit:
        """Return a hit accepted by hand with what the others have against it, once."""
        if any(rejection.reason is Reason.INCONSISTENT for rejection in hit.overruled):
            return hit
        return replace(hit, overruled=(*self.check(hit), *hit.overruled))

    @property
    def _left_out(self) -> frozenset[int]:
        """Numbers of accepted hits that are not in the mean."""
        return self._outliers | self._surplus

    def _list_kept(self) -> list[int]:
        """Return the numbers of the hits in the mean, ascending."""
        left_out = self._left_out
        return [number for number in range(len(self._rows)) if number not in left_out]

    def _list_compared(self) -> list[int]:
        """Return the numbers of the hits that were not accepted by hand, ascending."""
        return [number for number, row in enumerate(self._rows) if not self._hits[row].overruled]

    def _choose(self) -> None:
        """Leave out the outliers, then all but the most consistent."""
        compared = np.array(self._list_compared(), dtype=np.int64)
        figures = np.array(self._figures)[compared]
        self._criteria = compute_criteria(figures)
        outlying = find_outliers(figures, self._criteria)
        self._outliers = frozenset(compared[outlying].tolist())
        self._surplus = frozenset()
        if self._keep:
            wanted = max(self._keep - len(self._rows) + compared.size, 0)
            # Of equal ones the earlier stay.
            order = np.argsort(compute_distances(figures[~outlying]), kind="stable")
            self._surplus = frozenset(compared[~outlying][order[wanted:]].tolist())


def _find_turned(hit: FilteredHit, before: TraceSum) -> list[int]:
    """Return the channels of the other sign."""
    middle, reach = round(hit.pulse.middle), math.ceil(hit.pulse.half_amplitude_width)
    reach = min(
        reach,
        middle,
        before.origin,
        hit.traces.shape[1] - middle,
        before.total.shape[1] - before.origin,
    )
    turned = []
    for channel, (ours, theirs) in enumerate(zip(hit.traces, before.total, strict=False)):
        one = ours[middle - reach : middle + reach]
        other = theirs[before.origin - reach : before.origin + reach]
        scale = math.sqrt(float(one @ one) * float(other @ other))
        if float(one @ other) < -LEAST_LIKENESS * scale:
            turned.append(channel)
    return turned
