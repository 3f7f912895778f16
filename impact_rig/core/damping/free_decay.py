"""Damping from the free decay after the contact, by one damped oscillation and an offset.

The logarithmic decrement takes its first peak from inside the contact, where the body is still
driven. Here only what comes after the contact is used, and all of it. A zero-phase low-pass
changes the amplitude of such an oscillation, not its decay and frequency.
"""

import math
from dataclasses import dataclass

import numpy as np

from impact_rig.core.checks import check_not_negative, check_positive
from impact_rig.core.damping.decay_fit import DecayFit
from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.signals.record import FloatArray, make_read_only

FILTER_GUARD = 1.0
"""What is left out beside the contact's end and the record's, in periods of the cutoff [-]: five
time constants of the low-pass, after which it smears less than 1 % of a step."""
CONTACT_GUARD = 0.05
"""Left out after the contact besides, in contact times [-], our choice: tau_p is read from a
width, and a pulse that falls up to half as long again as it rises ends so much later."""
POINTS_PER_CUTOFF = 5.0
"""Sampling rate of the decimated tail over the cutoff [-], our choice: what folds back into the
pass band has been damped by the low-pass to a hundredth and less."""
FITTED = 5
"""Parameters of the fit: a, omega, C, S and the offset."""
MINIMUM_POINTS = 4 * FITTED
"""Fewest points of a tail [-], our choice."""
MINIMUM_PERIODS = 1.0
"""Shortest tail, in periods of the oscillation found [-], our choice: in less, offset, damping
and frequency stand in for each other."""
LARGEST_DAMPING_RATIO = 0.9
"""Above it the second half-wave is below 0.2 % of the first [-], our choice: critical."""
SMALLEST_FREQUENCY = 3.0
"""How far omega must be from zero, in its standard uncertainties [-], our choice."""
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
MISFIT_BAND = 2.0
MISFIT_LINES = 4
"""What a wrong model leaves lies near the oscillation: it is measured from zero up to this many
times its frequency, over so many spectral lines at least [-], our choice."""
DECAYED = 3.0
"""a times the tail's length beyond which a tail without one whole period counts as over-critical
rather than as too short [-], our choice: 5 % is left."""
ENVELOPE_OVER_NOISE = 2.0
"""Periods count as above the noise while the envelope exceeds this many standard deviations [-],
our choice."""


@dataclass(frozen=True)
class FreeDecay:
    """A damped oscillation found in the tail of a mean hit.

    Attributes
    ----------
    decay_rate : float
        a [1/s].
    angular_frequency : float
        omega, damped [rad/s].
    covariance : ndarray, shape (2, 2)
        Of (a, omega), from the noise, or from what the fit leaves where that is more [1/s^2].
    hit_values : ndarray, shape (hits, 2)
        a and omega of each hit, to first order about those of the mean, which are their mean
        [1/s]: their spread is the type A evaluation.
    amplitude : float
        Of the envelope at the first point of `time` [m/s^2].
    r_squared : float
        Part of the tail's variance that the fit explains [-].
    residual_over_noise : float
        Standard deviation of what the fit leaves over that of the noise [-]; NaN: no noise known.
    periods : float
        Periods in the tail while the envelope stands out of the noise [-].
    time : ndarray, shape (n,)
        Of the tail's points, from the start of the contact [s].
    measured, fitted : ndarray, shape (n,)
        The tail and the fit [m/s^2].
    """

    decay_rate: float
    angular_frequency: float
    covariance: FloatArray
    hit_values: FloatArray
    amplitude: float
    r_squared: float
    residual_over_noise: float
    periods: float
    time: FloatArray
    measured: FloatArray
    fitted: FloatArray

    def __post_init__(self) -> None:
        """Copy the arrays and make them read-only."""
        for name in ("covariance", "hit_values", "time", "measured", "fitted"):
            object.__setattr__(self, name, make_read_only(getattr(self, name)))

    @property
    def natural_frequency(self) -> float:
        """Undamped angular frequency sqrt(a^2 + omega^2) [rad/s]."""
        return math.hypot(self.decay_rate, self.angular_frequency)

    @property
    def frequency(self) -> float:
        """Of the damped oscillation [Hz]."""
        return self.angular_frequency / (2.0 * math.pi)

    @property
    def damping_ratio(self) -> float:
        """Damping ratio a / sqrt(a^2 + omega^2) [-]."""
        return self.decay_rate / self.natural_frequency

    @property
    def damping_ratio_uncertainty(self) -> float:
        """Standard uncertainty of the damping ratio from `covariance` [-]."""
        return _find_ratio_uncertainty(self.decay_rate, self.angular_frequency, self.covariance)

    def find_stiffness(self, mass: float) -> float:
        """Return k = m (a^2 + omega^2) [N/m] of a body of `mass` [kg]."""
        check_positive("mass", mass, "kg")
        return mass * self.natural_frequency**2

    def find_damping_coefficient(self, mass: float) -> float:
        """Return c = 2 m a [N s/m] of a body of `mass` [kg]."""
        check_positive("mass", mass, "kg")
        return 2.0 * mass * self.decay_rate


