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
        """Yield each of `hits` over the mean's window, of shape (channels, n)."""
        for hit in self.hits:
            first = hit.origin - self.origin
            yield hit.traces[:, first : first + self.traces.shape[1]].astype(np.float64)


@dataclass(frozen=True)
class TraceSum:
    """The sum of shifted traces, as long as what all have in common."""

    total: FloatArray  # (channels, n) [m/s^2]
    origin: int  # point at which the middles of the pulses lie

    def add(self, hit: FilteredHit) -> Self:
        """Return the sum with one more hit."""
        origin = min(self.origin, hit.origin)
        after = min(self.total.shape[1] - self.origin, hit.traces.shape[1] - hit.origin)
        total = (
            self.total[:, self.origin - origin : self.origin + after]
            + hit.traces[:, hit.origin - origin : hit.origin + after]
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


def sum_up(hits: Sequence[FilteredHit]) -> TraceSum | None:
    """Return the sum of shifted hits; None: there is none."""
    if not hits:
        return None
    first = TraceSum(hits[0].traces.astype(np.float64), hits[0].origin)
    return reduce(TraceSum.add, hits[1:], first)


def make_mean(
    total: TraceSum, hits: Sequence[FilteredHit], step: int = 1, alone: FilteredHit | None = None
) -> MeanHit:
    """Return the mean of shifted hits, of which every `step`-th shows the scatter.

    The only hit in a mean may be given as it was before the shift, which would cost some of a
    coarse pulse's peak.
    """
    count = len(hits)
    traces, shown = total.total / count, tuple(hits[::step])
    if alone is not None:
        traces = alone.traces
        shown = (replace(_shorten(alone), origin=total.origin),)
    noise, raw_noise = (
        np.sqrt(np.square(levels).sum(axis=0)) / count
        for levels in ([hit.noise for hit in hits], [hit.raw_noise for hit in hits])
    )
    steps = np.stack([hit.resolution for hit in hits])
    baseline_points = min(hit.baseline_points - hit.origin for hit in hits) + total.origin
    return MeanHit(
        traces=make_read_only(traces),
        sampling_rate=hits[0].sampling_rate,
        origin=total.origin,
        noise=make_read_only(noise),
        raw_noise=make_read_only(raw_noise),
        hits=shown,
        count=count,
        baseline_points=max(baseline_points, 1),
        least_noise=np.min([hit.raw_noise for hit in hits], axis=0),
        largest_step=steps.max(axis=0),
        square_steps=np.square(steps).sum(axis=0),
        # They are alike in all hits.
        zero_uncertainty=np.abs([hit.zero_uncertainty for hit in hits]).sum(axis=0) / count,
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
