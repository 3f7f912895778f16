"""Which shape a pulse has."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view

from impact_rig.core.errors import NotDeterminedError, check_not_negative
from impact_rig.core.filtering import HIGHEST_RELATIVE_CUTOFF, MINIMUM_POINTS, low_pass, respond
from impact_rig.core.hits import MeanHit
from impact_rig.core.pulse_width import TENTH_LEVEL, PulseWidth, find_crossing, measure_pulse
from impact_rig.core.pulses import (
    LARGEST_ASYMMETRY,
    PULSE_SHAPES,
    VERSED_SINE,
    PulseShape,
    differentiate_pulse,
)
from impact_rig.core.quantity import INTERNAL, Comparable, describe
from impact_rig.core.records import FloatArray, make_read_only
from impact_rig.core.sensors import FLAT, SensorResponse

FEWEST_POINTS = 8
"""In the window of a pulse [-], our choice: three more than most models have parameters."""
MARGIN_BEFORE = 0.5
"""Baseline in the window before the pulse is at a tenth of its peak, in w50 [-], our choice: the
slow foot of a versed-sine takes 0.2 of it, the rest holds the offset."""
MARGIN_AFTER = 0.1
"""The same after the pulse [-], our choice: the foot, but not the ringing behind it."""
POINTS_PER_WIDTH = 96
"""Points of the model in w50, where the trace has so many [-], our choice: every second is
compared."""
KERNEL_REACH = 2.0
"""Half length of the low-pass's kernel, in periods of the cutoff [-], our choice: 1e-5 of it lies
outside, and a law's n is off by less than noise of 0.02 % makes it."""
REMEMBERED_MATRICES = 8
"""Of low-pass and sensor [-], our choice: the hits of a sample need two, of a megabyte or so."""


@dataclass(frozen=True)
class PulseWindow:
    """What a pulse is fitted to: of unit height, in units of w50."""

    time: FloatArray  # (n,), from the middle of the pulse
    measured: FloatArray  # (n,), over the peak
    model_time: FloatArray  # (m,), where the model is computed before sensor and low-pass
    smoothing: FloatArray | None  # (n, m), sensor and low-pass; None: neither does anything
    step: int  # points of the trace from one of `time` to the next
    points: slice  # which points of the trace are `measured`

    def show(self, rows: FloatArray, part: slice) -> FloatArray:
        """Return models at `part` of `model_time`, zero elsewhere, as the trace shows them."""
        return rows if self.smoothing is None else rows @ self.smoothing[:, part].T

    def find_part(self, start: float, end: float) -> slice:
        """Return which points of `model_time` `show` needs of a pulse [w50]."""
        if self.smoothing is None:
            return slice(None)
        return slice(*np.searchsorted(self.model_time, (start, end)))


