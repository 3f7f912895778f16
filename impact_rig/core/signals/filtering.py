"""The zero-phase low-pass, the same for measurement and model."""

from functools import lru_cache

import numpy as np
from scipy.signal import butter, sosfiltfilt

from impact_rig.core.checks import check_not_negative, check_positive
from impact_rig.core.errors import ParameterError, SignalError
from impact_rig.core.signals.record import FloatArray

FILTER_ORDER = 2
"""Butterworth order of one pass [-], our choice: with the pass back the roll-off is 24 dB per
octave, and a pulse is left without visible ringing."""
HIGHEST_RELATIVE_CUTOFF = 0.4
"""Highest cutoff over the sampling rate [-], our choice: nearer to one half the design's
bilinear transform bends the roll-off."""
MINIMUM_POINTS = 16
"""Shortest trace that can be filtered [-]: longer than the filter's padding."""


@lru_cache(maxsize=16)
def _design_sections(cutoff_frequency: float, sampling_rate: float) -> FloatArray:
    # Two passes of order n have -3 dB where one has -1.5 dB: at (sqrt(2) - 1)^(1 / 2n).
    one_pass = cutoff_frequency / (np.sqrt(2.0) - 1.0) ** (1.0 / (2 * FILTER_ORDER))
    sections: FloatArray = butter(FILTER_ORDER, one_pass, fs=sampling_rate, output="sos")
    return sections


def check_cutoff(cutoff_frequency: float, sampling_rate: float) -> None:
    """Require a sampling rate [Hz] that the low-pass of `cutoff_frequency` [Hz] can work at.

    Raises
    ------
    ParameterError
        If the sampling rate is too low.
    """
    check_not_negative("cutoff frequency", cutoff_frequency, "Hz")
    check_positive("sampling rate", sampling_rate, "Hz")
    if cutoff_frequency > HIGHEST_RELATIVE_CUTOFF * sampling_rate:
        raise ParameterError(
            f"a sampling rate of {sampling_rate / 1e3:g} kHz is too low for the"
            f" {cutoff_frequency / 1e3:g} kHz low-pass: sample at"
            f" {cutoff_frequency / HIGHEST_RELATIVE_CUTOFF / 1e3:g} kHz or more, set a cutoff of"
            f" {HIGHEST_RELATIVE_CUTOFF * sampling_rate / 1e3:g} kHz or less, or switch it off"
        )


def low_pass(traces: FloatArray, cutoff_frequency: float, sampling_rate: float) -> FloatArray:
    """Filter traces forwards and backwards by a Butterworth low-pass.

    Parameters
    ----------
    traces : ndarray, shape (..., n)
        Along the last axis.
    cutoff_frequency : float
        -3 dB of both passes together [Hz]; 0: no filter.
    sampling_rate : float
        [Hz]

    Returns
    -------
    ndarray, shape (..., n)

    Raises
    ------
    ParameterError
        If the sampling rate is too low for the cutoff.
    SignalError
        If the traces are too short.
    """
    check_cutoff(cutoff_frequency, sampling_rate)
    if cutoff_frequency == 0.0:
        return np.array(traces, dtype=np.float64)
    count = np.shape(traces)[-1]
    if count < MINIMUM_POINTS:
        raise SignalError(
            f"a trace of {count} points is too short for the low-pass: it needs {MINIMUM_POINTS}"
        )
    sections = _design_sections(float(cutoff_frequency), float(sampling_rate))
    # Mirrored, since odd padding would pin both ends to single, unfiltered points; and by a few
    # time constants, since the default is a few points whatever the cutoff.
    padding = min(count - 1, int(3 * sampling_rate / cutoff_frequency))
    filtered: FloatArray = sosfiltfilt(sections, traces, axis=-1, padtype="even", padlen=padding)
    return filtered
