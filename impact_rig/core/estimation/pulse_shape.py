"""Which pulse the hammer's mean trace shows, and what the contact time is if it is that one.

tau_p = 2 w50 belongs to a versed-sine. Under another shape the same width means another contact
time, and stiffness goes with its inverse square. Each shape is laid onto the top of the trace by
least squares, low-passed as the trace was.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline

from impact_rig.core.checks import check_not_negative
from impact_rig.core.estimation.pulse_window import (
    Evaluation,
    PulseWindow,
    WindowFit,
    cut_window,
    minimise,
)
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.hits.pulse_width import PulseWidth, find_crossing, measure_pulse
from impact_rig.core.model.pulses import (
    LARGEST_ASYMMETRY,
    PULSE_SHAPES,
    VERSED_SINE,
    PulseShape,
    differentiate_pulse,
)
from impact_rig.core.quantity import INTERNAL, describe
from impact_rig.core.setup.sensors import FLAT, SensorResponse
from impact_rig.core.signals.record import FloatArray

FITTED = 5
"""Parameters of a fit: start, duration, asymmetry, amplitude and offset."""
SHORTEST_DURATION = 0.5
"""Of a pulse, in w50 [-]: none is shorter than its own half-amplitude width."""
TOLERANCE = 1e-5
"""Relative change of sum of squares and of parameters that ends a fit [-], our choice: the contact
time is then within 5e-6 of its best value, a hundredth of what noise and scatter make of it."""
MOST_EVALUATIONS = 16
"""Of the model [-], our choice: a pulse needs four to seven; what is none runs out of all bounds,
and what it leaves no longer changes by more than a hundredth."""


@dataclass(frozen=True)
class PulseFit(WindowFit):
    """One shape on one window.

    Attributes
    ----------
    start, duration : float
        [w50]; the start counts from the middle of the pulse.
    asymmetry : float
        See `compute_pulse` [-].
    amplitude, offset : float
        Over the peak [-].
    """

    start: float
    duration: float
    asymmetry: float
    amplitude: float
    offset: float


def fit_pulse(window: PulseWindow, shape: PulseShape) -> PulseFit:
    """Fit start, duration, asymmetry, amplitude and offset of one shape."""

    def evaluate(parameters: FloatArray) -> Evaluation:
        start, duration, asymmetry, amplitude, offset = parameters.tolist()
        # What is no pulse at all may lead a step astray: it ends at the border.
        duration = max(duration, SHORTEST_DURATION)
        asymmetry = min(max(asymmetry, -LARGEST_ASYMMETRY), LARGEST_ASYMMETRY)
        part = window.find_part(start, start + duration)
        pulse, derivatives = differentiate_pulse(
            window.model_time[part] - start, duration, shape, asymmetry
        )
        rows = window.show(np.concatenate((amplitude * derivatives, pulse[np.newaxis])), part)
        residual = amplitude * rows[3] + offset - window.measured
        return residual, np.concatenate((rows, np.ones((1, rows.shape[1]))))

    duration = shape.pulse_factor
    begin = np.array([-duration / 2.0, duration, 0.0, 1.0, 0.0])
    found, (residual, _), _ = minimise(evaluate, begin, TOLERANCE, MOST_EVALUATIONS)
    start, duration, asymmetry, amplitude, offset = found.tolist()
    return PulseFit(
        is_inside=duration > SHORTEST_DURATION and abs(asymmetry) < LARGEST_ASYMMETRY,
        start=start,
        duration=duration,
        asymmetry=asymmetry,
        amplitude=amplitude,
        offset=offset,
        fitted=window.measured + residual,
        residual=float(np.sqrt(residual @ residual / (residual.size - FITTED))),
    )


NAN = math.nan
TOP_LEVELS = (0.5, 0.9, 9)
"""First, last and number of the levels, over the peak [-], our choice: above, noise moves the
crossings."""
SPLINE_POINTS = 64
SPLINE_MARGIN = 3
"""A pulse of fewer points at half amplitude than `SPLINE_POINTS` is interpolated, with so many
points about it [-], our choice."""
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
    shape : str
        Its name.
    residual_percent : float
        Standard deviation of what is left over the pulse, over the peak [%].
    contact_time : float
        F w50 with the shape's own F, blind to asymmetry and low-pass [s].
    stiffness : float
        k2 with this contact time, and k1 read in the same way [N/m].
    duration : float
        tau_p of the fit [s].
    asymmetry : float
        Of the fit [-]: the rise takes (1 + asymmetry) / 2 of its duration.
    start_time : float
        Of the fit, from the middle of the pulse at half amplitude [s].
    amplitude, offset : float
        Of the fit, signed [m/s^2].
    """

    shape: str
    residual_percent: float = NAN
    contact_time: float = field(default=NAN, metadata=describe("s", "F w50", shown="µs"))
    stiffness: float = field(default=NAN, metadata=describe("N/m", "k", shown="MN/m"))
    duration: float = field(default=NAN, metadata=describe("s", "τp", shown="µs"))
    asymmetry: float = NAN
    start_time: float = field(default=NAN, metadata=INTERNAL)
    amplitude: float = field(default=NAN, metadata=INTERNAL)
    offset: float = field(default=NAN, metadata=INTERNAL)