def cut_window(
    trace: FloatArray,
    pulse: PulseWidth,
    sampling_rate: float,
    cutoff_frequency: float,
    response: SensorResponse = FLAT,
    margins: tuple[float, float] = (MARGIN_BEFORE, MARGIN_AFTER),
) -> PulseWindow:
    """Cut the pulse out of a trace, and prepare what its models go through.

    Parameters
    ----------
    trace : ndarray, shape (n,)
        Either polarity.
    sampling_rate, cutoff_frequency : float
        Of the trace, and of the low-pass that it went through [Hz]; 0: none.
    margins : tuple of float
        How much lies before and behind where the pulse is at a tenth of its peak [w50].

    Returns
    -------
    PulseWindow

    Raises
    ------
    NotDeterminedError
        If the trace does not come down to a tenth of the peak on both sides, or the pulse has too
        few points for a fit.
    """
    upright, middle, width = trace / pulse.peak, pulse.middle, pulse.half_amplitude_width
    low, high = (find_crossing(upright, pulse.peak_index, TENTH_LEVEL, side) for side in (-1, 1))
    if math.isnan(low) or math.isnan(high):
        raise NotDeterminedError(
            "pulse shape: the trace does not come down to a tenth of the peak on both sides;"
            " record more"
        )
    fine = max(1, int(width / POINTS_PER_WIDTH))
    step = fine if width < POINTS_PER_WIDTH else 2 * fine
    first = max(0, math.ceil(low - margins[0] * width))
    last = min(upright.size, math.floor(high + margins[1] * width) + 1)
    points = np.arange(first, last, step)
    if points.size < FEWEST_POINTS:
        raise NotDeterminedError(
            f"pulse shape: {points.size} points on the pulse do not tell it, {FEWEST_POINTS} may;"
            " sample faster"
        )
    relative_cutoff = cutoff_frequency / sampling_rate * fine
    if relative_cutoff > HIGHEST_RELATIVE_CUTOFF:
        # The low-pass is shorter than a fortieth of the width.
        relative_cutoff = 0.0
    model_points, smoothing = points, None
    if relative_cutoff or not response.is_flat:
        rate = sampling_rate / fine
        relative = SensorResponse(
            response.resonance / rate, response.damping, response.low_corner / rate
        )
        reach = _compute_reach(relative_cutoff)
        model_points = np.arange(first - fine * reach, points[-1] + fine * reach + 1, fine)
        smoothing = _make_smoothing(relative_cutoff, relative, points.size, step // fine)
    return PulseWindow(
        time=np.asarray((points - middle) / width, dtype=np.float64),
        measured=upright[points],
        model_time=np.asarray((model_points - middle) / width, dtype=np.float64),
        smoothing=smoothing,
        step=step,
        points=slice(first, int(points[-1]) + 1, step),
    )


def _compute_reach(relative_cutoff: float) -> int:
    """Return how far the low-pass reaches to either side [points]."""
    if not relative_cutoff:
        return 0
    return max(math.ceil(KERNEL_REACH / relative_cutoff), MINIMUM_POINTS)


@lru_cache(maxsize=REMEMBERED_MATRICES)
def _make_smoothing(
    relative_cutoff: float, response: SensorResponse, count: int, stride: int
) -> FloatArray:
    """Return sensor and low-pass as a matrix of `count` rows: each reads `stride` points further.

    Cutoff and frequencies of the sensor are over the sampling rate.
    """
    reach = _compute_reach(relative_cutoff)
    kernel = np.ones(1)
    if reach:
        impulse = np.zeros(4 * reach + 1)
        impulse[2 * reach] = 1.0
        half = low_pass(impulse, relative_cutoff, 1.0)[2 * reach : 3 * reach + 1]
        kernel = np.concatenate((half[:0:-1], half))
        kernel /= kernel.sum()
    margin = np.zeros((count - 1) * stride)
    impulse = np.zeros(kernel.size + margin.size)
    impulse[0] = 1.0
    # What the sensor does lasts: it is cut where the window ends.
    both = np.convolve(respond(impulse, response, 1.0), kernel)[: impulse.size]
    rows = sliding_window_view(np.concatenate((both[::-1], margin)), impulse.size)
    return make_read_only(np.ascontiguousarray(rows[::-stride][:count]))


TELLING_DIFFERENCE = 2.0
"""How many standard deviations of what noise alone makes of it two sums of squares must differ by
[-], our choice: 95 %."""


@dataclass(frozen=True)
class WindowFit:
    """What a model that was fitted to a window leaves of it."""

    is_inside: bool  # False: the fit ended where no pulse is, and its parameters mean nothing
    fitted: FloatArray  # (n,), the fitted trace, filtered
    residual: float  # standard deviation of what is left, over the peak

    def is_worse(self, best: "WindowFit", level: float) -> bool:
        """Tell whether it leaves more than noise makes of two models that differ as these do.

        The difference of two sums of squares has the standard deviation 2 sigma |m1 - m2|; sigma
        of white noise is `level`, over the peak [-].
        """
        excess = (self.residual**2 - best.residual**2) * self.fitted.size
        chance = 2.0 * level * float(np.linalg.norm(self.fitted - best.fitted))
        return excess > TELLING_DIFFERENCE * chance


Evaluation = tuple[FloatArray, FloatArray]
"""Residual, shape (n,), and its derivatives, shape (parameters, n)."""


def minimise(
    evaluate: Callable[[FloatArray], Evaluation],
    start: FloatArray,
    tolerance: float,
    evaluations: int,
    bounds: tuple[FloatArray, FloatArray] | None = None,
) -> tuple[FloatArray, Evaluation, bool]:
    """Search the least sum of squares.

    Parameters
    ----------
    evaluate : callable
        Takes parameters, shape (p,).
    start : ndarray, shape (p,)
        Where to begin.
    tolerance : float
        Relative change of sum of squares and of parameters that ends the search [-].
    evaluations : int
        At most.
    bounds : pair of ndarray, shape (p,)
        Least and largest parameters; None: any.

    Returns
    -------
    tuple
        Parameters, the evaluation there, and whether the search ended at a minimum.
    """
    last: list[tuple[FloatArray, Evaluation]] = []

    def look_up(parameters: FloatArray) -> Evaluation:
        # Residual and derivatives are asked for apart, at the same place.
        if not last or not np.array_equal(last[0][0], parameters):
            last[:] = [(parameters.copy(), evaluate(parameters))]
        return last[0][1]

    found = scipy.optimize.least_squares(
        lambda parameters: look_up(parameters)[0],
        start,
        jac=lambda parameters: look_up(parameters)[1].T,
        method="lm" if bounds is None else "trf",
        bounds=bounds or (-np.inf, np.inf),
        x_scale="jac",
        ftol=tolerance,
        xtol=tolerance,
        gtol=1e-12,
        max_nfev=evaluations,
    )
    return found.x, look_up(found.x), found.status > 0


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
    """One shape on one window."""

    start: float  # from the middle of the pulse [w50]
    duration: float  # [w50]
    asymmetry: float  # see `compute_pulse`
    amplitude: float  # over the peak
    offset: float  # over the peak


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
CHANCE_EXCESS = 2.0
"""Square of a residual over that of the noise, up to which it is noise [-], our choice: the noise
of one baseline does not tell it better."""


@dataclass(frozen=True)
class ShapeFit(Comparable):
    """One shape fitted to the pulse; NaN: this shape has no parameters that come near."""

    shape: str
    residual_percent: float = NAN  # standard deviation of what is left, over the peak
    # F w50 with the shape's own F, blind to asymmetry and low-pass.
    contact_time: float = field(default=NAN, metadata=describe("s", "F w50", shown="µs"))
    # k2 with this contact time, and k1 read in the same way.
    stiffness: float = field(default=NAN, metadata=describe("N/m", "k", shown="MN/m"))
    # tau_p of the fit.
    duration: float = field(default=NAN, metadata=describe("s", "τp", shown="µs"))
    asymmetry: float = NAN  # the rise takes (1 + asymmetry) / 2 of the duration
    start_time: float = field(default=NAN, metadata=INTERNAL)  # from the middle of the pulse [s]
    amplitude: float = field(default=NAN, metadata=INTERNAL)  # signed [m/s^2]
    offset: float = field(default=NAN, metadata=INTERNAL)  # signed [m/s^2]


@dataclass(frozen=True)
class PulseShapeEstimate(Comparable):
    """What the mean hammer pulse looks like; NaN, or empty: not determined."""

    best_shape: str = ""  # name of the shape that leaves least
    is_told_apart: bool = False  # the next best shape leaves clearly more
    fall_over_rise: float = NAN  # times from the peak down to half of it and up to the peak
    fits: tuple[ShapeFit, ...] = ()  # in the order of `PULSE_SHAPES`
    # Why a versed-sine does not describe the pulse.
    warning: str = field(default="", metadata=INTERNAL)
    # Shapes that leave no more than the best, chance apart.
    possible: tuple[str, ...] = field(default=(), metadata=INTERNAL)
    # What the best leaves beyond the noise, over the peak.
    unexplained: float = field(default=math.inf, metadata=INTERNAL)

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
        possible=tuple(
            shape.name
            for shape, fit in zip(PULSE_SHAPES, fits, strict=True)
            if not fit.is_worse(best, level)
        ),
        unexplained=compute_unexplained(best.residual, noise),
    )


def compute_unexplained(residual: float, noise: float) -> float:
    """Return what is left of a pulse beyond the noise, both over its peak [-]."""
    return math.sqrt(max(residual**2 - CHANCE_EXCESS * noise**2, 0.0))


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
        top = scipy.interpolate.CubicSpline(np.arange(top.size), top)(points)
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
    if best.residual_percent > 100.0 * doubtful:
        return (
            f"no known shape describes the pulse: the best, {best.shape}, leaves"
            f" {best.residual_percent:.2g} % of the peak, as of two contacts, a sensor that rings,"
            " an amplifier that clips or filters; the uncertainty of the contact time holds all"
            " shapes"
        )
    if told_apart and best.duration > 0.0 and versed.residual_percent > 100.0 * doubtful:
        return (
            f"the pulse is no versed-sine: that leaves {versed.residual_percent:.2g} % of the"
            f" peak, {best.shape} {best.residual_percent:.2g} %, and with it the contact time is"
            f" {best.duration * 1e6:.4g} µs, where the width times 2 gives"
            f" {versed.contact_time * 1e6:.4g} µs"
        )
    return ""
