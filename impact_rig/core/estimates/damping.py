"""Log decrement and free decay."""

import math
from dataclasses import dataclass

import numpy as np
import scipy

from impact_rig.core.given.errors import NotDeterminedError, check_not_negative, check_positive
from impact_rig.core.given.records import FloatArray
from impact_rig.core.hit.pulse_width import find_peaks, measure_pulse
from impact_rig.core.mean.mean_hit import MeanHit


@dataclass(frozen=True)
class LogDecrement:
    """Two consecutive peaks of the same sign."""

    first_peak: float  # U1 and U2 [unit of the trace]
    second_peak: float
    first_index: int  # where they stand, in points
    second_index: int

    @property
    def log_decrement(self) -> float:
        """Delta = ln(U1 / U2) [-], equation (7a)."""
        return math.log(self.first_peak / self.second_peak)


def estimate_log_decrement(trace: FloatArray, noise: float) -> LogDecrement:
    """Find U1, the largest peak, and U2, the next one of the same sign.

    U1 lies inside the contact, where the response is still forced, so this estimate is biased
    unless the body really decays freely from there: equation (7a) as published, with its bias.

    Parameters
    ----------
    trace : ndarray, shape (n,)
        Mean filtered acceleration, baseline zero, either polarity.
    noise : float
        Standard deviation of the trace's noise [unit of the trace].

    Returns
    -------
    LogDecrement

    Raises
    ------
    NotDeterminedError
        If no second peak stands out of the noise, or the second is no lower than the first.
    SignalError
        If the trace has no pulse.
    """
    pulse = measure_pulse(trace)
    upright = trace if pulse.peak > 0 else -trace
    first = pulse.peak_index
    tail_start = math.ceil(pulse.fall)
    tail = upright[tail_start:]
    # Of some 5000 filtered points fewer than one in a hundred records exceeds four standard
    # deviations, which the baseline tells within a sixth.
    needed = max(5.0 * noise, np.finfo(float).eps * abs(pulse.peak))
    candidates = find_peaks(tail, needed)
    if not candidates:
        raise NotDeterminedError(
            "no log decrement, since no second peak stands out of the noise"
            f" ({needed / abs(pulse.peak) * 100:.2g} % of the first)"
        )
    second = tail_start + candidates[int(np.argmax(tail[candidates]))]
    if upright[second] >= abs(pulse.peak):
        raise NotDeterminedError(
            "log decrement: the second peak is as high as the first, so that nothing decays"
        )
    return LogDecrement(
        first_peak=abs(pulse.peak),
        second_peak=float(upright[second]),
        first_index=first,
        second_index=second,
    )


TOLERANCE = 1e-6
"""Relative change of sum of squares and of parameters that ends the fit [-], our choice: of some
hundred points, a hundredth of what noise makes of the parameters."""


@dataclass(frozen=True)
class DecayFit:
    """The damped oscillation and offset that come nearest to a tail, for a decay and a frequency.

    Arrays of shape (n,), but the jacobian's (2, n).
    """

    residual: FloatArray  # measured minus fitted
    jacobian: FloatArray  # of the residual, in a and omega per point
    oscillation: FloatArray  # the fit without its offset
    amplitude: float  # of the envelope at the first point


def fit_amplitudes(measured: FloatArray, parameters: FloatArray) -> DecayFit:
    """Fit cosine, sine and offset to a tail, shape (n,), for a and omega per point."""
    points = np.arange(measured.size)
    # A growing trial step must not overflow.
    decay = max(float(parameters[0]), -1.0 / measured.size)
    wave = np.exp((-decay + 1j * parameters[1]) * points)
    basis = np.stack((np.ones(measured.size), wave.real, wave.imag), axis=1)
    orthonormal, triangle = np.linalg.qr(basis)
    onto = measured @ orthonormal
    _, cosine, sine = np.linalg.lstsq(triangle, onto, rcond=None)[0].tolist()
    swing = (cosine - 1j * sine) * wave
    slopes = points * np.stack((swing.real, swing.imag))
    return DecayFit(
        residual=measured - orthonormal @ onto,
        jacobian=slopes - (slopes @ orthonormal) @ orthonormal.T,
        oscillation=swing.real,
        amplitude=math.hypot(cosine, sine),
    )


