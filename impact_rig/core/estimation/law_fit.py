"""A pulse of the contact law fitted to a window of the hammer's trace; what no fit can beat."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from impact_rig.core.estimation.pulse_window import Evaluation, PulseWindow, WindowFit, minimise
from impact_rig.core.model.contact_law import (
    LARGEST_DAMPING,
    LARGEST_EXPONENT,
    SMALLEST_DAMPING,
    SMALLEST_EXPONENT,
    compute_pulses,
)
from impact_rig.core.signals.record import FloatArray, make_read_only

STARTING_EXPONENT, STARTING_DAMPING = 1.5, 0.1
"""Where a fit begins [-]: metal on metal."""
SHORTER = 0.8
"""T of a second start over that of the first [-], our choice."""
LARGEST_RESIDUAL = 0.01
"""What a law may leave over the peak [-], our choice."""
STEP = 1e-4
"""Of n and A, and relative of what else there is, for derivatives [-], our choice."""
TOLERANCE = 1e-6
"""Relative change of sum of squares and of parameters that ends a fit [-], our choice."""
MOST_EVALUATIONS = 40
"""Of the model [-], our choice: a pulse of the family needs five to ten."""
START_POINTS = 401
"""At which the half-amplitude width of the starting pulse is read [-]."""
SHORTEST_TIME = 0.05
"""T, in w50 [-]: no pulse of the family is so wide."""
COUNT = 6
START, TIME, HEIGHT, OFFSET, DAMPING, EXPONENT = range(COUNT)
"""Places of the parameters; the last one is not varied where it is given."""


@dataclass(frozen=True)
class LawFit(WindowFit):
    """A pulse of the family on one window, in the window's units.

    Attributes
    ----------
    parameters : ndarray, shape (6,)
        Start and T [w50], height and offset over the peak, A and n [-].
    jacobian : ndarray, shape (varied, n)
        Derivatives of the fitted trace in the parameters that were varied.
    varied : list of int
        Their places.
    """

    parameters: FloatArray
    jacobian: FloatArray
    varied: list[int]

    def move_to(self, window: PulseWindow) -> "LawFit":
        """Return the same pulse on another window of the same trace, not fitted again."""
        evaluation = evaluate_law(window, self.parameters, len(self.varied))
        return _describe_fit(
            window, self.parameters, self.varied, evaluation, is_inside=self.is_inside
        )

    def project(self, changes: FloatArray) -> FloatArray:
        """Return what changes of the trace, shape (n, k), do to the parameters, shape (6, k)."""
        moved = np.zeros((self.parameters.size, changes.shape[1]))
        moved[self.varied] = self._inverse @ changes
        return moved

    def compute_covariance(self, correlation: FloatArray) -> FloatArray:
        """Return what noise of variance 1 does to the parameters, shape (6, 6).

        Parameters
        ----------
        correlation : ndarray
            Of the noise, from 0 steps of the window on [-].
        """
        both_ways = np.concatenate((correlation[:0:-1], correlation))
        inverse = self._inverse
        reach = correlation.size - 1
        correlated = [np.convolve(row, both_ways)[reach : reach + row.size] for row in inverse]
        covariance = np.zeros((self.parameters.size, self.parameters.size))
        covariance[np.ix_(self.varied, self.varied)] = inverse @ np.stack(correlated, axis=1)
        return covariance

    @cached_property
    def _inverse(self) -> FloatArray:
        """Changes of the trace to those of the varied parameters, shape (varied, n)."""
        return np.asarray(np.linalg.pinv(self.jacobian.T))


def fit_law(
    window: PulseWindow, exponent: float | None = None, *, is_ringing: bool = False
) -> LawFit:
    """Fit a pulse of the family to a window, with n given or fitted.

    A sensor that rings moves width and peak, and makes several minima: then the search begins
    elsewhere too, unless it has found a law.
    """
    start = _estimate_start(STARTING_EXPONENT if exponent is None else exponent)
    fit = _search(window, start, exponent)
    if is_ringing and fit.residual > LARGEST_RESIDUAL:
        # Its middle stays: a pulse lasts some 3.2 T.
        begin = start[START] + (1.0 - SHORTER) * 1.6 * start[TIME]
        shorter = np.concatenate(([begin, SHORTER * start[TIME]], start[HEIGHT:]))
        fit = min(fit, _search(window, shorter, exponent), key=lambda one: one.residual)
    return fit


def _search(window: PulseWindow, start: FloatArray, exponent: float | None) -> LawFit:
    varied = list(range(COUNT) if exponent is None else range(COUNT - 1))
    fixed = STARTING_EXPONENT if exponent is None else exponent
    found, evaluation, converged = minimise(
        lambda parameters: evaluate_law(window, _complete(parameters, fixed), len(varied)),
        start[varied],
        TOLERANCE,
        MOST_EVALUATIONS,
    )
    parameters = _complete(found, fixed)
    inside = SMALLEST_EXPONENT < parameters[EXPONENT] < LARGEST_EXPONENT
    inside = inside and SMALLEST_DAMPING < parameters[DAMPING] < LARGEST_DAMPING
    inside = inside and parameters[TIME] > SHORTEST_TIME and converged
    return _describe_fit(window, parameters, varied, evaluation, is_inside=bool(inside))


def _describe_fit(
    window: PulseWindow,
    parameters: FloatArray,
    varied: list[int],
    evaluation: Evaluation,
    *,
    is_inside: bool,
) -> LawFit:
    residual, jacobian = evaluation
    return LawFit(
        parameters=parameters,
        jacobian=jacobian,
        varied=varied,
        residual=float(np.sqrt(residual @ residual / (residual.size - len(varied)))),
        fitted=window.measured + residual,
        is_inside=is_inside,
    )


def _complete(varied: FloatArray, exponent: float) -> FloatArray:
    """Return all parameters, shape (6,), n and A within their limits."""
    values = [*varied.tolist(), exponent][:COUNT]
    values[EXPONENT] = min(max(values[EXPONENT], SMALLEST_EXPONENT), LARGEST_EXPONENT)
    values[DAMPING] = min(max(values[DAMPING], SMALLEST_DAMPING), LARGEST_DAMPING)
    values[TIME] = max(values[TIME], SHORTEST_TIME)
    return np.array(values)


@lru_cache(maxsize=8)
def _estimate_start(exponent: float) -> FloatArray:
    """Return parameters from the pulse's width and peak alone, shape (6,)."""
    pulse = compute_pulses(np.array([exponent]), np.array([STARTING_DAMPING]))
    times = np.linspace(0.0, pulse.duration[0], START_POINTS)
    force = pulse.compute_force(times)[0][0]
    above = times[force >= force.max() / 2.0]
    time = 1.0 / (above[-1] - above[0])
    middle = (above[-1] + above[0]) / 2.0
    return make_read_only(
        np.array([-middle * time, time, 1.0 / force.max(), 0.0, STARTING_DAMPING, exponent])
    )


