"""Shape of a pulse."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from impact_rig.core.given.errors import NotDeterminedError
from impact_rig.core.given.filtering import HIGHEST_RELATIVE_CUTOFF, Chain, low_pass, respond
from impact_rig.core.given.findings import Note, Subject
from impact_rig.core.given.quantity import INTERNAL, NOT_NEGATIVE, Comparable, describe
from impact_rig.core.given.records import FloatArray, make_read_only
from impact_rig.core.hit.pulse_width import TENTH_LEVEL, PulseWidth, find_crossing, measure_pulse
from impact_rig.core.hit.pulses import PULSE_SHAPES, VERSED_SINE, PulseShape, differentiate_pulse
from impact_rig.core.mean.mean_hit import MeanHit

FEWEST_POINTS = 8
"""In a window [-], our choice: three more than most models have parameters."""
MARGINS = (0.5, 0.1)
"""Baseline before and behind a tenth of the peak [w50], our choice: the slow foot of a
versed-sine takes 0.2, the rest holds the offset; ringing behind the pulse stays out."""
POINTS_PER_WIDTH = 96
"""Points of the model in w50 [-], our choice; every second is compared."""
LARGE_RESIDUAL = 0.005
"""Of a shape, over the peak [-], our choice: a versed-sine leaves 0.6 % of a Hertz pulse and makes
k 17 % too low, of a half-sine 3.2 % and 44 %."""
ITERATIONS = 50
"""Of a search at most [-], our choice: a pulse needs 4 to 7, and noise does not converge."""
LAST_STEP = 0.3
"""Of a search, over what noise makes of the parameters [-], our choice."""
FIRST_DAMPING = 1e-3
"""Damping of a search's first step, over a derivative's squared length [-], our choice."""


@dataclass(frozen=True)
class PulseWindow:
    """A shape that is fitted to a pulse, of unit height, in units of w50."""

    time: FloatArray  # (n,), from the middle of the pulse
    measured: FloatArray  # (n,), over the peak
    model_time: FloatArray  # (m,), where the model is computed before sensor and low-pass
    smoothing: FloatArray  # (n, m), sensor and low-pass
    step: int  # points of the trace from one of `time` to the next
    points: slice  # which points of the trace are `measured`

    def show(self, rows: FloatArray, part: slice) -> FloatArray:
        """Return models at `part` of `model_time`, zero elsewhere, as the trace shows them."""
        return np.asarray(rows @ self.smoothing[:, part].T)

    def find_part(self, start: float, end: float) -> slice:
        """Return which points of `model_time` `show` needs of a pulse [w50]."""
        return slice(*np.searchsorted(self.model_time, (start, end)))


def cut_window(
    trace: FloatArray,
    pulse: PulseWidth,
    chain: Chain,
    margins: tuple[float, float] = MARGINS,
) -> PulseWindow:
    """Cut the pulse out of a trace, and prepare what its models go through.

    Parameters
    ----------
    trace : ndarray, shape (n,)
        Either polarity.
    chain : Chain
        What the trace went through.
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
            "the trace does not come down to a tenth of the peak on both sides; record more"
        )
    fine = max(1, int(width / POINTS_PER_WIDTH))
    step = fine if width < POINTS_PER_WIDTH else 2 * fine
    first = max(0, math.ceil(low - margins[0] * width))
    last = min(upright.size, math.floor(high + margins[1] * width) + 1)
    points = np.arange(first, last, step)
    if points.size < FEWEST_POINTS:
        raise NotDeterminedError(
            f"{points.size} points on the pulse do not tell it, {FEWEST_POINTS} may; sample faster"
        )
    chain = chain.count_points(fine)
    if chain.cutoff_frequency > HIGHEST_RELATIVE_CUTOFF:
        # The low-pass is shorter than a fortieth of the width.
        chain = replace(chain, cutoff_frequency=0.0)
    reach = _compute_reach(chain.cutoff_frequency)
    model_points = np.arange(first - fine * reach, points[-1] + fine * reach + 1, fine)
    return PulseWindow(
        time=np.asarray((points - middle) / width, dtype=np.float64),
        measured=upright[points],
        model_time=np.asarray((model_points - middle) / width, dtype=np.float64),
        smoothing=_make_smoothing(chain, points.size, step // fine),
        step=step,
        points=slice(first, int(points[-1]) + 1, step),
    )


def _compute_reach(relative_cutoff: float) -> int:
    """Return how far the low-pass reaches to either side [points]."""
    if not relative_cutoff:
        return 0
    # 1e-5 of the kernel lies outside: a law's n is off by less than noise of 0.02 % makes it.
    return max(math.ceil(2.0 / relative_cutoff), 16)


@lru_cache(maxsize=8)
def _make_smoothing(chain: Chain, count: int, stride: int) -> FloatArray:
    """Return sensor and low-pass as a matrix of `count` rows: each reads `stride` points further.

    The chain counts points.
    """
    reach = _compute_reach(chain.cutoff_frequency)
    kernel = np.ones(1)
    if reach:
        impulse = np.zeros(4 * reach + 1)
        impulse[2 * reach] = 1.0
        half = low_pass(impulse, chain.cutoff_frequency, 1.0)[2 * reach : 3 * reach + 1]
        kernel = np.concatenate((half[:0:-1], half))
        kernel /= kernel.sum()
    margin = np.zeros((count - 1) * stride)
    impulse = np.zeros(kernel.size + margin.size)
    impulse[0] = 1.0
    # What the sensor does lasts: it is cut where the window ends.
    both = np.convolve(respond(impulse, chain.response, 1.0), kernel)[: impulse.size]
    rows = sliding_window_view(np.concatenate((both[::-1], margin)), impulse.size)
    return make_read_only(np.ascontiguousarray(rows[::-stride][:count]))


@dataclass(frozen=True)
class WindowFit:
    """Residual of a model that was fitted to a window."""

    parameters: FloatArray  # (p,)
    jacobian: FloatArray  # (p, n), of the fitted trace in them; 0 in those that were not varied
    is_inside: bool  # False: the fit ended where no pulse is, and its parameters mean nothing
    fitted: FloatArray  # (n,), the fitted trace, filtered
    residual: float  # standard deviation of what is left, over the peak

    def is_worse(self, best: "WindowFit", level: float) -> bool:
        """Return whether it leaves more than noise makes of two models that differ as these do.

        The difference of two sums of squares has the standard deviation 2 sigma |m1 - m2|; sigma
        of white noise is `level`, over the peak [-].
        """
        excess = (self.residual**2 - best.residual**2) * self.fitted.size
        chance = 2.0 * level * float(np.linalg.norm(self.fitted - best.fitted))
        # Beyond chance: 95 %.
        return excess > 2.0 * chance

    def project(self, changes: FloatArray) -> FloatArray:
        """Return by how much changes of the trace, shape (n, ...), change the parameters."""
        return np.asarray(self._inverse @ changes)

    def find_rest(self, change: FloatArray) -> float:
        """Return the RMS of the part of a change, shape (n,), that no parameter can follow."""
        return float(np.std(change - self.jacobian.T @ self.project(change)))

    def compute_covariance(self, correlation: FloatArray) -> FloatArray:
        """Return the covariance of the parameters by noise of variance 1, shape (p, p).

        Parameters
        ----------
        correlation : ndarray
            Of the noise, from 0 steps of the window on [-].
        """
        both_ways = np.concatenate((correlation[:0:-1], correlation))
        inverse = self._inverse
        reach = correlation.size - 1
        correlated = [np.convolve(row, both_ways)[reach : reach + row.size] for row in inverse]
        return np.asarray(inverse @ np.stack(correlated, axis=1))

    @cached_property
    def _inverse(self) -> FloatArray:
        """Changes of the trace to those of the parameters, shape (p, n)."""
        return np.asarray(np.linalg.pinv(self.jacobian.T))


Evaluation = tuple[FloatArray, FloatArray]
"""Residuals of k models, shape (k, n), and their derivatives, shape (k, p, n)."""


Evaluate = Callable[[FloatArray, NDArray[np.intp]], Evaluation]
"""Takes parameters, shape (k, p), and the numbers of the models that they are of, shape (k,)."""


def fit_window(
    measured: FloatArray,
    evaluate: Evaluate,
    start: FloatArray,
    bounds: FloatArray,
    find_most: Callable[[FloatArray], float] = lambda _: math.inf,
) -> list[WindowFit]:
    """Search the least sum of squares of each of k models (Marquardt 1963).

    Parameters
    ----------
    measured : ndarray, shape (n,) or (k, n)
        What each model is fitted to.
    start : ndarray, shape (k, p)
        Where to begin.
    bounds : ndarray, shape (2, k, p)
        Least and largest parameters; equal for one that is not varied.
    find_most : callable
        From the sums of squares of all models to the largest that is still of use: a model that
        stays above it is given up.
    """
    found = np.clip(start, *bounds)
    residual, jacobian = evaluate(found, np.arange(len(found)))
    squares = np.sum(residual**2, axis=-1)
    damping, middle = np.full(len(found), FIRST_DAMPING), squares
    is_found = np.zeros(len(found), dtype=bool)
    for count in range(ITERATIONS):
        if count == ITERATIONS // 2:
            middle = squares.copy()
        gradient = (jacobian @ residual[..., np.newaxis])[..., 0]
        # A parameter stays at its bound where less would be left beyond it.
        is_held = np.where(gradient > 0.0, found <= bounds[0], found >= bounds[1])
        products = jacobian @ jacobian.swapaxes(1, 2)
        lengths = np.sqrt(np.diagonal(products, axis1=1, axis2=2))
        lengths = np.where(lengths > 0.0, lengths, 1.0)
        free = ~is_held / lengths
        normal = products * free[:, :, np.newaxis] * free[:, np.newaxis]
        normal += np.eye(start.shape[1]) * (damping[:, np.newaxis] + is_held)[:, np.newaxis]
        step = -free * np.linalg.solve(normal, (gradient * free)[..., np.newaxis])[..., 0]
        change = (products @ step[..., np.newaxis])[..., 0]
        gain = -np.sum((2.0 * gradient + change) * step, axis=1)
        # A step that is small beside what noise makes of the parameters is the last.
        is_last = gain <= LAST_STEP**2 * squares / residual.shape[1]
        is_found |= is_last
        is_useless = squares - 10.0 * gain > find_most(squares)
        # Up to the first bound: a step that is bent there goes astray.
        room = np.where(step > 0.0, bounds[1], bounds[0]) - found
        part = np.divide(room, step, out=np.ones_like(step), where=(step != 0.0) & (room != 0.0))
        moved = np.clip(found + np.minimum(part.min(axis=1), 1.0)[:, np.newaxis] * step, *bounds)
        which = np.flatnonzero(~is_found & ~is_useless)
        if not which.size:
            # It is taken along the derivatives.
            last = np.where(is_last[:, np.newaxis], moved - found, 0.0)
            found = found + last
            residual = residual + (last[:, np.newaxis] @ jacobian)[:, 0]
            break
        tried, derivatives = evaluate(moved[which], which)
        left = np.sum(tried**2, axis=-1)
        is_better = left < squares[which]
        damping[which] = np.where(
            is_better,
            damping[which] / 5.0,
            10.0 * np.maximum(damping[which], FIRST_DAMPING),
        )
        better, left = which[is_better], left[is_better]
        # A pulse that jumps at touch has a rough minimum: less is a twentieth of noise's effect.
        is_found[better] = squares[better] - left < 1e-5 * squares[better]
        found[better], squares[better] = moved[better], left
        residual[better], jacobian[better] = tried[is_better], derivatives[is_better]
    else:
        # In a flat valley the second half gains little.
        is_found |= middle - squares <= 0.1 * squares
    is_varied = bounds[0] < bounds[1]
    is_inside = ((bounds[0] < found) & (found < bounds[1]) | ~is_varied).all(axis=1)
    return [
        WindowFit(
            parameters=parameters,
            jacobian=np.where(varied[:, np.newaxis], slopes, 0.0),
            is_inside=bool(inside),
            fitted=trace + left,
            residual=math.sqrt(left @ left / (left.size - varied.sum())),
        )
        for parameters, left, slopes, trace, varied, inside in zip(
            found,
            residual,
            jacobian,
            np.broadcast_to(measured, residual.shape),
            is_varied,
            is_inside & is_found,
            strict=True,
        )
    ]


START, DURATION, ASYMMETRY, AMPLITUDE, OFFSET = range(5)
"""Places of a shape's parameters."""
LEAST, MOST = (-np.inf, 0.5, -0.9, -np.inf, -np.inf), (np.inf, np.inf, 0.9, np.inf, np.inf)


def fit_shapes(window: PulseWindow, shapes: Sequence[PulseShape]) -> list[WindowFit]:
    """Fit start and duration [w50], asymmetry [-], amplitude and offset over the peak [-]."""

    def evaluate(parameters: FloatArray, which: NDArray[np.intp]) -> Evaluation:
        starts, ends = parameters[:, START], parameters[:, START] + parameters[:, DURATION]
        part = window.find_part(starts.min(), ends.max())
        rows = np.zeros((which.size, 5, window.model_time[part].size))
        for row, number, (start, duration, asymmetry, amplitude, _) in zip(
            rows, which.tolist(), parameters.tolist(), strict=True
        ):
            pulse, derivatives = differentiate_pulse(
                window.model_time[part] - start, duration, shapes[number], asymmetry
            )
            row[:AMPLITUDE], row[AMPLITUDE] = amplitude * derivatives, pulse
        shown = window.show(rows, part)
        shown[:, OFFSET] = 1.0
        fitted = np.sum(parameters[:, AMPLITUDE:, np.newaxis] * shown[:, AMPLITUDE:], axis=1)
        return fitted - window.measured, shown

    start = np.array(
        [(-one.pulse_factor / 2.0, one.pulse_factor, 0.0, 1.0, 0.0) for one in shapes]
    )
    bounds = np.broadcast_to(np.array([LEAST, MOST])[:, np.newaxis], (2, *start.shape))
    return fit_window(window.measured, evaluate, start, bounds)


NAN = math.nan


@dataclass(frozen=True)
class ShapeFit(Comparable):
    """One shape fitted to the pulse; NaN: this shape has no parameters that come near."""

    shape: str
    # standard deviation of what is left, over the peak
    residual_percent: float = field(default=NAN, metadata=NOT_NEGATIVE)
    # F w50 with the shape's own F, blind to asymmetry and low-pass.
    contact_time: float = field(default=NAN, metadata=describe("s", "F w50", shown="µs"))
    # k2 with this contact time, and k1 read in the same way.
    stiffness: float = field(default=NAN, metadata=describe("N/m", "k", shown="MN/m"))
    # tau_p of the fit.
    duration: float = field(default=NAN, metadata=describe("s", "τp", shown="µs"))
    # The rise takes (1 + asymmetry) / 2 of the duration.
    asymmetry: float = field(default=NAN, metadata=describe(least=-1.0, most=1.0))


@dataclass(frozen=True)
class PulseShapeEstimate(Comparable):
    """Shape of the mean hammer pulse; NaN, or empty: not determined."""

    best_shape: str = ""  # name of the shape that leaves least
    is_clear: bool = False  # the next best shape leaves clearly more
    # of the best shape's durations
    fall_over_rise: float = field(default=NAN, metadata=NOT_NEGATIVE)
    fits: tuple[ShapeFit, ...] = ()  # in the order of `PULSE_SHAPES`
    # Why a versed-sine does not describe the pulse.
    warning: Note | None = field(default=None, metadata=INTERNAL)
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


def estimate_pulse_shape(mean: MeanHit, chain: Chain) -> PulseShapeEstimate:
    """Fit every pulse shape to the hammer's mean trace and compare what they leave.

    Parameters
    ----------
    chain : Chain
        What the hammer's trace went through; the shapes go through it as well.

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
    rate = mean.sampling_rate
    pulse = measure_pulse(mean.traces[0])
    width = pulse.half_amplitude_width
    window = cut_window(mean.traces[0], pulse, chain)
    fits = fit_shapes(window, PULSE_SHAPES)
    shape_fits = tuple(
        ShapeFit(
            shape=shape.name,
            residual_percent=100.0 * fit.residual,
            contact_time=shape.pulse_factor * width / rate,
            duration=float(fit.parameters[DURATION]) * width / rate if fit.is_inside else NAN,
            asymmetry=float(fit.parameters[ASYMMETRY]) if fit.is_inside else NAN,
        )
        for shape, fit in zip(PULSE_SHAPES, fits, strict=True)
    )
    noise = float(mean.noise[0]) / abs(pulse.peak)
    white = float(mean.raw_noise[0]) / abs(pulse.peak) / math.sqrt(window.step)
    order = np.argsort([fit.residual for fit in fits])
    best, versed = fits[order[0]], fits[PULSE_SHAPES.index(VERSED_SINE)]
    # What even the best shape leaves makes the others' differences less telling.
    level = white * max(1.0, best.residual / noise) if noise > 0.0 else best.residual
    asymmetry = shape_fits[order[0]].asymmetry
    return PulseShapeEstimate(
        best_shape=shape_fits[order[0]].shape,
        fall_over_rise=(1.0 - asymmetry) / (1.0 + asymmetry),
        fits=shape_fits,
        is_clear=fits[order[1]].is_worse(best, level),
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


def compute_unexplained(residual: float, noise: float, points: float = FEWEST_POINTS) -> float:
    """Return the residual of a pulse beyond the noise, both over its peak [-].

    Parameters
    ----------
    points : float
        At which noise is independent [-].
    """
    # Two standard deviations of what noise alone leaves.
    largest = noise**2 * (1.0 + 2.0 * math.sqrt(2.0 / points))
    return math.sqrt(max(residual**2 - largest, 0.0))


def _find_warning(
    best: ShapeFit, versed: ShapeFit, noise: float, *, told_apart: bool
) -> Note | None:
    doubtful = max(LARGE_RESIDUAL, 3.0 * noise)
    if best.residual_percent > 100.0 * doubtful:
        return Note(
            Subject.PULSE_SHAPE,
            f"no known shape describes the pulse: the best, {best.shape}, leaves"
            f" {best.residual_percent:.2g} % of the peak, as of two contacts, a sensor that rings,"
            " an amplifier that clips or filters; the uncertainty of the contact time holds the"
            " known shapes, and not this one",
        )
    if told_apart and best.duration > 0.0 and versed.residual_percent > 100.0 * doubtful:
        return Note(
            Subject.PULSE_SHAPE,
            f"the pulse is no versed-sine: that leaves {versed.residual_percent:.2g} % of the"
            f" peak, {best.shape} {best.residual_percent:.2g} %, and with it the contact time is"
            f" {best.duration * 1e6:.4g} µs, where the width times 2 gives"
            f" {versed.contact_time * 1e6:.4g} µs",
        )
    return None