def fit_decay(measured: FloatArray, relative_cutoff: float) -> tuple[FloatArray, DecayFit]:
    """Return the best decay rate and angular frequency per point, and the fit there.

    Parameters
    ----------
    measured : ndarray, shape (n,)
        Damped oscillation, offset and noise, equidistant.
    relative_cutoff : float
        Highest frequency that can be there, over the sampling rate [-]; 0: one half.
    """
    candidates = _search_spectrum(measured, relative_cutoff or 0.5)
    fits = [fit_amplitudes(measured, candidate).residual for candidate in candidates]
    return _refine_decay(measured, candidates[int(np.argmin([left @ left for left in fits]))])


def _refine_decay(measured: FloatArray, scale: FloatArray) -> tuple[FloatArray, DecayFit]:
    """Return the same from a decay rate and an angular frequency that are nearly right."""
    # Of the model [-], our choice: a decay needs fewer than ten, noise never comes to rest.
    found = scipy.optimize.least_squares(
        lambda factors: fit_amplitudes(measured, factors * scale).residual,
        np.ones(2),
        lambda factors: fit_amplitudes(measured, factors * scale).jacobian.T * scale,
        method="lm",
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        max_nfev=50,
    ).x
    solution = np.array([1.0, np.sign(found[1])]) * found * scale
    return solution, fit_amplitudes(measured, solution)


