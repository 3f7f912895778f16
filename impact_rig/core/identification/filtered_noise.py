"""What the low-pass leaves of the noise of a mean hit."""

import math
from functools import lru_cache

import numpy as np

from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.signals.filtering import low_pass
from impact_rig.core.signals.record import FloatArray, make_read_only

CORRELATION_REACH = 5.0
"""How far filtered noise is correlated, over 1 / cutoff [-]: beyond, less than e^-20 is left."""


def find_raw_noise(mean: MeanHit) -> FloatArray:
    """Return the mean's raw noise [m/s^2], at least that of the converters' steps, shape (2,)."""
    if not mean.count:
        return np.asarray(mean.raw_noise)
    steps = np.sqrt(mean.summary.square_steps / 12.0)
    return np.asarray(np.maximum(mean.raw_noise, steps / mean.count))


@lru_cache(maxsize=16)
def find_noise_correlation(
    cutoff_frequency: float, sampling_rate: float, step: int = 1
) -> FloatArray:
    """Compute what the low-pass makes of white noise of 1.

    Parameters
    ----------
    cutoff_frequency, sampling_rate : float
        Of the low-pass [Hz].
    step : int
        Points between those that are looked at.

    Returns
    -------
    ndarray, shape (2 k + 1,)
        Autocovariance from -k to k steps, its variance in the middle [-]; read-only.
    """
    if cutoff_frequency == 0.0:
        return make_read_only(np.ones(1))
    reach = math.ceil(CORRELATION_REACH * sampling_rate / cutoff_frequency)
    impulse = np.zeros(4 * reach + 1)
    impulse[2 * reach] = 1.0
    # The low-pass is symmetric in time, so that its autocorrelation is to apply it twice.
    for _ in range(2):
        impulse = low_pass(impulse, cutoff_frequency, sampling_rate)
    most = reach // step * step
    return make_read_only(impulse[2 * reach - most : 2 * reach + most + 1 : step])