def evaluate_law(window: PulseWindow, parameters: FloatArray, varied: int = COUNT) -> Evaluation:
    """Return fitted minus measured, and its derivatives in the first `varied` parameters."""
    start, time, height, offset, damping, exponent = parameters.tolist()
    pulses = compute_pulses(
        np.array([exponent, exponent, exponent + STEP]),
        np.array([damping, damping + STEP, damping]),
    )
    part = window.find_part(start, start + time * float(pulses.duration.max()))
    scaled = (window.model_time[part] - start) / time
    (force, more_damping, more_exponent), slopes = pulses.compute_force(scaled)
    rows = np.empty((COUNT, scaled.size))
    rows[START] = -height / time * slopes[0]
    rows[TIME] = rows[START] * scaled
    rows[HEIGHT] = force
    rows[OFFSET] = 0.0
    rows[DAMPING] = height / STEP * (more_damping - force)
    rows[EXPONENT] = height / STEP * (more_exponent - force)
    shown = window.show(rows, part)
    shown[OFFSET] = 1.0
    return height * shown[HEIGHT] + offset - window.measured, shown[:varied]


@dataclass(frozen=True)
class LawBound:
    """Least standard deviations of unbiased estimates from one trace in white noise.

    Attributes
    ----------
    exponent, restitution : float
        [-]
    duration : float
        [s]
    """

    exponent: float
    restitution: float
    duration: float


def compute_law_bound(
    exponent: float, damping: float, time_unit: float, times: FloatArray, noise: float
) -> LawBound:
    """Compute the Cramer-Rao bound of the law, start, scales and offset unknown.

    Parameters
    ----------
    exponent, damping : float
        n and A = alpha v [-].
    time_unit : float
        T [s].
    times : ndarray, shape (n,)
        Of the points of the trace, from first touch [s].
    noise : float
        Standard deviation of each point, over the unit of acceleration v m_eq / (m1 T) [-].
    """
    scaled = times / time_unit
    window = PulseWindow(scaled, np.zeros(times.size), scaled, None, 1, slice(0, times.size))
    parameters = np.array([0.0, 1.0, 1.0, 0.0, damping, exponent])
    _, jacobian = evaluate_law(window, parameters)
    covariance = noise**2 * np.linalg.inv(jacobian @ jacobian.T)
    slopes = np.zeros((2, COUNT))
    for place in (TIME, DAMPING, EXPONENT):
        moved = parameters + STEP * np.eye(COUNT)[place]
        slopes[:, place] = (_describe_parting(moved) - _describe_parting(parameters)) / STEP
    duration, restitution = np.sqrt(np.diag(slopes @ covariance @ slopes.T)).tolist()
    return LawBound(
        exponent=float(np.sqrt(covariance[EXPONENT, EXPONENT])),
        restitution=restitution,
        duration=duration * time_unit,
    )


def _describe_parting(parameters: FloatArray) -> FloatArray:
    """Return duration, in the unit of T, and restitution."""
    pulse = compute_pulses(parameters[EXPONENT:], parameters[DAMPING:EXPONENT])
    return np.array([parameters[TIME] * pulse.duration[0], pulse.restitution[0]])