@dataclass(frozen=True)
class PulseShapeEstimate:
    """What the mean hammer pulse looks like; NaN, or empty: not determined.

    Attributes
    ----------
    best_shape : str
        Name of the shape that leaves least.
    is_told_apart : bool
        The next best shape leaves clearly more than the best.
    fall_over_rise : float
        Time from the peak down to half of it over the time up to the peak [-]; NaN: the pulse
        has no one peak.
    fits : tuple of ShapeFit
        One for each of `PULSE_SHAPES`, in their order.
    warning : str
        Why a versed-sine does not describe the pulse; empty: it does.
    """

    best_shape: str = ""
    is_told_apart: bool = False
    fall_over_rise: float = NAN
    fits: tuple[ShapeFit, ...] = ()
    warning: str = field(default="", metadata=INTERNAL)

    @property
    def best_fit(self) -> ShapeFit | None:
        """The fit that leaves least."""
        return self.find_fit(self.best_shape)

    def find_fit(self, shape: str) -> ShapeFit | None:
        """Return the fit of the shape called so, if there is one."""
        return next((fit for fit in self.fits if fit.shape == shape), None)


NO_SHAPE = PulseShapeEstimate()
"""Where it is not determined."""


def estimate_pulse_shape(
    mean: MeanHit, cutoff_frequency: float, response: SensorResponse = FLAT
) -> PulseShapeEstimate:
    """Fit every pulse shape to the hammer's mean trace and compare what they leave.

    Parameters
    ----------
    cutoff_frequency : float
        Of the low-pass that the traces went through [Hz], which the shapes go through as well;
        0: none.
    response : SensorResponse
        Of the hammer's sensor, which they go through before.

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
    window = cut_window(mean.traces[0], pulse, rate, cutoff_frequency, response)
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
        best_shape=shape_fits[order[0]].shape,
        fall_over_rise=_compare_sides(upright, pulse),
        fits=shape_fits,
        is_told_apart=fits[order[1]].is_worse(best, level),
        warning=_find_warning(
            shape_fits[order[0]],
            shape_fits[PULSE_SHAPES.index(VERSED_SINE)],
            noise,
            told_apart=versed.is_worse(best, level),
        ),
    )


def _scale_fit(fit: PulseFit, shape: PulseShape, width: float, peak: float) -> ShapeFit:
    known = 1.0 if fit.is_inside else math.nan
    return ShapeFit(
        shape=shape.name,
        contact_time=shape.pulse_factor * width,
        duration=known * fit.duration * width,
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


def _find_warning(best: ShapeFit, versed: ShapeFit, noise: float, *, told_apart: bool) -> str:
    doubtful = max(LARGEST_RESIDUAL, RESIDUAL_OVER_NOISE * noise)
    if best.residual_percent > 100.0 * max(POOR_RESIDUAL, RESIDUAL_OVER_NOISE * noise):
        return (
            f"no known shape describes the pulse: the best, {best.shape}, leaves"
            f" {best.residual_percent:.2g} % of the peak, so that the contact time depends on how"
            " it is read"
        )
    if told_apart and best.duration > 0.0 and versed.residual_percent > 100.0 * doubtful:
        return (
            f"the pulse is no versed-sine: that leaves {versed.residual_percent:.2g} % of the"
            f" peak, {best.shape} {best.residual_percent:.2g} %, and with it the contact time is"
            f" {best.duration * 1e6:.4g} µs, where the width times 2 gives"
            f" {versed.contact_time * 1e6:.4g} µs"
        )
    return ""
