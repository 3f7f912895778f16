"""Mean traces of one sample: accepted hits aligned on the middle of the hammer pulse."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impact_rig.core.errors import NotDeterminedError, SignalError
from impact_rig.core.hit import FilteredHit
from impact_rig.core.record import FloatArray, make_read_only


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
    count : int
        Hits in the mean.
    """

    traces: FloatArray
    sampling_rate: float
    origin: int
    noise: FloatArray
    count: int


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
    variance = np.sum([hit.noise**2 for hit in hits], axis=0)
    return MeanHit(
        traces=make_read_only(total / len(hits)),
        sampling_rate=rates.pop(),
        origin=before,
        noise=make_read_only(np.sqrt(variance) / len(hits)),
        count=len(hits),
    )
