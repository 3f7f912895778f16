"""Model and measurement, compared as the paper does."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from impact_rig.core.estimates.model import ImpactModel, ModelVariant, simulate_impact
from impact_rig.core.given.errors import SignalError
from impact_rig.core.given.filtering import Chain, show_bodies
from impact_rig.core.given.records import FloatArray, make_read_only
from impact_rig.core.mean.mean_hit import MeanHit


@dataclass(frozen=True)
class TraceComparison:
    """One body's model trace laid onto its measured one."""

    measured: FloatArray  # normalised to their own peaks [-], the model shifted; read-only
    model: FloatArray
    peak: float  # by which the measured trace was divided, sign included [m/s^2]
    shift: float  # applied to the model, later is positive [s]
    # Mean square error over the record [%], as in Fig. 6. Forgiving: most of the record is quiet.
    mse_percent: float
    contact_error_percent: float  # RMS error over the contact alone [%]


@dataclass(frozen=True)
class ModelComparison:
    """Both bodies of one sample's mean hit against the model."""

    variant: ModelVariant  # which model
    sampling_rate: float  # [Hz]
    start_time: float  # time of the first point from the start of the contact [s]
    contact_time: float  # tau_p of the model [s]
    hammer: TraceComparison  # of the hammer
    specimen: TraceComparison  # of the sample


def find_extreme(trace: FloatArray) -> float:
    """Return the value of largest magnitude of a trace, shape (n,), sign included.

    Traces are divided by it, so that the comparison is blind to polarity, as it must be for
    equation (1), whose force on body 2 is printed with a minus.

    Raises
    ------
    SignalError
        If the trace is flat or not finite.
    """
    peak = float(trace[np.argmax(np.abs(trace))])
    if not np.isfinite(peak) or peak == 0.0:
        raise SignalError("a flat trace cannot be normalised: it has no peak")
    return peak


def find_best_shift(measured: FloatArray, model: FloatArray, largest: int) -> float:
    """Find the shift of `model` that makes the mean square error least.

    Parameters
    ----------
    measured, model : ndarray, shape (n,)
        Normalised; the model counts as zero beyond its ends.
    largest : int
        Largest shift either way [points].

    Returns
    -------
    float
        In points, later is positive, refined below one point by a parabola.
    """
    count = measured.size
    largest = min(largest, count - 1)
    lags = np.arange(-largest, largest + 1)
    size = scipy.fft.next_fast_len(2 * count - 1, real=True)
    spectra = scipy.fft.rfft(measured, size), scipy.fft.rfft(model, size)
    correlation = scipy.fft.irfft(spectra[0] * spectra[1].conj(), size)[lags]
    energy = np.concatenate(([0.0], np.cumsum(model**2)))
    inside = energy[np.minimum(count, count - lags)] - energy[np.maximum(0, -lags)]
    error = inside - 2.0 * correlation
    best = int(np.argmin(error))
    if 0 < best < error.size - 1:
        left, middle, right = error[best - 1 : best + 2]
        bend = left - 2.0 * middle + right
        if bend > 0.0:
            return float(lags[best] + (left - right) / (2.0 * bend))
    return float(lags[best])


def compare_trace(
    measured: FloatArray, model: FloatArray, sampling_rate: float, contact: slice, largest: int
) -> TraceComparison:
    """Normalise both traces, shift the model onto the measurement and measure what is left.

    Parameters
    ----------
    measured, model : ndarray, shape (n,)
        Filtered alike.
    sampling_rate : float
        [Hz]
    contact : slice
        The points of the contact.
    largest : int
        Largest shift either way [points].
    """
    peak = find_extreme(measured)
    reference, candidate = measured / peak, model / find_extreme(model)
    shift = find_best_shift(reference, candidate, largest)
    # Zeros come in from beyond the ends.
    shifted = scipy.ndimage.shift(candidate, shift, order=3)
    error = shifted - reference
    inside = error[contact]
    return TraceComparison(
        measured=make_read_only(reference),
        model=make_read_only(shifted),
        peak=peak,
        shift=shift / sampling_rate,
        mse_percent=100.0 * float(error @ error) / error.size,
        contact_error_percent=100.0 * math.sqrt(float(inside @ inside) / inside.size),
    )


def compare_with_model(
    mean: MeanHit,
    model: ImpactModel,
    variant: ModelVariant,
    chains: Sequence[Chain],
) -> ModelComparison:
    """Simulate the model on the mean hit's time grid, filter it alike and compare.

    Parameters
    ----------
    mean : MeanHit
        Both channels.
    chains : sequence of Chain
        What both channels went through.

    Raises
    ------
    SignalError
        If a trace is flat.
    """
    rate = mean.sampling_rate
    count = mean.traces.shape[1]
    start_time = model.contact_time / 2.0 - mean.origin / rate
    bodies = simulate_impact(model, rate, count, start=start_time, variant=variant)
    filtered = show_bodies(np.stack(bodies), chains)
    first = max(0, int(np.ceil(-start_time * rate)))
    last = min(count, int(np.floor((model.contact_time - start_time) * rate)) + 1)
    contact = slice(first, last)
    # Beyond one contact time another oscillation would be laid onto the measured one.
    largest = round(model.contact_time * rate)
    hammer, specimen = (
        compare_trace(mean.traces[i], filtered[i], rate, contact, largest) for i in (0, 1)
    )
    return ModelComparison(
        variant=variant,
        sampling_rate=rate,
        start_time=start_time,
        contact_time=model.contact_time,
        hammer=hammer,
        specimen=specimen,
    )
