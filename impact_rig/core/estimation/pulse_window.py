"""The pulse cut out of a hammer's trace, what its models go through, and the fit of one to it."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.optimize import leastsq

from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.hits.pulse_width import TENTH_LEVEL, PulseWidth, find_crossing
from impact_rig.core.setup.sensors import FLAT, SensorResponse
from impact_rig.core.signals.filtering import HIGHEST_RELATIVE_CUTOFF, MINIMUM_POINTS, low_pass
from impact_rig.core.signals.record import FloatArray, make_read_only
from impact_rig.core.signals.sensor_response import respond

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
CONVERGED = (1, 2, 3, 4)
"""What MINPACK says of a fit that ended at its minimum."""


@dataclass(frozen=True)
class PulseWindow:
    """What a pulse is fitted to: of unit height, in units of w50.

    Attributes
    ----------
    time : ndarray, shape (n,)
        From the middle of the pulse [w50].
    measured : ndarray, shape (n,)
        Over the peak [-].
    model_time : ndarray, shape (m,)
        Where the model is computed before sensor and low-pass [w50].
    smoothing : ndarray, shape (n, m), or None
        Sensor and low-pass, from `model_time` to `time`; None: neither does anything.
    step : int
        Points of the trace from one of `time` to the next.
    points : slice
        Which points of the trace are `measured`.
    """

    time: FloatArray
    measured: FloatArray
    model_time: FloatArray
    smoothing: FloatArray | None
    step: int
    points: slice

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
    """What a model that was fitted to a window leaves of it.

    Attributes
    ----------
    is_inside : bool
        False: the fit ended where no pulse is, and its parameters mean nothing.
    fitted : ndarray, shape (n,)
        The fitted trace, filtered.
    residual : float
        Standard deviation of what is left, over the peak [-].
    """

    is_inside: bool
    fitted: FloatArray
    residual: float

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

    Returns
    -------
    tuple
        Parameters, the evaluation there, and whether the search ended at a minimum.
    """
    known: dict[bytes, Evaluation] = {}

    def look_up(parameters: FloatArray) -> Evaluation:
        # Residual and derivatives are asked for apart, at the same place.
        key = parameters.tobytes()
        if key not in known:
            known[key] = evaluate(parameters)
        return known[key]

    # MINPACK itself: what `least_squares` puts around it takes longer than these fits.
    found = leastsq(
        lambda parameters: look_up(parameters)[0],
        start,
        Dfun=lambda parameters: look_up(parameters)[1],
        full_output=True,
        col_deriv=True,
        ftol=tolerance,
        xtol=tolerance,
        maxfev=evaluations,
    )
    return found[0], look_up(found[0]), found[-1] in CONVERGED