def estimate_free_decay(
    mean: MeanHit, channel: int, contact_time: float, cutoff_frequency: float
) -> FreeDecay:
    """Fit a damped oscillation to the tail of one channel.

    Parameters
    ----------
    mean : MeanHit
        Mean hit.
    channel : int
        0: hammer, 1: sample.
    contact_time : float
        tau_p [s]: the tail starts behind it.
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
    check_positive("contact time", contact_time, "s")
    check_not_negative("cutoff frequency", cutoff_frequency, "Hz")
    if channel >= mean.traces.shape[0]:
        raise NotDeterminedError("free decay: this channel was not measured")
    tail = _find_tail(mean, contact_time, cutoff_frequency)
    measured = mean.traces[channel, tail]
    rate = mean.sampling_rate / tail.step
    spread = float(measured.std())
    if spread <= np.finfo(float).eps * float(np.abs(mean.traces[channel]).max()):
        raise NotDeterminedError("free decay: the tail after the contact is flat")
    fit = DecayFit(measured)
    solution = fit.solve(cutoff_frequency / rate)
    jacobian = fit.find_jacobian(solution)
    noise = float(mean.noise[channel])
    left = float(np.sqrt(np.sum(fit.residual**2) / (measured.size - FITTED)))
    excess = left / noise if noise > 0.0 else math.nan
    # Filtered noise is white below the cutoff, where the Jacobian lies: as large there as raw
    # noise, of which decimation leaves all in fewer points.
    white = float(mean.raw_noise[channel]) / math.sqrt(tail.step)
    white = white * max(1.0, excess) if noise > 0.0 else left
    if excess > MISFIT:
        white = max(white, _find_misfit_level(fit.residual, float(solution[1])))
    covariance = np.asarray(white**2 * np.linalg.pinv(jacobian.T @ jacobian), dtype=np.float64)
    r_squared = 1.0 - float(np.sum(fit.residual**2)) / (measured.size * spread**2)
    _check_signal(fit.oscillation, white)
    _check_decay(solution, covariance, measured.size)
    if excess > 2.0 * MISFIT and r_squared < SMALLEST_R_SQUARED:
        raise NotDeterminedError(
            f"free decay: one damped oscillation explains only {100.0 * r_squared:.0f} % of the"
            f" tail; it must explain {100.0 * SMALLEST_R_SQUARED:.0f} %"
        )
    hits = np.stack([hit[channel, tail] for hit in mean.cut_hits()])
    duration = (measured.size - 1) / rate
    decay, frequency = (float(value) * rate for value in solution)
    floor = ENVELOPE_OVER_NOISE * max(noise, np.finfo(float).eps * fit.amplitude)
    lasting = math.log(max(fit.amplitude / floor, 1.0)) / decay
    return FreeDecay(
        decay_rate=decay,
        angular_frequency=frequency,
        covariance=covariance * rate**2,
        # J^T B = 0: what the linear parameters of a hit are does not matter.
        hit_values=rate * (solution - hits @ np.linalg.pinv(jacobian).T),
        amplitude=fit.amplitude,
        r_squared=r_squared,
        residual_over_noise=excess,
        periods=min(lasting, duration) * frequency / (2.0 * math.pi),
        time=(np.arange(tail.start, tail.stop, tail.step) - mean.origin) / mean.sampling_rate
        + contact_time / 2.0,
        measured=measured,
        fitted=measured - fit.residual,
    )


def _find_tail(mean: MeanHit, contact_time: float, cutoff_frequency: float) -> slice:
    rate = mean.sampling_rate
    guard, step = 0, 1
    if cutoff_frequency > 0.0:
        guard = math.ceil(FILTER_GUARD / cutoff_frequency * rate)
        step = max(1, int(rate / (POINTS_PER_CUTOFF * cutoff_frequency)))
    first = mean.origin + math.ceil((0.5 + CONTACT_GUARD) * contact_time * rate) + guard
    last = mean.traces.shape[1] - guard
    points = max(0, math.ceil((last - first) / step))
    if points < MINIMUM_POINTS:
        raise NotDeterminedError(
            f"free decay: {max(0, last - first) / rate * 1e6:.3g} us of tail after the contact are"
            f" {points} points; it needs {MINIMUM_POINTS}: record longer"
        )
    return slice(first, last, step)


def _find_misfit_level(residual: FloatArray, frequency: float) -> float:
    """Return the standard deviation of the white noise that is as strong near `frequency`."""
    lines = math.ceil(MISFIT_BAND * frequency / (2.0 * math.pi) * residual.size)
    power = np.abs(np.fft.rfft(residual))[: max(lines, MISFIT_LINES)] ** 2 / residual.size
    # Two real numbers a line, of which the fit has taken all parameters but the offset.
    return math.sqrt(2.0 * float(power.sum()) / (2 * power.size - (FITTED - 1)))


def _check_signal(oscillation: FloatArray, white_noise: float) -> None:
    signal = float(np.linalg.norm(oscillation))
    if signal < SMALLEST_SIGNAL * white_noise:
        raise NotDeterminedError(
            "free decay: the tail after the contact is in the noise (signal to noise of its"
            f" energy {(signal / white_noise) ** 2:.3g}; it needs {SMALLEST_SIGNAL**2:.3g})"
        )


def _check_decay(parameters: FloatArray, covariance: FloatArray, points: int) -> None:
    decay, frequency = (float(value) for value in parameters)
    periods = points * frequency / (2.0 * math.pi)
    ratio = decay / math.hypot(decay, frequency)
    if periods < MINIMUM_PERIODS and decay * points < DECAYED:
        raise NotDeterminedError(
            f"free decay: a tail of {periods:.2g} periods is too short for a damping ratio; it"
            f" needs {MINIMUM_PERIODS:g}: record longer"
        )
    if decay <= 0.0:
        raise NotDeterminedError("free decay: the tail after the contact does not decay")
    if (
        ratio > LARGEST_DAMPING_RATIO
        or periods < MINIMUM_PERIODS
        or frequency < SMALLEST_FREQUENCY * math.sqrt(covariance[1, 1])
    ):
        raise NotDeterminedError(
            f"free decay: damping is critical or nearly so (ratio {ratio:.2f}), and the tail does"
            " not tell stiffness and damping apart"
        )
    uncertainty = _find_ratio_uncertainty(decay, frequency, covariance)
    if uncertainty > LARGEST_RELATIVE_UNCERTAINTY * ratio:
        raise NotDeterminedError(
            f"free decay: the damping ratio of {ratio:.2g} has a standard uncertainty of"
            f" {uncertainty:.2g}; it must be below {100 * LARGEST_RELATIVE_UNCERTAINTY:g} %"
        )


def _find_ratio_uncertainty(decay: float, frequency: float, covariance: FloatArray) -> float:
    # Of the damping ratio a over the root of a^2 + omega^2, in a and omega.
    slope = np.array([frequency**2, -decay * frequency]) / math.hypot(decay, frequency) ** 3
    return float(np.sqrt(slope @ covariance @ slope))
