"""All hits of one sample: which are in the mean, and which are left out.

Of every hit verdict and figures stay in memory, its aligned traces in a temporary file. The mean
is a running sum. When more hits show that one of them is an outlier, or that it is none after
all, the sum is made anew from the file, in the order of arrival: what is in the mean depends on
the hits alone, and its bits on nothing else.
"""

import math
import pickle
import tempfile
import weakref
from array import array
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import IO

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.errors import FileError
from impact_rig.core.hits.averaging import AveragedHit, HitSum, MeanHit, shift_hit
from impact_rig.core.hits.hit import FilteredHit, JudgedHit
from impact_rig.core.hits.outliers import (
    QUANTITIES,
    Criterion,
    SortedFigures,
    explain_outlier,
    read_figures,
)
from impact_rig.core.hits.pulse_width import measure_pulse
from impact_rig.core.hits.reasons import Reason, Rejection
from impact_rig.core.hits.verdict import CHANNELS
from impact_rig.core.signals.record import FloatArray, HitLabel


class TraceFile:
    """Hits by number, in a file without a name that ends with the process.

    It lies in the system's folder for temporary files, which `TMPDIR` changes: 40 kB a hit of the
    5000 points.
    """

    def __init__(self) -> None:
        self._file: IO[bytes] | None = None
        self._places = array("q")
        self._end = 0

    def append(self, hit: AveragedHit) -> None:
        """Write the next hit.

        Raises
        ------
        FileError
            If there is no room.
        """
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile()  # noqa: SIM115 - closed with this object
                weakref.finalize(self, self._file.close)
            self._file.seek(self._end)
            pickle.dump(hit, self._file, pickle.HIGHEST_PROTOCOL)
            self._file.flush()
        except OSError as error:
            raise FileError(
                f"traces of hits cannot be written to {tempfile.gettempdir()}: {error.strerror};"
                " let TMPDIR name a folder with more room"
            ) from error
        self._places.append(self._end)
        self._end = self._file.tell()

    def read(self, number: int) -> AveragedHit:
        """Return a hit by its number, counted from 0."""
        if self._file is None:
            raise IndexError(number)
        self._file.seek(self._places[number])
        hit: AveragedHit = pickle.load(self._file)  # noqa: S301 - what this process has written
        hit.scaled.setflags(write=False)
        return hit


SCATTER_HITS = 128
"""Hits of a mean that show the scatter at most [-], our choice: more than the 120 of a
whole published campaign."""

