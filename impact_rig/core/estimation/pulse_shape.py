"""Which pulse the hammer's mean trace shows, and what the contact time is if it is that one.

The paper reads tau_p = 2 w50, which belongs to a versed-sine. Under another shape the same width
means another contact time, and stiffness goes with its inverse square.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from impact_rig.core.checks import check_not_negative
from impact_rig.core.estimation.pulse_fit import PulseFit, PulseWindow, cut_window, fit_pulse
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.hits.pulse_width import PulseWidth, find_crossing, measure_pulse
from impact_rig.core.model.pulses import PULSE_SHAPES, VERSED_SINE, PulseShape
from impact_rig.core.signals.record import FloatArray

TOP_LEVELS = (0.5, 0.9, 9)
"""First, last and number of the levels, over the peak [-], our choice: above, noise moves the
crossings."""
SPLINE_POINTS = 64
SPLINE_MARGIN = 3
"""A pulse of fewer points at half amplitude than `SPLINE_POINTS` is interpolated, with so many
points about it [-], our choice."""
TELLING_DIFFERENCE = 2.0
"""How many standard deviations of what noise alone makes of it two sums of squares must differ by
[-], our choice: 95 %."""
RESIDUAL_OVER_NOISE = 3.0
LARGEST_RESIDUAL = 0.005
"""A versed-sine that leaves more than this part of the peak [-] and so many times the noise [-] is
doubted, if another shape leaves clearly less. Our choice: fitted to a Hertz pulse it leaves 0.6 %,
and makes the stiffness 17 % too low; to a half-sine 3.2 %, and 44 %."""
POOR_RESIDUAL = 0.03
"""A shape that leaves more than this part of the peak does not describe the pulse [-], our choice:
as far as versed-sine and half-sine are apart."""


@dataclass(frozen=True)
class ShapeFit:
    """One shape fitted to the pulse; NaN: this shape has no parameters that come near.

    Attributes
    ----------
    shape : PulseShape
        Which.
    contact_time : float
        tau_p, the duration of the fit [s].
    contact_time_from_width : float
        F w50 with the shape's own F, blind to asymmetry and low-pass [s].
    start_time : float
        Of the fit, from the middle of the pulse at half amplitude [s].
    asymmetry : float
        The rise takes (1 + asymmetry) / 2 of the contact [-].
    amplitude, offset : float
        Signed [m/s^2].
    residual_percent : float
        Standard deviation of what is left over the pulse, over the peak [%].
    """

    shape: PulseShape
    contact_time: float
    contact_time_from_width: float
    start_time: float
    asymmetry: float
    amplitude: float
    offset: float
    residual_percent: float

    @property
    def name(self) -> str:
        """Of the shape."""
        return self.shape.name


@dataclass(frozen=True)
class PulseShapeEstimate:
    """What the mean hammer pulse looks like.

    Attributes
    ----------
    width_ratio : float
        w10 / w50 [-].
    fall_over_rise : float
        Time from the peak down to half of it over the time up to the peak [-]; NaN: the pulse
        has no one peak.
    noise_percent : float
        Standard deviation of the trace's noise, over the peak [%].
    fits : tuple of ShapeFit
        One for each of `PULSE_SHAPES`, in their order.
    is_told_apart : bool
        The next best shape leaves clearly more than the best.
    warning : str
        Why the paper's versed-sine does not describe the pulse; empty: it does.
    """

    width_ratio: float
    fall_over_rise: float
    noise_percent: float
    fits: tuple[ShapeFit, ...]
    is_told_apart: bool
    warning: str

    @property
    def best_fit(self) -> ShapeFit:
        """The fit that leaves least."""
        return min(self.fits, key=lambda fit: fit.residual_percent)

    @property
    def best_shape(self) -> str:
        """Name of the shape that leaves least."""
        return self.best_fit.name

    def find_fit(self, shape: PulseShape) -> ShapeFit:
        """Return the fit of one of `PULSE_SHAPES`."""
        return self.fits[PULSE_SHAPES.index(shape)]


def estimate_pulse_shape(mean: MeanHit, cutoff_frequency: float) -> PulseShapeEstimate:
    """Fit every pulse shape to the hammer's mean trace and compare what they leave.

    Parameters
    ----------
    mean : MeanHit
        Mean hit.
    cutoff_frequency : float
        Of the low-pass that the traces went through [Hz], which the shapes go through as well;
        0: none.

    Returns
    -------
    PulseShapeEstimate

    Raises
    ------
    NotDeterminedError
        If the pulse has too few points, or does not come down on both sides.
    SignalError
        If there is no pulse.
    """
    check_not_negative("cutoff frequency", cutoff_frequency, "Hz")
    rate = mean.sampling_rate
    pulse = measure_pulse(mean.traces[0])
    upright = mean.traces[0] / pulse.peak
    width = pulse.half_amplitude_width
    window = cut_window(upright, pulse.peak_index, pulse.middle, width, cutoff_frequency / rate)
    fits = [fit_pulse(window, shape) for shape in PULSE_SHAPES]
    shape_fits = tuple(
        _scale_fit(fit, shape, width / rate, pulse.peak)
        for shape, fit in zip(PULSE_SHAPES, fits, strict=True)
    )
    noise = float(mean.noise[0]) / abs(pulse.peak)
    white = float(mean.raw_noise[0]) / abs(pulse.peak) / math.sqrt(window.step)
    order = np.argsort([fit.residual for fit in fits])
    best, versed = fits[order[0]], fits[PULSE_SHAPES.index(VERSED_SINE)]
    # What even the best shape leaves makes the others' differences less telling.
    level = white * max(1.0, best.residual / noise) if noise > 0.0 else best.residual
    return PulseShapeEstimate(
        width_ratio=pulse.width_ratio,
        fall_over_rise=_compare_sides(upright, pulse),
        noise_percent=100.0 * noise,
        fits=shape_fits,
        is_told_apart=_is_worse(fits[order[1]], best, level, window),
        warning=_find_warning(
            shape_fits[order[0]],
            shape_fits[PULSE_SHAPES.index(VERSED_SINE)],
            noise,
            told_apart=_is_worse(versed, best, level, window),
        ),
    )


def _scale_fit(fit: PulseFit, shape: PulseShape, width: float, peak: float) -> ShapeFit:
    known = 1.0 if fit.is_inside else math.nan
    return ShapeFit(
        shape=shape,
        contact_time=known * fit.duration * width,
        contact_time_from_width=shape.pulse_factor * width,
        start_time=known * fit.start * width,
        asymmetry=known * fit.asymmetry,
        amplitude=known * fit.amplitude * peak,
        offset=known * fit.offset * peak,
        residual_percent=100.0 * fit.residual,
    )


def _compare_sides(upright: FloatArray, pulse: PulseWidth) -> float:
    """Return fall over rise at half amplitude, about the pulse's peak.

    The peak is where the middle of the pulse comes to as its width goes to zero, extrapolated
    over many levels: the highest point itself is a matter of noise.
    """
    first = max(0, math.floor(pulse.rise) - SPLINE_MARGIN)
    last = min(upright.size, math.ceil(pulse.fall) + SPLINE_MARGIN + 1)
    finer = max(1, math.ceil(SPLINE_POINTS / pulse.half_amplitude_width))
    top = upright[first:last]
    if finer > 1:
        points = np.arange((top.size - 1) * finer + 1) / finer
        top = CubicSpline(np.arange(top.size), top)(points)
    peak_index = int(np.argmax(top))
    levels = top[peak_index] * np.linspace(*TOP_LEVELS)
    crossings = np.array(
        [[find_crossing(top, peak_index, level, side) for side in (-1, 1)] for level in levels]
    )
    rise, fall = crossings.T
    if not np.isfinite(crossings).all():
        return math.nan
    width, middle = fall - rise, (rise + fall) / 2.0
    above = width - width.mean()
    peak = middle.mean() - width.mean() * (above @ middle) / (above @ above)
    if not rise[0] < peak < fall[0]:
        return math.nan
    return float((fall[0] - peak) / (peak - rise[0]))


def _is_worse(other: PulseFit, best: PulseFit, level: float, window: PulseWindow) -> bool:
    """Tell whether `other` leaves more than noise makes of two models that differ as these do.

    The difference of two sums of squares has the standard deviation 2 sigma |m1 - m2|.
    """
    degrees = window.time.size
    excess = (other.residual**2 - best.residual**2) * degrees
    chance = 2.0 * level * float(np.linalg.norm(other.fitted - best.fitted))
    return excess > TELLING_DIFFERENCE * chance


def _find_warning(best: ShapeFit, versed: ShapeFit, noise: float, *, told_apart: bool) -> str:
    doubtful = max(LARGEST_RESIDUAL, RESIDUAL_OVER_NOISE * noise)
    if best.residual_percent > 100.0 * max(POOR_RESIDUAL, RESIDUAL_OVER_NOISE * noise):
        return (
            f"no known shape describes the pulse: the best, {best.name}, leaves"
            f" {best.residual_percent:.2g} % of the peak, so that the contact time depends on how"
            " it is read"
        )
    if told_apart and best.contact_time > 0.0 and versed.residual_percent > 100.0 * doubtful:
        return (
            f"the pulse is no versed-sine, which leaves {versed.residual_percent:.2g} % of the"
            f" peak: {best.name} leaves {best.residual_percent:.2g} %, and makes the contact time"
            f" {best.contact_time * 1e6:.4g} us where the width times 2 gives"
            f" {versed.contact_time_from_width * 1e6:.4g} us"
        )
    return ""
