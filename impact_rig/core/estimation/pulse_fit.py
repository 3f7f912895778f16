"""Least squares of one pulse shape on the top of a trace, low-passed as the trace was."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.optimize import leastsq

from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.hits.pulse_width import TENTH_LEVEL, find_crossing
from impact_rig.core.model.pulses import LARGEST_ASYMMETRY, PulseShape, differentiate_pulse
from impact_rig.core.signals.filtering import (
    HIGHEST_RELATIVE_CUTOFF,
    MINIMUM_POINTS,
    low_pass,
)
from impact_rig.core.signals.record import FloatArray, make_read_only

FITTED = 5
"""Parameters of a fit: start, duration, asymmetry, amplitude and offset."""
FEWEST_POINTS = FITTED + 3
"""In the window of a pulse [-], our choice."""
MARGIN_BEFORE = 0.5
"""Baseline in the window before the pulse is at a tenth of its peak, in w50 [-], our choice: the
slow foot of a versed-sine takes 0.2 of it, the rest holds the offset."""
MARGIN_AFTER = 0.1
"""The same after the pulse [-], our choice: the foot, but not the ringing behind it."""
POINTS_PER_WIDTH = 96
"""Points of the model in w50, where the trace has so many [-], our choice: every second is
compared."""
KERNEL_REACH = 1.5
"""Half length of the low-pass's kernel, in periods of the cutoff [-], our choice: 1e-3 of it lies
outside."""
REMEMBERED_MATRICES = 4
"""Of the low-pass [-], our choice: the hits of a sample need one or two, of a megabyte or so."""
SHORTEST_DURATION = 0.5
"""Of a pulse, in w50 [-]: none is shorter than its own half-amplitude width."""
TOLERANCE = 1e-5
"""Relative change of sum of squares and of parameters that ends a fit [-], our choice: the contact
time is then within 5e-6 of its best value, a hundredth of what noise and scatter make of it."""
MOST_EVALUATIONS = 16
"""Of the model [-], our choice: a pulse needs four to seven; what is none runs out of all bounds,
and what it leaves no longer changes by more than a hundredth."""


@dataclass(frozen=True)
class PulseWindow:
    """What a pulse shape is fitted to: of unit height, in units of w50.

    Attributes
    ----------
    time : ndarray, shape (n,)
        From the middle of the pulse [w50].
    measured : ndarray, shape (n,)
        Over the peak [-].
    model_time : ndarray, shape (m,)
        Where the model is computed before it is filtered [w50].
    smoothing : ndarray, shape (n, m), or None
        The low-pass, from `model_time` to `time`; None: no filter that matters.
    step : int
        Points of the trace from one of `time` to the next.
    """

    time: FloatArray
    measured: FloatArray
    model_time: FloatArray
    smoothing: FloatArray | None
    step: int


@dataclass(frozen=True)
class PulseFit:
    """One shape on one window.

    Attributes
    ----------
    is_inside : bool
        False: the fit ended where no pulse is, and its parameters mean nothing.
    start, duration : float
        [w50]; the start counts from the middle of the pulse.
    asymmetry : float
        See `compute_pulse` [-].
    amplitude, offset : float
        Over the peak [-].
    fitted : ndarray, shape (n,)
        The fit, filtered.
    residual : float
        Standard deviation of what is left, over the peak [-].
    """

    is_inside: bool
    start: float
    duration: float
    asymmetry: float
    amplitude: float
    offset: float
    fitted: FloatArray
    residual: float


def cut_window(
    upright: FloatArray,
    peak_index: int,
    middle: float,
    width: float,
    relative_cutoff: float,
) -> PulseWindow:
    """Cut the pulse out of a trace, and prepare the low-pass for its model.

    Parameters
    ----------
    upright : ndarray, shape (n,)
        Trace of a positive pulse of unit peak.
    peak_index : int
        Its highest point.
    middle, width : float
        Of the pulse at half amplitude, in points.
    relative_cutoff : float
        Of the low-pass that the trace went through, over the sampling rate [-]; 0: none.

    Returns
    -------
    PulseWindow

    Raises
    ------
    NotDeterminedError
        If the trace does not come down to a tenth of the peak on both sides, or the pulse has too
        few points for a fit.
    """
    low, high = (find_crossing(upright, peak_index, TENTH_LEVEL, side) for side in (-1, 1))
    if math.isnan(low) or math.isnan(high):
        raise NotDeterminedError(
            "pulse shape: the trace does not come down to a tenth of the peak on both sides;"
            " record more"
        )
    fine = max(1, int(width / POINTS_PER_WIDTH))
    step = fine if width < POINTS_PER_WIDTH else 2 * fine
    first = max(0, math.ceil(low - MARGIN_BEFORE * width))
    last = min(upright.size, math.floor(high + MARGIN_AFTER * width) + 1)
    points = np.arange(first, last, step)
    if points.size < FEWEST_POINTS:
        raise NotDeterminedError(
            f"pulse shape: {points.size} points on the pulse do not tell it, {FEWEST_POINTS} may;"
            " sample faster"
        )
    model_points, smoothing = points, None
    # Above, the low-pass is shorter than a fortieth of the width.
    if 0.0 < relative_cutoff * fine <= HIGHEST_RELATIVE_CUTOFF:
        reach = _find_reach(relative_cutoff * fine)
        model_points = np.arange(first - fine * reach, points[-1] + fine * reach + 1, fine)
        smoothing = _make_smoothing(relative_cutoff * fine, points.size, step // fine)
    return PulseWindow(
        time=np.asarray((points - middle) / width, dtype=np.float64),
        measured=upright[points],
        model_time=np.asarray((model_points - middle) / width, dtype=np.float64),
        smoothing=smoothing,
        step=step,
    )


def _find_reach(relative_cutoff: float) -> int:
    """Return how far the low-pass reaches to either side [points]."""
    return max(math.ceil(KERNEL_REACH / relative_cutoff), MINIMUM_POINTS)


@lru_cache(maxsize=REMEMBERED_MATRICES)
def _make_smoothing(relative_cutoff: float, count: int, stride: int) -> FloatArray:
    """Return the low-pass as a matrix of `count` rows: each reads `stride` points further."""
    reach = _find_reach(relative_cutoff)
    impulse = np.zeros(4 * reach + 1)
    impulse[2 * reach] = 1.0
    half = low_pass(impulse, relative_cutoff, 1.0)[2 * reach : 3 * reach + 1]
    kernel = np.concatenate((half[:0:-1], half))
    margin = np.zeros((count - 1) * stride)
    padded = np.concatenate((margin, kernel / kernel.sum(), margin))
    rows = sliding_window_view(padded, kernel.size + margin.size)
    return make_read_only(np.ascontiguousarray(rows[::-stride][:count]))


def fit_pulse(window: PulseWindow, shape: PulseShape) -> PulseFit:
    """Fit start, duration, asymmetry, amplitude and offset of one shape."""
    problem = _PulseProblem(window, shape)
    duration = shape.pulse_factor
    # MINPACK itself: what `least_squares` puts around it takes longer than these fits.
    found = leastsq(
        problem.find_residual,
        np.array([-duration / 2.0, duration, 0.0, 1.0, 0.0]),
        Dfun=problem.find_jacobian,
        full_output=True,
        col_deriv=True,
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        maxfev=MOST_EVALUATIONS,
    )[0]
    residual = problem.find_residual(found)
    start, duration, asymmetry, amplitude, offset = (float(value) for value in found)
    is_inside = duration > SHORTEST_DURATION and abs(asymmetry) < LARGEST_ASYMMETRY
    return PulseFit(
        is_inside=is_inside,
        start=start,
        duration=duration,
        asymmetry=asymmetry,
        amplitude=amplitude,
        offset=offset,
        fitted=window.measured + residual,
        residual=float(np.sqrt(residual @ residual / (residual.size - FITTED))),
    )


class _PulseProblem:
    """Residual and Jacobian of one shape; keeps the last evaluation."""

    def __init__(self, window: PulseWindow, shape: PulseShape) -> None:
        self._window = window
        self._shape = shape
        self._at = b""
        self._residual = self._jacobian = window.measured

    def find_residual(self, parameters: FloatArray) -> FloatArray:
        """Return fitted minus measured, shape (n,)."""
        self._evaluate(parameters)
        return self._residual

    def find_jacobian(self, parameters: FloatArray) -> FloatArray:
        """Return its derivatives, shape (5, n)."""
        self._evaluate(parameters)
        return self._jacobian

    def _evaluate(self, parameters: FloatArray) -> None:
        if self._at == parameters.tobytes():
            return
        self._at = parameters.tobytes()
        start, duration, asymmetry, amplitude, offset = parameters.tolist()
        # What is no pulse at all may lead a step astray: it ends at the border.
        duration = max(duration, SHORTEST_DURATION)
        asymmetry = min(max(asymmetry, -LARGEST_ASYMMETRY), LARGEST_ASYMMETRY)
        rows = self._smooth_pulse(start, duration, asymmetry, amplitude)
        self._residual = amplitude * rows[3] + offset - self._window.measured
        self._jacobian = np.concatenate((rows, np.ones((1, rows.shape[1]))))

    def _smooth_pulse(
        self, start: float, duration: float, asymmetry: float, amplitude: float
    ) -> FloatArray:
        """Return derivatives in start, duration, asymmetry and amplitude, shape (4, n)."""
        times, smoothing = self._window.model_time, self._window.smoothing
        part = slice(None)
        if smoothing is not None:
            # What is zero need not be filtered.
            part = slice(*np.searchsorted(times, (start, start + duration)))
        pulse, derivatives = differentiate_pulse(
            times[part] - start, duration, self._shape, asymmetry
        )
        rows = np.concatenate((amplitude * derivatives, pulse[np.newaxis]))
        return rows if smoothing is None else rows @ smoothing[:, part].T