def _search_spectrum(tail: FloatArray, highest: float) -> FloatArray:
    """Return a and omega of the strongest line for each weight of the tail, shape (m, 2)."""
    count = tail.size
    # What the oscillation has come down to is the offset.
    signal = tail - tail[count // 2 :].mean()
    # From nearly undamped to gone after a few per cent of the tail.
    decays = np.array((0.3, 1.0, 3.0, 10.0, 30.0, 100.0)) / count
    weights = np.exp(-decays[:, np.newaxis] * np.arange(count))
    # Half a line is near enough.
    length = scipy.fft.next_fast_len(2 * count, real=True)
    # What takes longer than two tails is offset.
    first = int(0.5 * length / count)
    last = max(first + 1, int(min(highest, 0.5) * length))
    spectra = np.abs(scipy.fft.rfft(weights * signal, length))
    lines = np.argmax(spectra[:, first:last], axis=1) + first
    return np.stack((decays, 2.0 * np.pi * lines / length), axis=1)


FITTED = 5
"""Parameters of the fit: a, omega, C, S and the offset."""
MINIMUM_POINTS = 4 * FITTED
"""Fewest points of a tail [-], our choice."""
MINIMUM_PERIODS = 1.0
"""That stand out of the noise, in the tail [-], our choice: in less, offset, damping and frequency
stand in for each other, and damping is critical or nearly so."""
LARGEST_RELATIVE_UNCERTAINTY = 0.25
"""Of the damping ratio, standard [-], our choice: beyond it the 95 % interval is wider than the
value."""
SMALLEST_SIGNAL = 8.0
"""Root of the oscillation's energy over that of the noise in one parameter [-], our choice: a
search over some thousand pairs (a, omega) of noise alone reaches 5."""
MISFIT = 1.5
"""What the fit leaves, over the noise, beyond which the model is wrong rather than the noise large
[-], our choice: chance alone stays within a few per cent of 1."""
SMALLEST_R_SQUARED = 0.99
"""Where the fit leaves twice `MISFIT` and more, it must explain this part of the tail's variance
[-], our choice: otherwise it is no single damped oscillation."""


@dataclass(frozen=True)
class FreeDecay:
    """A damped oscillation found in the tail of a mean hit."""

    decay_rate: float  # a [1/s]
    angular_frequency: float  # omega, damped [rad/s]
    # a and omega of each hit, to first order about those of the mean, which are their mean [1/s]:
    # their spread is the type A evaluation.
    hit_values: FloatArray
    r_squared: float  # part of the tail's variance that the fit explains [-]
    # Standard deviation of what the fit leaves over that of the noise [-]; NaN: no noise known.
    residual_over_noise: float
    periods: float  # periods in the tail while the envelope stands out of the noise [-]
    tail: slice  # points of the trace that were fitted
    covariance: FloatArray  # (2, 2), of a and omega by what the fit leaves beyond the noise
    # Damping ratios of the first and the second half of what stands out of the noise, where they
    # differ by more than noise makes; empty: they do not, or are too short.
    halves: tuple[float, ...]
    has_many_modes: bool  # one damped oscillation does not explain the tail

    @property
    def frequency(self) -> float:
        """Frequency of the damped oscillation [Hz]."""
        return self.angular_frequency / (2.0 * math.pi)


def estimate_free_decay(
    mean: MeanHit, channel: int, contact_end: float, cutoff_frequency: float
) -> FreeDecay:
    """Fit a damped oscillation to the tail of one channel.

    Parameters
    ----------
    channel : int
        0: hammer, 1: sample.
    contact_end : float
        When the bodies have parted, from the middle of the hammer's pulse [s].
    cutoff_frequency : float
        Of the low-pass that the traces went through [Hz]; 0: none.

    Returns
    -------
    FreeDecay

    Raises
    ------
    NotDeterminedError
        If the tail is too short, in the noise, not a decaying oscillation, or too near critical
        damping; the sentence says which.
    """
    check_positive("end of the contact", contact_end, "s")
    check_not_negative("cutoff frequency", cutoff_frequency, "Hz")
    if channel >= mean.traces.shape[0]:
        raise NotDeterminedError("this channel was not measured")
    tail = _find_tail(mean, contact_end, cutoff_frequency)
    check_window(mean, channel, cutoff_frequency)
    measured = mean.traces[channel, tail]
    rate = mean.sampling_rate / tail.step
    spread = float(measured.std())
    if spread <= np.finfo(float).eps * float(np.abs(mean.traces[channel]).max()):
        raise NotDeterminedError("the tail after the contact is flat")
    solution, fit = fit_decay(measured, cutoff_frequency / rate)
    jacobian = fit.jacobian.T
    noise = float(mean.noise[channel])
    left = float(np.sqrt(np.sum(fit.residual**2) / (measured.size - FITTED)))
    excess = left / noise if noise > 0.0 else math.nan
    # The decay lies below the cutoff, where filtered noise is white and as large as raw noise;
    # decimation keeps that noise in fewer points.
    white = float(mean.raw_noise[channel]) / math.sqrt(tail.step)
    white = white * max(1.0, excess) if noise > 0.0 else left
    covariance = np.asarray(white**2 * np.linalg.pinv(jacobian.T @ jacobian), dtype=np.float64)
    r_squared = 1.0 - float(np.sum(fit.residual**2)) / (measured.size * spread**2)
    signal = float(np.linalg.norm(fit.oscillation))
    if signal < SMALLEST_SIGNAL * white:
        raise NotDeterminedError(
            "the tail after the contact is in the noise (signal to noise of its"
            f" energy {(signal / white) ** 2:.3g}; it needs {SMALLEST_SIGNAL**2:.3g})"
        )
    duration = (measured.size - 1) / rate
    decay, frequency = (float(value) * rate for value in solution)
    if decay <= 0.0:
        raise NotDeterminedError("the tail after the contact does not decay")
    # Periods count while the envelope exceeds two standard deviations of the noise.
    floor = 2.0 * max(noise, np.finfo(float).eps * fit.amplitude)
    lasting = math.log(max(fit.amplitude / floor, 1.0)) / decay
    periods = min(lasting, duration) * frequency / (2.0 * math.pi)
    has_many_modes = excess > 2.0 * MISFIT and r_squared < SMALLEST_R_SQUARED
    if not has_many_modes:
        _check_decay(solution, covariance, periods)
    hits = mean.read_hits(channel, tail)
    # Birge's ratio: what a fit leaves times the noise makes the covariance larger, at least.
    beyond = max(1.0 - 1.0 / max(excess, 1.0) ** 2, 0.0) if noise > 0.0 else 0.0
    count = min(int(lasting * rate), measured.size)
    return FreeDecay(
        decay_rate=decay,
        angular_frequency=frequency,
        # J^T B = 0: what the linear parameters of a hit are does not matter.
        hit_values=rate * (solution - hits @ np.linalg.pinv(jacobian).T),
        r_squared=r_squared,
        residual_over_noise=excess,
        periods=periods,
        tail=tail,
        covariance=beyond * covariance * rate**2,
        halves=_fit_halves(measured[:count], solution, white),
        has_many_modes=has_many_modes,
    )


def check_window(mean: MeanHit, channel: int, cutoff_frequency: float) -> None:
    """Refuse a response that ends far quieter than its baseline: an analyser's window is in it.

    Raises
    ------
    NotDeterminedError
        If it does.
    """
    guard, step = _find_guard(mean.sampling_rate, cutoff_frequency)
    trace = mean.traces[channel]
    # Fourth differences leave noise, and little of what rings; what the low-pass smears before the
    # contact, and makes of the record's end, stays out.
    before, end = (
        float(np.diff(part[::step], 4).std()) if part.size > 5 * step else 0.0
        for part in (
            trace[: mean.baseline_points // 2],
            trace[-trace.size // 4 : trace.size - guard],
        )
    )
    # Filtered noise of a short baseline is known to a sixth or so.
    if end < 0.35 * before > 1e-9 * float(np.abs(trace).max()):
        raise NotDeterminedError(
            f"the response ends with {end / before:.2g} of the noise of its baseline: a"
            " window of an analyser is in it, and part of the decay is the window's; record"
            " without one"
        )


SHORTEST_HALF = 1.5
"""Periods of half a decay whose damping is compared [-], our choice."""


def _fit_halves(measured: FloatArray, solution: FloatArray, white: float) -> tuple[float, ...]:
    """Return the damping ratios of both halves of a decay, shape (n,), where they differ."""
    half = measured.size // 2
    if half < MINIMUM_POINTS or half * solution[1] < 2.0 * math.pi * SHORTEST_HALF:
        return ()
    ratios, errors = [], []
    for part in (measured[:half], measured[half:]):
        found, fit = _refine_decay(part, solution)
        decay, frequency = found.tolist()
        left = max(white, float(np.sqrt(fit.residual @ fit.residual / (part.size - FITTED))))
        inverse = np.linalg.pinv(fit.jacobian @ fit.jacobian.T)
        errors.append(left * math.sqrt(float(inverse[0, 0])) / frequency)
        ratios.append(decay / math.hypot(decay, frequency))
    apart = abs(ratios[1] - ratios[0])
    return tuple(ratios) if apart > 2.0 * (errors[0] + errors[1]) else ()


def _find_guard(sampling_rate: float, cutoff_frequency: float) -> tuple[int, int]:
    """Return how many points a low-pass smears, and how many one of its output stands for."""
    if not cutoff_frequency:
        return 0, 1
    points = sampling_rate / cutoff_frequency
    # After five time constants less than 1 % of a step is smeared; what folds back into the pass
    # band has been damped to a hundredth and less.
    return math.ceil(points), max(1, int(points / 5.0))


def _find_tail(mean: MeanHit, contact_end: float, cutoff_frequency: float) -> slice:
    rate = mean.sampling_rate
    guard, step = _find_guard(rate, cutoff_frequency)
    first = mean.origin + math.ceil(contact_end * rate) + guard
    last = mean.traces.shape[1] - guard
    points = max(0, math.ceil((last - first) / step))
    if points < MINIMUM_POINTS:
        raise NotDeterminedError(
            f"{max(0, last - first) / rate * 1e6:.3g} µs of tail after the contact are"
            f" {points} points; it needs {MINIMUM_POINTS}: record longer"
        )
    return slice(first, last, step)


def _check_decay(parameters: FloatArray, covariance: FloatArray, periods: float) -> None:
    decay, frequency = (float(value) for value in parameters)
    ratio = decay / math.hypot(decay, frequency)
    if periods < MINIMUM_PERIODS:
        raise NotDeterminedError(
            f"{periods:.2g} periods of the tail, of damping ratio {ratio:.2f}, stand"
            f" out of the noise; it needs {MINIMUM_PERIODS:g}"
        )
    # Of the damping ratio a over the root of a^2 + omega^2, in a and omega.
    slope = np.array([frequency**2, -decay * frequency]) / math.hypot(decay, frequency) ** 3
    uncertainty = float(np.sqrt(slope @ covariance @ slope))
    if uncertainty > LARGEST_RELATIVE_UNCERTAINTY * ratio:
        raise NotDeterminedError(
            f"the damping ratio of {ratio:.2g} has a standard uncertainty of"
            f" {uncertainty:.2g}; it must be below {100 * LARGEST_RELATIVE_UNCERTAINTY:g} %"
        )


def find_settled_velocity(
    trace: FloatArray, tail: slice, decay: FloatArray, sampling_rate: float
) -> float:
    """Return the velocity about which a body rings in the tail of its trace, either sign [m/s].

    Parameters
    ----------
    trace : ndarray, shape (n,)
        Acceleration from before the contact on.
    decay : ndarray, shape (2,)
        a and omega of the ringing, per point of the tail.
    """
    velocity = scipy.integrate.cumulative_trapezoid(trace, dx=1.0 / sampling_rate, initial=0.0)
    measured = velocity[tail]
    fit = fit_amplitudes(measured, decay)
    return abs(float(np.mean(measured - fit.residual - fit.oscillation)))
