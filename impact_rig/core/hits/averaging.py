"""Mean traces of one sample: accepted hits aligned on the middle of the hammer pulse.

Hits are added to a sum as they come, in single precision: at full scale that is finer than the
steps of any converter. A mean needs nothing of its hits but this sum; those that are kept one by
one show the scatter, and can be left out again.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.errors import NotDeterminedError, SignalError
from impact_rig.core.hits.hit import FilteredHit
from impact_rig.core.hits.pulse_width import PulseWidth
from impact_rig.core.signals.record import FloatArray, make_read_only


@dataclass(frozen=True)
class AveragedHit:
    """One hit as it is averaged.

    Attributes
    ----------
    traces : ndarray of float32, shape (channels, n)
        Hammer, then sample where measured, shifted so that the middle of the hammer pulse falls
        onto a point [m/s^2].
    origin : int
        That point.
    sampling_rate : float
        [Hz]
    pulse : PulseWidth
        Of the hammer.
    noise, raw_noise, resolution : tuple of float
        As in `FilteredHit`, one for each channel [m/s^2]: of numpy's arrays, small ones that stay
        among large ones that come and go leave holes in the memory.
    baseline_points : int
        Points of the baseline that was removed.
    """

    traces: NDArray[np.float32]
    origin: int
    sampling_rate: float
    pulse: PulseWidth
    noise: tuple[float, ...]
    raw_noise: tuple[float, ...]
    resolution: tuple[float, ...]
    baseline_points: int


def shift_hit(hit: FilteredHit) -> AveragedHit:
    """Shift a hit by a part of a point, so that its pulse's middle falls onto one."""
    traces, origin = hit.aligned
    single = traces.astype(np.float32)
    single.setflags(write=False)
    return AveragedHit(
        traces=single,
        origin=origin,
        sampling_rate=hit.sampling_rate,
        pulse=hit.pulse,
        noise=tuple(hit.noise.tolist()),
        raw_noise=tuple(hit.raw_noise.tolist()),
        resolution=tuple(hit.resolution.tolist()),
        baseline_points=hit.baseline_points,
    )


@dataclass(frozen=True)
class HitSummary:
    """What hits have in common.

    Attributes
    ----------
    count : int
        Hits.
    least_noise : ndarray, shape (channels,)
        The smallest standard deviation of a raw baseline [m/s^2].
    largest_step : ndarray, shape (channels,)
        The largest acceleration of one count [m/s^2]; 0: not known.
    square_steps : ndarray, shape (channels,)
        Sum of the squares of these accelerations [m^2/s^4].
    baseline_points : float
        Points of the baseline that all hits have, counted from the origin: 0 ends there.
    """

    count: int
    least_noise: FloatArray
    largest_step: FloatArray
    square_steps: FloatArray
    baseline_points: float


NO_HITS = HitSummary(0, np.array(np.inf), np.array(0.0), np.array(0.0), np.inf)
"""What no hits have in common."""


def summarize_hits(hits: Sequence[AveragedHit], others: HitSummary = NO_HITS) -> HitSummary:
    """Return what hits have in common, with each other and with others before them."""
    if not hits:
        return others
    noise = np.array([hit.raw_noise for hit in hits])
    steps = np.array([hit.resolution for hit in hits])
    baseline = min(hit.baseline_points - hit.origin for hit in hits)
    return HitSummary(
        count=others.count + len(hits),
        least_noise=np.minimum(others.least_noise, noise.min(axis=0)),
        largest_step=np.maximum(others.largest_step, steps.max(axis=0)),
        square_steps=others.square_steps + np.square(steps).sum(axis=0),
        baseline_points=min(others.baseline_points, baseline),
    )