DOUBTS = (Reason.RINGING, Reason.UNSTEADY_ZERO)
"""Findings that are not corrected: they cannot be told from what is harmless."""
LEAST_LIKENESS = 0.5
"""Correlation with the hits before over the contact, signs apart, from which on a channel tells
its polarity [-], our choice: good hits have 0.95 and more."""
Numbers = NDArray[np.int64]


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
class _LeftOut:
    """Accepted hits that are left out of the mean, by number."""

    outliers: frozenset[int] = frozenset()
    surplus: frozenset[int] = frozenset()

    @property
    def numbers(self) -> frozenset[int]:
        return self.outliers | self.surplus


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
        self._rows = array("q")
        self._figures = array("d")
        self._traces = TraceFile()
        self._by_hand: list[int] = []
        self._findings: dict[int, tuple[Rejection, ...]] = {}
        self._sorted, self._consistent = SortedFigures(), SortedFigures()
        self._criteria: tuple[Criterion, ...] = ()
        self._left_out = _LeftOut()
        self._sum = HitSum()
        self._mean: MeanHit | None = None

    def __len__(self) -> int:
        """Return the number of hits, whatever became of them."""
        return len(self._hits)

    @property
    def labels(self) -> tuple[HitLabel, ...]:
        """Of all hits, in the order of arrival."""
        return tuple(hit.label for hit in self._hits)

    @property
    def contact_time_spread(self) -> float:
        """Standard deviation of tau_p over the hits in the mean [s]; NaN: fewer than two."""
        times = self._copy_figures()[self._list_kept(), 0]
        return float(np.std(times, ddof=1)) if times.size > 1 else math.nan

    @property
    def overruled(self) -> tuple[JudgedHit, ...]:
        """Hits in the mean by hand, with all that is against them."""
        return tuple(self._complete(self._hits[self._rows[number]]) for number in self._by_hand)

    def describe_findings(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Say what was corrected in the hits in the mean, and what could not be told."""
        kept = len(self._rows) - len(self._left_out.numbers)
        found: dict[Reason, dict[int, str]] = {}
        for number in sorted(self._findings.keys() - self._left_out.numbers):
            for item in self._findings[number]:
                found.setdefault(item.reason, {})[number] = item.explanation
        corrected: list[str] = []
        doubtful: list[str] = []
        for reason, texts in found.items():
            is_doubt = reason in DOUBTS
            what = "in" if is_doubt else "corrected in"
            last = texts[max(texts)]
            (doubtful if is_doubt else corrected).append(
                f"{reason.value} {what} {len(texts)} of {kept} hits, in the last: {last}"
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
        if filtered is None or not self._sum.summary.count:
            return hit
        turned = _find_turned(filtered, self._sum)
        if not turned:
            return hit
        names = " and ".join(CHANNELS[channel] for channel in turned)
        why = f"{names} of the other sign than in the hits before"
        if not turns:
            why += "; --polarity auto turns them"
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
        """Compare an accepted hit with all accepted hits so far, and itself.

        Returns
        -------
        tuple of Rejection
            One for each quantity in which the hit is an outlier.
        """
        figures = read_figures(hit)
        return explain_outlier(figures, self._sorted.compute_criteria_with(figures))

    def add(self, hit: JudgedHit) -> None:
        """Take in a hit with its verdict; one accepted by hand stays in the mean.

        Raises
        ------
        FileError
            If there is no room for its traces.
        """
        if not hit.accepted or hit.filtered is None:
            self._hits.append(replace(hit, filtered=None))
            return
        number, figures, traces = (
            len(self._rows),
            read_figures(hit),
            shift_hit(hit.filtered, hit.label),
        )
        self._traces.append(traces)
        self._mean = None
        self._hits.append(replace(hit, filtered=None))
        self._rows.append(len(self._hits) - 1)
        self._figures.extend(figures)
        if hit.findings:
            self._findings[number] = hit.findings
        if hit.overruled:
            self._by_hand.append(number)
        else:
            self._sorted.add(number, figures)
            self._consistent.add(number, figures)
        before, now = self._left_out.numbers, self._choose()
        if now == before:
            self._sum = self._sum.add(traces)
        elif now != before | {number}:
            self._sum_up()

    def compute_mean(self) -> MeanHit | None:
        """Return the mean hit; None: there is none in it.

        Raises
        ------
        SignalError
            If the hits do not belong together.
        """
        if self._mean is None and self._sum.summary.count:
            kept = self._list_kept()
            # Every one, every other, every fourth ...: a new hit seldom changes the others.
            step = 1 << max(math.ceil(kept.size / SCATTER_HITS) - 1, 0).bit_length()
            shown = [self._traces.read(number) for number in kept[::step].tolist()]
            self._mean = self._sum.make_mean(shown)
        return self._mean

    def select(self) -> Selection:
        """Return which hits are in the mean as things stand, and why others are not."""
        final = dict(enumerate(self._hits))
        left_out = {row for row, hit in final.items() if not hit.accepted}
        for number in self._by_hand:
            row = self._rows[number]
            final[row] = self._complete(final[row])
        for number in self._left_out.numbers:
            row = self._rows[number]
            final[row] = replace(final[row], rejections=self._explain(number))
            left_out.add(row)
        return Selection(
            kept=tuple(hit for row, hit in final.items() if row not in left_out),
            left_out=tuple(hit for row, hit in final.items() if row in left_out),
        )

    def _explain(self, number: int) -> tuple[Rejection, ...]:
        """Return why an accepted hit is left out."""
        if number in self._left_out.outliers:
            return explain_outlier(self._copy_figures()[number].tolist(), self._criteria)
        count = len(self._rows) - len(self._left_out.outliers)
        why = f"not among the {self._keep} most consistent of {count}"
        return (Rejection(Reason.SURPLUS, why),)

    def _complete(self, hit: JudgedHit) -> JudgedHit:
        """Return a hit accepted by hand with what the others have against it, once."""
        if any(rejection.reason is Reason.INCONSISTENT for rejection in hit.overruled):
            return hit
        return replace(hit, overruled=(*self.check(hit), *hit.overruled))

    def _copy_figures(self) -> FloatArray:
        """Return the figures of all accepted hits, shape (hits, quantities)."""
        return np.array(self._figures).reshape(-1, len(QUANTITIES))

    def _list_kept(self) -> Numbers:
        """Return the numbers of the hits in the mean, ascending."""
        return self._list_without(self._left_out.numbers)

    def _list_without(self, numbers: Collection[int]) -> Numbers:
        return np.delete(np.arange(len(self._rows)), list(numbers))

    def _choose(self) -> frozenset[int]:
        """Leave out the outliers, then all but the most consistent; return whom."""
        self._criteria = self._sorted.compute_criteria()
        outliers = self._sorted.find_outliers(self._criteria)
        surplus = self._choose_surplus(outliers) if self._keep else frozenset()
        self._left_out = _LeftOut(outliers, surplus)
        return self._left_out.numbers

    def _choose_surplus(self, outliers: frozenset[int]) -> frozenset[int]:
        before, figures = self._left_out.outliers, self._copy_figures()
        for number in outliers - before:
            self._consistent.remove(number, figures[number].tolist())
        for number in before - outliers:
            self._consistent.add(number, figures[number].tolist())
        candidates = self._list_without({*outliers, *self._by_hand})
        wanted = max(self._keep - len(self._by_hand), 0)
        # Of equal ones the earlier stay.
        order = np.argsort(self._consistent.compute_distances(figures[candidates]), kind="stable")
        return frozenset(candidates[order[wanted:]].tolist())

    def _sum_up(self) -> None:
        """Sum up the hits in the mean anew."""
        self._sum = HitSum()
        for number in self._list_kept().tolist():
            self._sum = self._sum.add(self._traces.read(number))


def _find_turned(hit: FilteredHit, before: HitSum) -> list[int]:
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
