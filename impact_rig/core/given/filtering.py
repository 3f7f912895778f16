"""The way from a motion to a trace: sensor, converter, low-pass."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy

from impact_rig.core.given.errors import (
    ParameterError,
    check_between,
    check_not_negative,
    check_positive,
)
from impact_rig.core.given.records import FloatArray, make_read_only
from impact_rig.core.given.sensors import FLAT, SensorResponse


def interpolate_between(traces: FloatArray, fraction: float) -> FloatArray:
    """Return what lies by a part of a point behind every point but the last.

    By cubic splines on equidistant points: since the part is the same everywhere, four
    coefficients stand with the same weights behind every value. At the ends the traces are taken
    as mirrored, which reaches some ten points inside.

    Parameters
    ----------
    traces : ndarray, shape (..., n)
        Along the last axis; two points or more.
    fraction : float
        0 to 1 [points].

    Returns
    -------
    ndarray, shape (..., n - 1)

    Raises
    ------
    ParameterError
        If the part is not between 0 and 1.
    """
    check_between("part of a point", fraction, 0.0, 1.0)
    spline = scipy.ndimage.spline_filter1d(traces, order=3, axis=-1, mode="mirror")
    spline = np.concatenate((spline[..., 1:2], spline, spline[..., -2:-1]), axis=-1)
    rest = 1.0 - fraction
    # Cubic B-splines, at two points on either side.
    weights = (
        rest**3 / 6.0,
        2.0 / 3.0 - fraction**2 * (1.0 - fraction / 2.0),
        2.0 / 3.0 - rest**2 * (1.0 - rest / 2.0),
        fraction**3 / 6.0,
    )
    count = spline.shape[-1] - 3
    between = weights[0] * spline[..., :count]
    for place, weight in enumerate(weights[1:], start=1):
        between += weight * spline[..., place : place + count]
    return np.asarray(between)


HIGHEST_RELATIVE_CUTOFF = 0.4
"""Highest cutoff over the sampling rate [-], our choice: nearer to one half the design's
bilinear transform bends the roll-off."""


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
    """Filter traces by a Butterworth low-pass of order 2, forwards and backwards.

    That takes no time and leaves a pulse without visible ringing; the roll-off is 24 dB per
    octave. At the ends the traces are taken as mirrored, which is what a cosine transform does.

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
    """
    check_cutoff(cutoff_frequency, sampling_rate)
    traces = np.array(traces, dtype=np.float64)
    if cutoff_frequency == 0.0:
        return traces
    count = traces.shape[-1]
    # Other lengths take up to ten times as long.
    size = scipy.fft.next_fast_len(count, real=True)
    mirrored = np.concatenate((traces, traces[..., ::-1][..., : size - count]), axis=-1)
    gain = _compute_gain(float(cutoff_frequency / sampling_rate), size)
    filtered = scipy.fft.idct(scipy.fft.dct(mirrored) * gain)
    return np.ascontiguousarray(filtered[..., :count])


@lru_cache(maxsize=8)
def _compute_gain(relative_cutoff: float, count: int) -> FloatArray:
    """Return the low-pass's gain at each frequency of a cosine transform, shape (count,)."""
    # Two passes of order n have -3 dB where one has -1.5 dB: at (sqrt(2) - 1)^(1 / 2n).
    one_pass = relative_cutoff / (np.sqrt(2.0) - 1.0) ** (1.0 / 4.0)
    frequency = np.arange(count) / (2.0 * count)
    # The bilinear transform of the filter, as digital filters are designed.
    ratio = np.tan(np.pi * frequency) / np.tan(np.pi * one_pass)
    return make_read_only(1.0 / (1.0 + ratio**4))


def respond(traces: FloatArray, response: SensorResponse, sampling_rate: float) -> FloatArray:
    """Return a sensor's answer to accelerations that were zero before their first point.

    Parameters
    ----------
    traces : ndarray, shape (..., n)
        Along the last axis.
    sampling_rate : float
        [Hz]

    Returns
    -------
    ndarray, shape (..., n)
    """
    if response.is_flat:
        return traces
    numerator, denominator = _design(response.scale(1.0 / sampling_rate))
    return np.asarray(scipy.signal.lfilter(numerator, denominator, traces, axis=-1))


@lru_cache(maxsize=16)
def _design(response: SensorResponse) -> tuple[FloatArray, FloatArray]:
    """Return the coefficients of the filter, its frequencies over the sampling rate."""
    natural, low, high = (
        2.0 * math.pi * frequency
        for frequency in (response.resonance, response.low_corner, response.upper_corner)
    )
    numerator, denominator = np.ones(1), np.ones(1)
    if natural:
        numerator = numerator * natural**2
        denominator = np.array([1.0, 2.0 * response.damping * natural, natural**2])
    if low:
        numerator = np.append(numerator, 0.0)
        denominator = np.convolve(denominator, [1.0, low])
    if high:
        numerator = numerator * high
        denominator = np.convolve(denominator, [1.0, high])
    discrete = scipy.signal.cont2discrete((numerator, denominator), 1.0, "foh")
    return make_read_only(np.ravel(discrete[0])), make_read_only(np.ravel(discrete[1]))


def restore_level(traces: FloatArray, low_corner: float, sampling_rate: float) -> FloatArray:
    """Return traces, shape (..., n), zero before their first point, without the high-pass."""
    if not low_corner:
        return traces
    integrate = scipy.integrate.cumulative_trapezoid
    lost = integrate(traces, dx=1.0 / sampling_rate, axis=-1, initial=0.0)
    return np.asarray(traces + 2.0 * math.pi * low_corner * lost)


@dataclass(frozen=True)
class Chain:
    """The response of a channel to a body's acceleration."""

    sampling_rate: float  # [Hz]
    cutoff_frequency: float = 0.0  # -3 dB of the zero-phase low-pass [Hz]; 0: none
    response: SensorResponse = FLAT

    def count_points(self, step: int = 1) -> "Chain":
        """Return it with every `step`-th point as the unit of time."""
        factor = step / self.sampling_rate
        return Chain(1.0, self.cutoff_frequency * factor, self.response.scale(factor))

    def show(self, motion: FloatArray) -> FloatArray:
        """Return the traces of accelerations that were zero before, both of shape (..., n)."""
        shown = respond(motion, self.response, self.sampling_rate)
        return low_pass(shown, self.cutoff_frequency, self.sampling_rate)

    def correlate_noise(self, step: int = 1) -> FloatArray:
        """Return the autocovariance of white noise of 1 behind the low-pass, from -k to k steps.

        Shape (2 k + 1,); of every `step`-th point.
        """
        if not self.cutoff_frequency:
            return np.ones(1)
        relative_cutoff = self.cutoff_frequency / self.sampling_rate
        # Beyond, less than e^-20 of the correlation is left.
        reach = math.ceil(5.0 / relative_cutoff)
        impulse = np.zeros(4 * reach + 1)
        impulse[2 * reach] = 1.0
        # The low-pass is symmetric in time, so that its autocorrelation is to apply it twice.
        for _ in range(2):
            impulse = low_pass(impulse, relative_cutoff, 1.0)
        most = reach // step * step
        return impulse[2 * reach - most : 2 * reach + most + 1 : step]
