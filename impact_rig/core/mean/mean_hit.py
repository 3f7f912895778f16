"""The mean of many hits, and the momenta in it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.given.filtering import Chain
from impact_rig.core.given.records import FloatArray, make_read_only
from impact_rig.core.hit.judging import FilteredHit
from impact_rig.core.hit.momenta import Passage, find_contact, follow_momentum, restore_traces
from impact_rig.core.hit.pulse_width import measure_pulse


@dataclass(frozen=True)
class MeanHit:
    """The mean of aligned hits; accelerations are in m/s^2."""

    traces: FloatArray  # (channels, n): hammer, then sample where measured; read-only
    sampling_rate: float  # [Hz]
    origin: int  # point at which the middles of the hammer's pulses lie
    noise: FloatArray  # (channels,), standard deviation of the mean's noise, by the baselines
    raw_noise: FloatArray  # the same before the low-pass, of white noise
    hits: tuple[FilteredHit, ...]  # that show the scatter: all, or some of a long series
    count: int  # hits in the mean
    baseline_points: int  # of the mean's baseline, 1 or more
    # Of all hits, of shape (channels,).
    least_noise: FloatArray  # the smallest standard deviation of a raw baseline
    largest_step: FloatArray  # the largest acceleration of one count; 0: not known
    square_steps: FloatArray  # sum of the squares of these accelerations
    zero_uncertainty: FloatArray  # (2,), of the zeros under the pulse by corrections, standard

    def compute_raw_noise(self) -> FloatArray:
        """Return the mean's raw noise [m/s^2], at least that of the converters' steps, (2,)."""
        steps = np.sqrt(self.square_steps / 12.0)
        return np.asarray(np.maximum(self.raw_noise, steps / self.count))

    @property
    def impact_speeds(self) -> FloatArray:
        """Measured at each of `hits` [m/s], shape (hits,): their mean where one was missed.

        Empty: at none.
        """
        speeds = np.array([hit.impact_speed.value for hit in self.hits])
        known = speeds[np.isfinite(speeds)]
        return np.where(np.isfinite(speeds), speeds, known.mean()) if known.size else known

    @property
    def impact_speed_uncertainty(self) -> float:
        """Standard uncertainty that the measured speeds have in common [m/s]."""
        return float(np.nanmax([hit.impact_speed.standard for hit in self.hits]))

    def cut_hits(self) -> Iterator[FloatArray]:
        """Yield each of `hits` over the mean's window, of shape (channels, n), as it is kept."""
        for hit in self.hits:
            first = hit.origin - self.origin
            yield hit.traces[:, first : first + self.traces.shape[1]]

    def read_hits(self, channel: int, points: slice | list[int]) -> FloatArray:
        """Return some points of the mean's window of each of `hits`, shape (hits, points)."""
        return np.array([cut[channel, points] for cut in self.cut_hits()], np.float64)


@dataclass(frozen=True)
class TraceSum:
    """The sum of shifted traces, as long as what all have in common."""

    traces: FloatArray  # (channels, n) [m/s^2]
    origin: int  # point at which the middles of the pulses lie

    @classmethod
    def of(cls, hits: "Sequence[FilteredHit | TraceSum]") -> Self:
        """Return the sum of shifted hits, or of their sums, one or more."""
        first = cls(hits[0].traces.astype(np.float64), hits[0].origin)
        return reduce(cls.add, hits[1:], first)

    def add(self, other: "FilteredHit | TraceSum") -> Self:
        """Return the sum with one more hit, or with those of another sum."""
        origin = min(self.origin, other.origin)
        after = min(self.traces.shape[1] - self.origin, other.traces.shape[1] - other.origin)
        total = (
            self.traces[:, self.origin - origin : self.origin + after]
            + other.traces[:, other.origin - origin : other.origin + after]
        )
        return type(self)(total, origin)


def shift_hit(hit: FilteredHit) -> FilteredHit:
    """Shift a hit so that its pulse's middle falls onto a point; its traces become float32."""
    traces, origin = hit.align()
    return _shorten(replace(hit, traces=traces, origin=origin))


def _shorten(hit: FilteredHit) -> FilteredHit:
    traces: NDArray[Any] = hit.traces.astype(np.float32)
    traces.setflags(write=False)
    return replace(hit, traces=traces)


def read_levels(hit: FilteredHit) -> FloatArray:
    """Return what a mean needs of the levels of a shifted hit, as one row for `make_mean`."""
    baseline_points = hit.baseline_points - hit.origin
    levels = hit.noise, hit.raw_noise, hit.resolution, np.abs(hit.zero_uncertainty)
    return np.concatenate((*levels, [baseline_points]))


def make_mean(
    total: TraceSum,
    shown: Sequence[FilteredHit],
    levels: FloatArray | None = None,
    alone: FilteredHit | None = None,
) -> MeanHit:
    """Return the mean of shifted hits.

    The only hit in a mean may be given as it was before the shift, which would cost some of a
    coarse pulse's peak.

    Parameters
    ----------
    shown : sequence of FilteredHit
        Those that show the scatter.
    levels : ndarray, shape (hits, levels), optional
        By `read_levels`, of all hits in the mean; None: all are shown.
    """
    if levels is None:
        levels = np.stack([read_levels(hit) for hit in shown])
    count, channels = len(levels), len(total.traces)
    noise, raw_noise, steps = np.split(levels[:, : 3 * channels], 3, axis=1)
    traces = total.traces / count
    if alone is not None:
        traces, shown = alone.traces, (replace(_shorten(alone), origin=total.origin),)
    return MeanHit(
        traces=make_read_only(traces),
        sampling_rate=shown[0].sampling_rate,
        origin=total.origin,
        noise=make_read_only(np.sqrt(np.square(noise).sum(axis=0)) / count),
        raw_noise=make_read_only(np.sqrt(np.square(raw_noise).sum(axis=0)) / count),
        hits=tuple(shown),
        count=count,
        baseline_points=max(int(levels[:, -1].min()) + total.origin, 1),
        least_noise=raw_noise.min(axis=0),
        largest_step=steps.max(axis=0),
        square_steps=np.square(steps).sum(axis=0),
        # They are alike in all hits.
        zero_uncertainty=levels[:, -3:-1].sum(axis=0) / count,
    )


def follow_mean(
    mean: MeanHit, chains: tuple[Chain, Chain]
) -> tuple[MeanHit, slice, Passage] | None:
    """Follow a mean hit's momentum; return its restored levels and its contact, too.

    None: the record does not hold all of the pulse.
    """
    contact = find_contact(mean.traces[0], measure_pulse(mean.traces[0]), chains[0])
    if contact is None:
        return None
    if any(chain.response.low_corner for chain in chains):
        hits = tuple(replace(hit, traces=restore_traces(hit.traces, chains)) for hit in mean.hits)
        mean = replace(mean, traces=restore_traces(mean.traces, chains), hits=hits)
    return mean, contact, follow_momentum(mean.traces, contact, mean.sampling_rate)
