"""All hits of one sample: which are averaged, and which disagree with the others."""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.given.findings import Finding, Note, Reason
from impact_rig.core.given.records import SIMULATED, FloatArray
from impact_rig.core.hit.detection import SPREAD_OF_MEDIAN
from impact_rig.core.hit.judging import FilteredHit, JudgedHit
from impact_rig.core.hit.verdict import CHANNELS
from impact_rig.core.mean.mean_hit import MeanHit, TraceSum, make_mean, read_levels, shift_hit

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


@dataclass(frozen=True)
class Measure:
    """Figures by which hits are compared."""

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


def compute_thresholds(counts: NDArray[np.int64]) -> FloatArray:
    """Return T(n) of each count of hits, 1 or more [-], see `THRESHOLDS`."""
    inverse = [0.0, *(1.0 / count for count in reversed(THRESHOLDS))]
    return np.interp(1.0 / counts, inverse, [ENDLESS_THRESHOLD, *reversed(THRESHOLDS.values())])


@dataclass(frozen=True)
class Criteria:
    """Limits of outliers; arrays have one element for each of `MEASURES`."""

    counts: NDArray[np.int64]  # hits that have the quantity
    medians: FloatArray
    spreads: FloatArray  # robust standard deviations, or their floors
    thresholds: FloatArray  # [spread] of a deviation; infinite: too few hits have the quantity

    def measure_deviations(self, figures: FloatArray) -> FloatArray:
        """Return how far figures, shape (..., quantities), are from the medians [spread]."""
        return np.abs(figures - self.medians) / self.spreads

    def explain(self, figures: FloatArray) -> tuple[Finding, ...]:
        """Return a reason for each quantity in which a hit, shape (quantities,), is an outlier."""
        found = []
        deviations = self.measure_deviations(figures)
        for column in np.flatnonzero(deviations > self.thresholds).tolist():
            measure = MEASURES[column]
            shown, median = (
                f"{number * measure.unit_scale:.4g}{measure.unit}"
                for number in (figures[column], self.medians[column])
            )
            text = (
                f"{measure.name} {shown} is {deviations[column]:.1f} robust standard deviations"
                f" from the median {median} of {self.counts[column]} hits"
            )
            found.append(Finding(Reason.INCONSISTENT, text))
        return tuple(found)


def read_figures(hit: JudgedHit) -> FloatArray:
    """Return the figures that a hit is compared by, in the order of `MEASURES` [SI units]."""
    return np.array([getattr(hit, measure.attribute) for measure in MEASURES])


def compute_criteria(figures: FloatArray) -> Criteria:
    """Return the criteria of hits by their figures, shape (hits, quantities); NaN: not known."""
    counts = np.count_nonzero(np.isfinite(figures), axis=0)
    thresholds = compute_thresholds(np.maximum(counts, 1))
    floors = np.array([measure.floor for measure in MEASURES])
    medians = _compute_medians(figures)
    deviations = SPREAD_OF_MEDIAN * _compute_medians(np.abs(figures - medians))
    spreads = np.maximum(deviations, floors * ENDLESS_THRESHOLD / thresholds * np.abs(medians))
    return Criteria(
        counts, medians, spreads, np.where(counts >= FEWEST_HITS, thresholds, math.inf)
    )


def _compute_medians(figures: FloatArray) -> FloatArray:
    """Return the median of each column; what is not known is left out."""
    if not len(figures):
        return np.full(len(MEASURES), math.nan)
    columns = np.arange(figures.shape[1])
    count = np.count_nonzero(np.isfinite(figures), axis=0)
    below, above = (count - 1) // 2, count // 2
    # NaN is last.
    ordered = np.partition(figures.T, np.unique((below, above)), axis=1)
    return np.asarray(0.5 * (ordered[columns, below] + ordered[columns, above]))


DOUBTS = (Reason.RINGING, Reason.UNSTEADY_ZERO)
"""Findings that are not corrected: they look like harmless ones."""
LEFT_AS_IT_IS = (Reason.SMOOTHED, Reason.TRUNCATED)
"""Findings that are worth a warning and are not corrected."""


@dataclass(frozen=True)
class Selection:
    """The hits of one sample with their verdicts, in the order of arrival, without traces."""

    kept: tuple[JudgedHit, ...]  # those that are averaged
    left_out: tuple[JudgedHit, ...]  # all others, with their reasons


@dataclass(frozen=True)
class HitCount:
    """Numbers of hits of one sample that are averaged, and that are left out."""

    kept: int = 0
    left_out: int = 0
    attempts: int = 0  # at the next impact, the one behind those that are kept


@dataclass(frozen=True)
class Kind:
    """Properties that all hits in a mean share."""

    origin: str  # measured, imported; of a simulated hit also by what
    sampling_rate: float  # [Hz]
    channels: int

    def explain(self, other: "Kind") -> tuple[Finding, ...]:
        """Return why hits of another kind share no mean with these; none: they may."""
        pairs = zip(other.list_features(), self.list_features(), strict=True)
        told = [f"{one}, the hits before {two}" for one, two in pairs if one != two]
        return (Finding(Reason.OTHER_KIND, "; ".join(told)),) if told else ()

    def list_features(self) -> tuple[str, str, str]:
        """Return in words what hits of this kind are."""
        channels = "one channel" if self.channels == 1 else f"{self.channels} channels"
        return self.origin, f"sampled at {self.sampling_rate:.17g} Hz", f"of {channels}"