@dataclass(frozen=True)
class MeanHit:
    """The mean of aligned hits.

    Attributes
    ----------
    traces : ndarray, shape (channels, n)
        Hammer, then sample where measured [m/s^2]; read-only.
    sampling_rate : float
        [Hz]
    origin : int
        Point at which the hammer pulses' middles were laid.
    noise : ndarray, shape (channels,)
        Standard deviation of the mean's noise, from the baselines of the hits [m/s^2].
    raw_noise : ndarray, shape (channels,)
        The same before the low-pass: white noise of this size would do the same below the
        cutoff [m/s^2].
    hits : tuple of AveragedHit
        Those in the mean that are kept one by one, in the order of arrival: they show the
        scatter.
    settled : HitSummary
        What the others had in common.
    """

    traces: FloatArray
    sampling_rate: float
    origin: int
    noise: FloatArray
    raw_noise: FloatArray
    hits: tuple[AveragedHit, ...]
    settled: HitSummary = NO_HITS

    @property
    def count(self) -> int:
        """Hits in the mean, kept one by one or not."""
        return self.settled.count + len(self.hits)

    @cached_property
    def summary(self) -> HitSummary:
        """What all hits in the mean have in common."""
        return summarize_hits(self.hits, self.settled)

    @property
    def baseline_points(self) -> int:
        """Points of the mean's baseline, 1 or more."""
        return max(int(self.summary.baseline_points) + self.origin, 1)

    def cut_hit(self, index: int) -> NDArray[np.float32]:
        """Return one of `hits` over the mean's window, shape (channels, n)."""
        hit = self.hits[index]
        first = hit.origin - self.origin
        return hit.traces[:, first : first + self.traces.shape[1]]

    def cut_hits(self) -> list[NDArray[np.float32]]:
        """Return all of `hits` over the mean's window, each of shape (channels, n)."""
        return [self.cut_hit(index) for index in range(len(self.hits))]


@dataclass(frozen=True)
class HitSum:
    """The sum of aligned hits.

    That hits do not belong together is said when their mean is asked for.

    Attributes
    ----------
    count : int
        Hits in the sum.
    total : ndarray, shape (channels, n)
        Sum of their traces, as long as what all have in common [m/s^2].
    origin : int
        Point at which the middles of the pulses were laid.
    variance, raw_variance : ndarray, shape (channels,)
        Sums of the squares of `noise` and `raw_noise` [m^2/s^4].
    rates, channels : frozenset
        Sampling rates [Hz] and numbers of channels that hits have: one of each, or they do not
        belong together.
    """

    count: int = 0
    total: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    origin: int = 0
    variance: FloatArray = field(default_factory=lambda: np.zeros(1))
    raw_variance: FloatArray = field(default_factory=lambda: np.zeros(1))
    rates: frozenset[float] = frozenset()
    channels: frozenset[int] = frozenset()

    def add(self, hit: AveragedHit) -> Self:
        """Return the sum with one more hit."""
        if not self.count:
            total, origin = hit.traces.astype(np.float64), hit.origin
        elif hit.traces.shape[0] != self.total.shape[0]:
            total, origin = self.total, self.origin
        else:
            origin = min(self.origin, hit.origin)
            after = min(self.total.shape[1] - self.origin, hit.traces.shape[1] - hit.origin)
            total = (
                self.total[:, self.origin - origin : self.origin + after]
                + hit.traces[:, hit.origin - origin : hit.origin + after]
            )
        return replace(
            self,
            count=self.count + 1,
            total=total,
            origin=origin,
            variance=self.variance + np.square(hit.noise),
            raw_variance=self.raw_variance + np.square(hit.raw_noise),
            rates=self.rates | {hit.sampling_rate},
            channels=self.channels | {hit.traces.shape[0]},
        )

    def make_mean(self, hits: Sequence[AveragedHit], settled: HitSummary = NO_HITS) -> MeanHit:
        """Return the mean.

        Parameters
        ----------
        hits : sequence of AveragedHit
            Those in the sum that are kept one by one, in the order of arrival.
        settled : HitSummary
            Of all others.

        Raises
        ------
        NotDeterminedError
            If there is no hit.
        SignalError
            If the hits do not belong together.
        """
        if not self.count:
            raise NotDeterminedError("mean trace: no hit was accepted")
        if len(self.rates) > 1 or len(self.channels) > 1:
            raise SignalError(
                f"hits sampled at {sorted(self.rates)} Hz with {sorted(self.channels)} channels"
                " cannot be averaged: all hits of a sample need the same"
            )
        return MeanHit(
            traces=make_read_only(self.total / self.count),
            sampling_rate=next(iter(self.rates)),
            origin=self.origin,
            noise=make_read_only(np.sqrt(self.variance) / self.count),
            raw_noise=make_read_only(np.sqrt(self.raw_variance) / self.count),
            hits=tuple(hits),
            settled=settled,
        )


def average_hits(hits: Sequence[FilteredHit]) -> MeanHit:
    """Align hits on the midpoints of their half-amplitude crossings and average them.

    Parameters
    ----------
    hits : sequence of FilteredHit
        All at one sampling rate and with the same channels.

    Returns
    -------
    MeanHit
        As long as what all hits have in common.

    Raises
    ------
    NotDeterminedError
        If there is no hit.
    SignalError
        If the hits do not belong together.
    """
    total = HitSum()
    shifted = [shift_hit(hit) for hit in hits]
    for hit in shifted:
        total = total.add(hit)
    return total.make_mean(shifted)
