"""Mean traces of one sample: accepted hits aligned on the middle of the hammer pulse.

Hits are added to a sum as they come, in single precision of their own scale: at full scale that is
finer than the steps of any converter.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.errors import NotDeterminedError, SignalError
from impact_rig.core.hits.hit import FilteredHit
from impact_rig.core.hits.pulse_width import PulseWidth
from impact_rig.core.signals.record import FloatArray, HitLabel, make_read_only


@dataclass(frozen=True)
class AveragedHit:
    """One hit as it is averaged.

    Attributes
    ----------
    scaled : ndarray of float32, shape (channels, n)
        Hammer, then sample where measured, shifted so that the middle of the hammer pulse falls
        onto a point [`scale`].
    scale : float
        A power of two, so that nothing is rounded by it [m/s^2].
    origin : int
        That point.
    sampling_rate : float
        [Hz]
    pulse : PulseWidth
        Of the hammer.
    noise, raw_noise, resolution : tuple of float
        As in `FilteredHit`, one for each channel [m/s^2].
    baseline_points : int
        Points of the baseline that was removed.
    zero_uncertainty : float
        As in `FilteredHit` [m/s^2].
    label : HitLabel or None
        Which hit it is.
    """

    scaled: NDArray[np.float32]
    scale: float
    origin: int
    sampling_rate: float
    pulse: PulseWidth
    noise: tuple[float, ...]
    raw_noise: tuple[float, ...]
    resolution: tuple[float, ...]
    baseline_points: int
    zero_uncertainty: float = 0.0
    label: HitLabel | None = None

    @property
    def traces(self) -> FloatArray:
        """All of them [m/s^2]."""
        return self.scale * self.scaled.astype(np.float64)


def shift_hit(hit: FilteredHit, label: HitLabel | None = None) -> AveragedHit:
    """Shift a hit by a part of a point, so that its pulse's middle falls onto one."""
    traces, origin = hit.aligned
    scale = 2.0 ** math.frexp(hit.pulse.peak)[1]
    scaled = (traces / scale).astype(np.float32)
    scaled.setflags(write=False)
    return AveragedHit(
        scaled=scaled,
        scale=scale,
        origin=origin,
        sampling_rate=hit.sampling_rate,
        pulse=hit.pulse,
        noise=tuple(hit.noise.tolist()),
        raw_noise=tuple(hit.raw_noise.tolist()),
        resolution=tuple(hit.resolution.tolist()),
        baseline_points=hit.baseline_points,
        zero_uncertainty=hit.zero_uncertainty,
        label=label,
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
    zero_uncertainty : float
        Sum of the uncertainties of the hammer's zero under the pulse, alike in all [m/s^2].
    """

    count: int = 0
    least_noise: FloatArray = field(default_factory=lambda: np.array(np.inf))
    largest_step: FloatArray = field(default_factory=lambda: np.array(0.0))
    square_steps: FloatArray = field(default_factory=lambda: np.array(0.0))
    baseline_points: float = math.inf
    zero_uncertainty: float = 0.0

    def add(self, hit: AveragedHit) -> Self:
        """Return the summary with one more hit."""
        return type(self)(
            count=self.count + 1,
            least_noise=np.minimum(self.least_noise, hit.raw_noise),
            largest_step=np.maximum(self.largest_step, hit.resolution),
            square_steps=self.square_steps + np.square(hit.resolution),
            baseline_points=min(self.baseline_points, hit.baseline_points - hit.origin),
            zero_uncertainty=self.zero_uncertainty + abs(hit.zero_uncertainty),
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
        Hits in the mean that show the scatter, in the order of arrival: all of them, or some that
        lie evenly over a long series.
    summary : HitSummary
        What all hits in the mean have in common.
    """

    traces: FloatArray
    sampling_rate: float
    origin: int
    noise: FloatArray
    raw_noise: FloatArray
    hits: tuple[AveragedHit, ...]
    summary: HitSummary = field(default_factory=HitSummary)

    @property
    def count(self) -> int:
        """Hits in the mean."""
        return self.summary.count

    @property
    def baseline_points(self) -> int:
        """Points of the mean's baseline, 1 or more."""
        return max(int(self.summary.baseline_points) + self.origin, 1)

    @property
    def zero_uncertainty(self) -> float:
        """Standard uncertainty of the hammer's zero under the pulse by corrections [m/s^2]."""
        return self.summary.zero_uncertainty / self.count

    def cut_hits(self) -> Iterator[FloatArray]:
        """Yield each of `hits` over the mean's window, of shape (channels, n)."""
        for hit in self.hits:
            first = hit.origin - self.origin
            yield hit.traces[:, first : first + self.traces.shape[1]]


@dataclass(frozen=True)
class HitSum:
    """The sum of aligned hits.

    That hits do not belong together is said when their mean is asked for.

    Attributes
    ----------
    summary : HitSummary
        What all hits in the sum have in common.
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

    summary: HitSummary = field(default_factory=HitSummary)
    total: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    origin: int = 0
    variance: FloatArray = field(default_factory=lambda: np.zeros(1))
    raw_variance: FloatArray = field(default_factory=lambda: np.zeros(1))
    rates: frozenset[float] = frozenset()
    channels: frozenset[int] = frozenset()

    def add(self, hit: AveragedHit) -> Self:
        """Return the sum with one more hit."""
        if not self.summary.count:
            total, origin = hit.traces, hit.origin
        elif hit.scaled.shape[0] != self.total.shape[0]:
            total, origin = self.total, self.origin
        else:
            origin = min(self.origin, hit.origin)
            after = min(self.total.shape[1] - self.origin, hit.scaled.shape[1] - hit.origin)
            total = (
                self.total[:, self.origin - origin : self.origin + after]
                + hit.traces[:, hit.origin - origin : hit.origin + after]
            )
        return replace(
            self,
            summary=self.summary.add(hit),
            total=total,
            origin=origin,
            variance=self.variance + np.square(hit.noise),
            raw_variance=self.raw_variance + np.square(hit.raw_noise),
            rates=self.rates | {hit.sampling_rate},
            channels=self.channels | {hit.scaled.shape[0]},
        )

    def make_mean(self, hits: Sequence[AveragedHit]) -> MeanHit:
        """Return the mean, its scatter shown by `hits`, in the order of arrival.

        Raises
        ------
        NotDeterminedError
            If there is no hit.
        SignalError
            If the hits do not belong together.
        """
        count = self.summary.count
        if not count:
            raise NotDeterminedError("mean trace: no hit was accepted")
        if len(self.rates) > 1 or len(self.channels) > 1:
            raise SignalError(
                f"hits sampled at {sorted(self.rates)} Hz with {sorted(self.channels)} channels"
                " cannot be averaged: all hits of a sample need the same"
            )
        return MeanHit(
            traces=make_read_only(self.total / count),
            sampling_rate=next(iter(self.rates)),
            origin=self.origin,
            noise=make_read_only(np.sqrt(self.variance) / count),
            raw_noise=make_read_only(np.sqrt(self.raw_variance) / count),
            hits=tuple(hits),
            summary=self.summary,
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