def _find_kind(hit: JudgedHit, filtered: FilteredHit) -> Kind:
    origin = str(hit.origin) if hit.origin.kind == SIMULATED else hit.origin.kind
    return Kind(origin, filtered.sampling_rate, len(filtered.traces))


BLOCK = 256
"""Accepted hits that are summed by themselves [-], our choice: as an outlier comes or goes, so
many traces are added again."""
MOST_SHOWN = 128
"""Hits that show the scatter at most [-], our choice: more than the 120 of a whole published
campaign."""


class Evenly(dict[int, Any]):
    """Things of a long series by their numbers: every one, every other, every fourth ..."""

    def __init__(self, most: int = MOST_SHOWN) -> None:
        super().__init__()
        self._most, self._count = most, 0

    def take(self, thing: Any) -> None:
        """Keep the next thing, or not; of those before so many that there are not too many."""
        step = 1 << (self._count // self._most).bit_length()
        if self._count % step == 0:
            self[self._count] = thing
        self._count += 1
        for other in [other for other in self if other % step] if len(self) > self._most else []:
            del self[other]


class HitSeries:
    """Hits of one sample in the order of arrival.

    Accepted hits are numbered from 0. Of each a row of numbers is kept, and of a long series the
    traces of some: a hit takes as long as the first ones did.

    Parameters
    ----------
    restore : callable
        Returns the filtered traces of a hit again, by its place among all hits.
    """

    def __init__(self, restore: Callable[[int], FilteredHit | None]) -> None:
        self.kind: Kind | None = None  # of the first accepted hit, which says what all are
        self._restore = restore
        self._hits: list[JudgedHit] = []
        self._attempts: Counter[int] = Counter()  # of all hits, by impact
        # Of accepted hits, by their numbers: place among all hits, whether a person accepted it,
        # whether it is an outlier, and a row each of what it is compared and averaged by.
        self._places: list[int] = []
        self._by_hand = np.zeros(0, dtype=bool)
        self._outlying = np.zeros(0, dtype=bool)
        self._figures = np.zeros((0, len(MEASURES)))
        self._levels = np.zeros((0, 0))
        self._found: dict[Reason, dict[int, str]] = {}  # findings, by number
        self._criteria = compute_criteria(self._figures)
        self._shown = Evenly()  # hits that show the scatter, shifted
        self._sums: dict[int, TraceSum] = {}  # of each `BLOCK` hits, those in the mean
        self._mean: MeanHit | None = None
        self._alone: FilteredHit | None = None  # the only accepted hit so far

    def __len__(self) -> int:
        """Return the number of hits, accepted or not."""
        return len(self._hits)

    @property
    def contact_time_spread(self) -> float:
        """Standard deviation of tau_p over the hits in the mean [s]; NaN: fewer than two."""
        times = self._figures[~self._outlying, 0]
        return float(np.std(times, ddof=1)) if len(times) > 1 else math.nan

    def describe_findings(self) -> tuple[tuple[Note, ...], tuple[Note, ...]]:
        """Return the corrections of the hits in the mean, and the doubts about them."""
        corrected: list[Note] = []
        doubtful: list[Note] = []
        count = np.count_nonzero(~self._outlying)
        for reason, texts in self._found.items():
            numbers = np.array(list(texts))
            numbers = numbers[~self._outlying[numbers]]
            if not numbers.size:
                continue
            is_doubt = reason in DOUBTS
            what = "in" if is_doubt or reason in LEFT_AS_IT_IS else "corrected in"
            last = texts[int(numbers[-1])]
            told = f"{what} {numbers.size} of {count} hits, in the last: {last}"
            (doubtful if is_doubt else corrected).append(Note(reason, told))
        return tuple(corrected), tuple(doubtful)

    def check(self, hit: JudgedHit) -> JudgedHit:
        """Return a hit with what those before have against it: its kind, sign, or figures.

        The first hit says how source and sensors are. Figures are compared of a good hit alone.
        """
        if hit.filtered is not None and self.kind is not None:
            apart = self.kind.explain(_find_kind(hit, hit.filtered))
            apart = apart or _find_turned(hit.filtered, next(iter(self._sums.values()), None))
            hit = replace(hit, rejections=(*hit.rejections, *apart))
        return replace(hit, rejections=self._compare(hit)) if hit.accepted else hit

    def _compare(self, hit: JudgedHit) -> tuple[Finding, ...]:
        """Return in which figures a hit is an outlier among those before."""
        figures = read_figures(hit)
        others = self._figures[~self._by_hand]
        return compute_criteria(np.vstack((others, figures))).explain(figures)

    def add(self, hit: JudgedHit) -> None:
        """Take in a hit with its verdict; one accepted by hand stays in the mean."""
        self._attempts[hit.label.impact] += 1
        self._hits.append(replace(hit, filtered=None))
        if not hit.accepted or hit.filtered is None:
            return
        if self.kind is None:
            self.kind = _find_kind(hit, hit.filtered)
        number, traces = len(self._places), shift_hit(hit.filtered)
        self._places.append(len(self._hits) - 1)
        self._by_hand = np.append(self._by_hand, bool(hit.overruled))
        self._figures = np.vstack((self._figures, read_figures(hit)))
        levels = read_levels(traces)
        self._levels = np.vstack((self._levels.reshape(-1, levels.size), levels))
        for item in hit.findings:
            # That of another sample is asked of the series as a whole.
            if item.reason is not Reason.OTHER_SAMPLE:
                self._found.setdefault(item.reason, {})[number] = item.explanation
        self._alone = None if number else hit.filtered
        self._shown.take(traces)
        before, self._outlying = self._outlying, self._find_outliers()
        self._sum_up(np.flatnonzero(before != self._outlying[:-1]), number, traces)
        self._mean = None

    def _find_outliers(self) -> NDArray[np.bool_]:
        """Return which accepted hits are outliers; those accepted by hand are none."""
        self._criteria = compute_criteria(self._figures[~self._by_hand])
        deviations = self._criteria.measure_deviations(self._figures)
        outlying = np.any(deviations > self._criteria.thresholds, axis=1)
        return np.asarray(outlying & ~self._by_hand)

    def _sum_up(self, changed: NDArray[np.int64], number: int, traces: FilteredHit) -> None:
        """Sum up a new hit, and again those beside hits that went out or came back."""
        blocks, newest = set((changed // BLOCK).tolist()), number // BLOCK
        if newest not in self._sums or newest in blocks:
            blocks.add(newest)
        elif not self._outlying[number]:
            self._sums[newest] = self._sums[newest].add(traces)
        for block in blocks:
            first, known = block * BLOCK, {**self._shown, number: traces}
            kept = first + np.flatnonzero(~self._outlying[first : first + BLOCK])
            found = (known.get(each) or self._restore(self._places[each]) for each in kept)
            shifted = [hit if hit.origin else shift_hit(hit) for hit in found if hit is not None]
            self._sums.pop(block, None)
            if shifted:
                self._sums[block] = TraceSum.of(shifted)

    def compute_mean(self) -> MeanHit | None:
        """Return the mean hit; None: there is none in it."""
        if self._mean is None and self._sums:
            total = TraceSum.of([self._sums[block] for block in sorted(self._sums)])
            shown = [hit for number, hit in self._shown.items() if not self._outlying[number]]
            self._mean = make_mean(total, shown, self._levels[~self._outlying], self._alone)
        return self._mean

    def select(self) -> Selection:
        """Return which hits are in the mean so far, and why others are not."""
        numbers = {place: number for number, place in enumerate(self._places)}
        kept, left_out = [], []
        for place, hit in enumerate(self._hits):
            number = numbers.get(place)
            if number is None:
                left_out.append(hit)
            elif self._outlying[number]:
                reasons = self._criteria.explain(self._figures[number])
                left_out.append(replace(hit, rejections=reasons))
            else:
                kept.append(self._complete(hit) if hit.overruled else hit)
        return Selection(tuple(kept), tuple(left_out))

    def list_by_hand(self) -> list[JudgedHit]:
        """Return the hits that a person accepted."""
        places = np.array(self._places, dtype=np.int64)[self._by_hand]
        return [self._complete(self._hits[place]) for place in places]

    def count(self) -> HitCount:
        """Return how many hits are in the mean so far, and how many are not."""
        kept = int(np.count_nonzero(~self._outlying))
        return HitCount(kept, len(self._hits) - kept, self._attempts[kept + 1])

    def _complete(self, hit: JudgedHit) -> JudgedHit:
        """Return a hit accepted by hand with what the others have against it, once."""
        if any(item.reason is Reason.INCONSISTENT for item in hit.overruled):
            return hit
        return replace(hit, overruled=(*self._compare(hit), *hit.overruled))


def _find_turned(hit: FilteredHit, before: TraceSum | None) -> tuple[Finding, ...]:
    """Return a reason against a hit of which a channel has the other sign than those before."""
    if before is None:
        return ()
    middle, reach = round(hit.pulse.middle), math.ceil(hit.pulse.half_amplitude_width)
    after = hit.traces.shape[1] - middle, before.traces.shape[1] - before.origin
    reach = min(reach, middle, before.origin, *after)
    turned = []
    for channel, (ours, theirs) in enumerate(zip(hit.traces, before.traces, strict=False)):
        one = ours[middle - reach : middle + reach]
        other = theirs[before.origin - reach : before.origin + reach]
        scale = math.sqrt(float(one @ one) * float(other @ other))
        # Good hits correlate by 0.95 and more, signs apart.
        if float(one @ other) < -0.5 * scale:
            turned.append(CHANNELS[channel])
    text = f"{' and '.join(turned)} of the other sign than in the hits before"
    return (Finding(Reason.POLARITY, text),) if turned else ()
