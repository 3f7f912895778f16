"""Mean traces of one sample: accepted hits aligned on the middle of the hammer pulse."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impact_rig.core.errors import NotDeterminedError, SignalError
from impact_rig.core.hits.hit import FilteredHit
from impact_rig.core.signals.record import FloatArray, make_read_only


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
    hits : tuple of FilteredHit
        In the mean, in the order of arrival.
    """

    traces: FloatArray
    sampling_rate: float
    origin: int
    noise: FloatArray
    raw_noise: FloatArray
    hits: tuple[FilteredHit, ...]

    @property
    def count(self) -> int:
        """Hits in the mean."""
        return len(self.hits)

    def cut_hit(self, index: int) -> FloatArray:
        """Return the aligned traces of one hit over the mean's window, shape (channels, n)."""
        traces, origin = self.hits[index].aligned
        first = origin - self.origin
        return traces[:, first : first + self.traces.shape[1]]


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
    if not hits:
        raise NotDeterminedError("mean trace: no hit was accepted")
    rates = {hit.sampling_rate for hit in hits}
    channels = {hit.traces.shape[0] for hit in hits}
    if len(rates) > 1 or len(channels) > 1:
        raise SignalError(
            f"hits sampled at {sorted(rates)} Hz with {sorted(channels)} channels cannot be"
            " averaged: all hits of a sample need the same"
        )
    aligned = [hit.aligned for hit in hits]
    before = min(origin for _, origin in aligned)
    after = min(traces.shape[1] - origin for traces, origin in aligned)
    total = np.zeros((channels.pop(), before + after))
    for traces, origin in aligned:
        total += traces[:, origin - before : origin + after]
    return MeanHit(
        traces=make_read_only(total / len(hits)),
        sampling_rate=rates.pop(),
        origin=before,
        noise=make_read_only(_average_noise([hit.noise for hit in hits])),
        raw_noise=make_read_only(_average_noise([hit.raw_noise for hit in hits])),
        hits=tuple(hits),
    )


def _average_noise(noises: Sequence[FloatArray]) -> FloatArray:
    return np.asarray(np.sqrt(np.sum(np.square(noises), axis=0)) / len(noises))
