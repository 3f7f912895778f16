"""All hits of one sample: which are in the mean, and which of them are kept one by one.

Of every hit verdict and figures are kept, so that all are held against all. Traces take room:
when there are too many, hits are settled, one at a time. The mean is a sum, and a settled hit is
in it for good, or left out of it for good. Those that are kept with their traces show the
scatter, and may still turn out outliers, or less consistent than others. Outliers are settled
first, then what is surplus, then, of those in the mean, the one whose neighbours are the nearest,
so that the hits kept lie evenly over the series.

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
from impact_rig.core.hits.reasons import Reason, Rejection
from impact_rig.core.hits.selection import (
    Fellows,
    Norm,
    explain_outlier,
    find_distances,
    find_outliers,
    read_figures,
)
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
        self._traces: dict[int, AveragedHit] = {}
        self._fellows = Fellows()
        self._choice = _Choice()
        self._settled, self._settled_summary = HitSum(), NO_HITS
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
    def contact_times(self) -> FloatArray:
        """tau_p of every hit in the mean, in the order of arrival [s], shape (hits,)."""
        return self._table.read("contact_time")[self._find_kept()]

    @property
    def overruled(self) -> tuple[JudgedHit, ...]:
        """Hits in the mean by hand, with all that is against them."""
        rows = self._table.find_rows(Fate.BY_HAND)
        return tuple(self._complete(self._table[row]) for row in rows.tolist())

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
        fate = Fate.OPEN if hit.accepted else Fate.REJECTED
        if hit.accepted and hit.overruled:
            fate = Fate.BY_HAND
        row = self._table.append(hit, fate)
        if fate is Fate.REJECTED:
            return
        self._mean = None
        if fate is Fate.OPEN:
            self._fellows.add(read_figures(hit))
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
            by_hand = self._table.read_fate(row) is Fate.BY_HAND
            fate = Fate.BY_HAND if by_hand else Fate.SETTLED
        self._table.settle(row, fate, self._explain(row) if fate is Fate.OUTLIER else ())
        hit = self._traces.pop(row)
        if fate in (Fate.OUTLIER, Fate.SURPLUS):
            self._choice = self._choose()
            return
        self._settled = self._settled.add(hit)
        self._settled_summary = summarize_hits([hit], self._settled_summary)
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

    def select(self) -> Selection:
        """Return the last word on every hit so far."""
        hits = [self._describe(row) for row in range(len(self._table))]
        is_kept = self._find_kept()[: len(hits)].tolist()
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
        return explain_outlier(self._table.read_figures(np.array([row]))[0], self._choice.norms)

    def _find_kept(self) -> NDArray[np.bool_]:
        """Return which rows are hits in the mean, shape (room,)."""
        is_kept = self._table.have_fates(Fate.BY_HAND, Fate.OPEN, Fate.SETTLED)
        is_kept[list(self._choice.left_out)] = False
        return is_kept

    def _choose(self) -> _Choice:
        """Leave out the outliers among the open hits, then all but the most consistent."""
        norms = self._fellows.find_norms()
        rows = self._table.find_rows(Fate.OPEN)
        is_outlier = find_outliers(self._table.read_figures(rows), norms)
        outliers, rows = rows[is_outlier], rows[~is_outlier]
        if not self._keep:
            return _Choice(norms, outliers)
        in_mean = self._table.find_rows(Fate.SETTLED, Fate.BY_HAND).size
        count = rows.size + in_mean + self._table.find_rows(Fate.SURPLUS).size
        surplus = np.zeros(0, np.intp)
        if count > self._keep:
            # Of equal ones the earlier stay.
            order = np.argsort(self._find_distances(rows), kind="stable")
            surplus = rows[order[max(self._keep - in_mean, 0) :]]
        return _Choice(norms, outliers, surplus, count)

    def _find_distances(self, rows: Rows) -> FloatArray:
        """Return how far consistent open hits are from the medians of all, shape (rows,)."""
        others = self._table.read_figures(self._table.find_rows(Fate.SETTLED, Fate.SURPLUS))
        figures = np.vstack([self._table.read_figures(rows), others])
        return find_distances(figures)[: rows.size]

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
        return int(rows[np.argmin(rows[2:] - rows[:-2]) + 1])
