"""All hits of one sample: which are in the mean, and which of them are kept one by one.

Of every hit verdict and figures are kept, so that all are held against all. Traces take room:
when there are too many, hits are settled, one at a time. The mean is a sum, and a settled hit is
in it for good, or left out of it for good. Those that are kept with their traces show the
scatter, and may still turn out outliers, or less consistent than others. Outliers are settled
first, then what is surplus, then, of those in the mean, the one whose neighbours are the nearest,
so that the hits kept lie evenly over the series. Those that more fellows may show to be outliers
wait until all others are settled: a trace cannot be taken out of a sum when it is gone.

What is settled depends on nothing but the hits and the order in which they came: live and from a
file it is the same.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.hits.averaging import (
    NO_HITS,
    AveragedHit,
    HitSum,
    MeanHit,
    shift_hit,
    summarize_hits,
)
from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.hits.hit_table import Fate, HitTable
from impact_rig.core.hits.moments import Moments
from impact_rig.core.hits.reasons import Reason, Rejection
from impact_rig.core.hits.selection import (
    QUANTITIES,
    Fellows,
    Norm,
    explain_outlier,
    find_doubtful,
    find_outliers,
    read_figures,
)
from impact_rig.core.hits.settled_hits import SettledHits, look_at_settled
from impact_rig.core.signals.record import FloatArray, HitLabel

Rows = NDArray[np.intp]


@dataclass(frozen=True)
class Selection:
    """What became of the hits of one sample; without their traces.

    Attributes
    ----------
    kept : tuple of JudgedHit
        Those that are averaged, in the order of arrival.
    left_out : tuple of JudgedHit
        All others with their reasons, in the order of arrival.
    """

    kept: tuple[JudgedHit, ...]
    left_out: tuple[JudgedHit, ...]


@dataclass(frozen=True)
class _Choice:
    """Which open hits are left out as things stand."""

    norms: tuple[Norm, ...] = ()
    outliers: Rows = field(default_factory=lambda: np.zeros(0, np.intp))
    surplus: Rows = field(default_factory=lambda: np.zeros(0, np.intp))
    """The most consistent first."""
    consistent: int = 0
    """Hits that are no outliers, where not all of them are wanted."""

    @property
    def left_out(self) -> frozenset[int]:
        return frozenset((*self.outliers.tolist(), *self.surplus.tolist()))


class HitSeries:
    """Hits of one sample in the order of arrival.

    Parameters
    ----------
    sample : str
        Its name.
    keep : int
        How many hits are averaged at most: those with the least sum of squared deviations from
        the medians, each in standard deviations, after those that a person has accepted; 0: all.
    """

    def __init__(self, sample: str, keep: int = 0) -> None:
        self._keep = keep
        self._table = HitTable(sample)
        # Figures of the hits that are not settled.
        self._open: dict[int, FloatArray] = {}
        self._by_hand: dict[int, FloatArray] = {}
        self._traces: dict[int, AveragedHit] = {}
        self._fellows, self._consistent = Fellows(), Fellows()
        self._choice = _Choice()
        self._settled, self._settled_summary = HitSum(), NO_HITS
        self._settled_times, self._settled_surplus = Moments(), 0
        self._sum = HitSum()
        self._mean: MeanHit | None = None

    def __len__(self) -> int:
        """Return the number of hits, whatever became of them."""
        return len(self._table)

    @property
    def traces(self) -> int:
        """Hits that are kept with their traces."""
        return len(self._traces)

    @property
    def labels(self) -> tuple[HitLabel, ...]:
        """Of all hits, in the order of arrival."""
        return tuple(self._table.labels)

    @property
    def contact_time_spread(self) -> float:
        """Standard deviation of tau_p over the hits in the mean [s]; NaN: fewer than two."""
        left_out = self._choice.left_out
        times = [figures[0] for row, figures in self._open.items() if row not in left_out]
        times += [figures[0] for figures in self._by_hand.values()]
        return self._settled_times.find_deviation(np.array(times))

    @property
    def overruled(self) -> tuple[JudgedHit, ...]:
        """Hits in the mean by hand, with all that is against them."""
        return tuple(
            self._complete(self._table[row])
            for row in self._table.overruled
            if self._table.read_fate(row) is Fate.BY_HAND
        )

    def check(self, hit: JudgedHit) -> tuple[Rejection, ...]:
        """Hold an accepted hit against all accepted hits so far, and itself.

        Returns
        -------
        tuple of Rejection
            One for each quantity in which the hit is an outlier.
        """
        figures = read_figures(hit)
        return explain_outlier(figures, self._fellows.find_norms_with(figures))

    def add(self, hit: JudgedHit) -> None:
        """Take in a hit with its verdict; one that a person has accepted stays in the mean."""
        if not hit.accepted:
            self._table.append(hit, Fate.REJECTED)
            return
        self._mean, figures = None, read_figures(hit)
        row = self._table.append(hit, Fate.BY_HAND if hit.overruled else Fate.OPEN)
        if hit.overruled:
            self._by_hand[row] = figures
        else:
            self._open[row] = figures
            self._fellows.add(figures)
            self._consistent.add(figures)
        if hit.filtered is not None:
            self._traces[row] = shift_hit(hit.filtered)
        before, self._choice = self._choice.left_out, self._choose()
        now = self._choice.left_out
        if now == before and hit.filtered is not None:
            self._sum = self._sum.add(self._traces[row])
        elif now != before | {row}:
            self._sum_up()

    def settle_one(self) -> None:
        """Settle one of the hits that are kept with their traces, of three or more."""
        if self._choice.outliers.size:
            row, fate = int(self._choice.outliers[0]), Fate.OUTLIER
        elif self._choice.surplus.size:
            row, fate = int(self._choice.surplus[-1]), Fate.SURPLUS
        else:
            row = self._find_densest()
            fate = Fate.BY_HAND if row in self._by_hand else Fate.SETTLED
        self._table.settle(row, fate, self._explain(row) if fate is Fate.OUTLIER else ())
        hit = self._traces.pop(row)
        figures = (self._by_hand if fate is Fate.BY_HAND else self._open).pop(row)
        self._settled_surplus += fate is Fate.SURPLUS
        if fate in (Fate.OUTLIER, Fate.SURPLUS):
            self._choice = self._choose()
            return
        self._settled = self._settled.add(hit)
        self._settled_summary = summarize_hits([hit], self._settled_summary)
        self._settled_times = self._settled_times.add(float(figures[0]))
        self._mean = None

    def find_mean(self) -> MeanHit | None:
        """Return the mean hit; None: there is none in it.

        Raises
        ------
        SignalError
            If the hits do not belong together.
        """
        if self._mean is None and self._sum.count:
            left_out = self._choice.left_out
            kept = [hit for row, hit in self._traces.items() if row not in left_out]
            self._mean = self._sum.make_mean(kept, self._settled_summary)
        return self._mean

    def look_at_settled(self) -> SettledHits:
        """Hold the hits that are settled in the mean against all that there are by now."""
        is_settled = self._table.have_fates(Fate.SETTLED)
        is_other = self._find_kept() & ~is_settled
        times = self._table.read("contact_time")
        figures = self._table.read_figures()[is_settled]
        return look_at_settled(figures, self._choice.norms, times[is_settled], times[is_other])

    def select(self) -> Selection:
        """Return the last word on every hit so far."""
        hits = [self._describe(row) for row in range(len(self._table))]
        is_kept = self._find_kept().tolist()
        return Selection(
            kept=tuple(hit for hit, kept in zip(hits, is_kept, strict=True) if kept),
            left_out=tuple(hit for hit, kept in zip(hits, is_kept, strict=True) if not kept),
        )

    def _describe(self, row: int) -> JudgedHit:
        hit, fate = self._table[row], self._table.read_fate(row)
        if fate is Fate.BY_HAND:
            return self._complete(hit)
        if fate is Fate.SURPLUS or row in self._choice.surplus:
            why = f"not among the {self._keep} most consistent of {self._choice.consistent}"
            return replace(hit, rejections=(Rejection(Reason.SURPLUS, why),))
        if row in self._choice.outliers:
            return replace(hit, rejections=self._explain(row))
        return hit

    def _complete(self, hit: JudgedHit) -> JudgedHit:
        """Return a hit accepted by hand with what its fellows have against it, once."""
        if any(rejection.reason is Reason.INCONSISTENT for rejection in hit.overruled):
            return hit
        return replace(hit, overruled=(*self.check(hit), *hit.overruled))

    def _explain(self, row: int) -> tuple[Rejection, ...]:
        return explain_outlier(self._open[row], self._choice.norms)

    def _find_kept(self) -> NDArray[np.bool_]:
        """Return which rows are hits in the mean, shape (hits,)."""
        is_kept = self._table.have_fates(Fate.BY_HAND, Fate.OPEN, Fate.SETTLED)
        is_kept[list(self._choice.left_out)] = False
        return is_kept

    def _choose(self) -> _Choice:
        """Leave out the outliers among the open hits, then all but the most consistent."""
        norms = self._fellows.find_norms()
        rows, figures = self._list_open()
        is_outlier = find_outliers(figures, norms)
        outliers = rows[is_outlier]
        if not self._keep:
            return _Choice(norms, outliers)
        self._note_outliers(frozenset(outliers.tolist()))
        rows, figures = rows[~is_outlier], figures[~is_outlier]
        in_mean = self._settled.count + len(self._by_hand)
        count = rows.size + in_mean + self._settled_surplus
        surplus = np.zeros(0, np.intp)
        if count > self._keep:
            # Of equal ones the earlier stay.
            order = np.argsort(self._consistent.find_distances(figures), kind="stable")
            surplus = rows[order[max(self._keep - in_mean, 0) :]]
        return _Choice(norms, outliers, surplus, count)

    def _note_outliers(self, now: frozenset[int]) -> None:
        """See to it that the open hits that are outliers now are not among the consistent."""
        before = frozenset(self._choice.outliers.tolist())
        for row in now - before:
            self._consistent.remove(self._open[row])
        for row in (before - now) & self._open.keys():
            self._consistent.add(self._open[row])

    def _list_open(self) -> tuple[Rows, FloatArray]:
        """Return rows and figures of the open hits, shapes (hits,) and (hits, quantities)."""
        figures = np.array(list(self._open.values())).reshape(len(self._open), len(QUANTITIES))
        return np.fromiter(self._open, np.intp), figures

    def _sum_up(self) -> None:
        """Sum up the hits in the mean anew."""
        left_out = self._choice.left_out
        self._sum = self._settled
        for row, hit in self._traces.items():
            if row not in left_out:
                self._sum = self._sum.add(hit)

    def _find_densest(self) -> int:
        """Return the row of the hit whose neighbours are the nearest: the others lie evenly."""
        rows = np.fromiter(self._traces, np.intp)
        gaps, inner = rows[2:] - rows[:-2], rows[1:-1]
        candidates, figures = self._list_open()
        is_sure = ~np.isin(inner, candidates[find_doubtful(figures, self._choice.norms)])
        if is_sure.any():
            gaps, inner = gaps[is_sure], inner[is_sure]
        return int(inner[np.argmin(gaps)])
