"""A pulse of the contact law fitted to a window of the hammer's trace; what no fit can beat."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import leastsq

from impact_rig.core.estimation.pulse_shape import PulseWindow
from impact_rig.core.model.contact_law import (
    LARGEST_DAMPING,
    LARGEST_EXPONENT,
    SMALLEST_DAMPING,
    SMALLEST_EXPONENT,
    compute_pulses,
)
from impact_rig.core.signals.record import FloatArray

STARTING_EXPONENT, STARTING_DAMPING = 1.5, 0.1
"""Where a fit begins [-]: metal on metal."""
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
CONVERGED = (1, 2, 3, 4)
"""What MINPACK says of a fit that ended at its minimum."""
COUNT = 6
START, TIME, HEIGHT, OFFSET, DAMPING, EXPONENT = range(COUNT)
"""Places of the parameters; the last one is not varied where it is given."""


@dataclass(frozen=True)
class LawFit:
    """A pulse of the family on one window, in the window's units.

    Attributes
    ----------
    parameters : ndarray, shape (6,)
        Start and T [w50], height and offset over the peak, A and n [-].
    jacobian : ndarray, shape (varied, n)
        Derivatives of the fitted trace in the parameters that were varied.
    varied : list of int
        Their places.
    residual : float
        Standard deviation of what is left, over the peak [-].
    fitted : ndarray, shape (n,)
        The fitted trace, filtered.
    is_inside : bool
        False: the fit ended where no pulse is, and its parameters mean nothing.
    """

    parameters: FloatArray
    jacobian: FloatArray
    varied: list[int]
    residual: float
    fitted: FloatArray
    is_inside: bool

    def move_to(self, window: PulseWindow) -> "LawFit":
        """Return the same pulse on another window of the same trace, not fitted again."""
        problem = _LawProblem(window, float(self.parameters[EXPONENT]))
        residual = problem.compute_residual(self.parameters[self.varied])
        return replace(
            self,
            jacobian=problem.compute_jacobian(self.parameters[self.varied]),
            residual=_compute_deviation(residual, len(self.varied)),
            fitted=window.measured + residual,
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


def fit_law(window: PulseWindow, exponent: float | None = None) -> LawFit:
    """Fit a pulse of the family to a window, with n given or fitted."""
    varied = list(range(COUNT) if exponent is None else range(COUNT - 1))
    problem = _LawProblem(window, STARTING_EXPONENT if exponent is None else exponent)
    # MINPACK itself: what `least_squares` puts around it takes longer than these fits.
    found = leastsq(
        problem.compute_residual,
        problem.estimate_start()[varied],
        Dfun=problem.compute_jacobian,
        full_output=True,
        col_deriv=True,
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        maxfev=MOST_EVALUATIONS,
    )
    parameters = problem.complete(found[0])
    residual = problem.compute_residual(found[0])
    inside = SMALLEST_EXPONENT < parameters[EXPONENT] < LARGEST_EXPONENT
    inside = inside and SMALLEST_DAMPING < parameters[DAMPING] < LARGEST_DAMPING
    return LawFit(
        parameters=parameters,
        jacobian=problem.compute_jacobian(found[0]),
        varied=varied,
        residual=_compute_deviation(residual, len(varied)),
        fitted=window.measured + residual,
        is_inside=bool(inside and parameters[TIME] > SHORTEST_TIME and found[-1] in CONVERGED),
    )


def _compute_deviation(residual: FloatArray, fitted: int) -> float:
    return float(np.sqrt(residual @ residual / (residual.size - fitted)))


class _LawProblem:
    """Residual and Jacobian of the law; keeps the last evaluation."""

    def __init__(self, window: PulseWindow, exponent: float) -> None:
        self._window = window
        self._exponent = exponent
        self._at = b""
        self._residual = self._jacobian = window.measured

    def estimate_start(self) -> FloatArray:
        """Return parameters from the pulse's width and peak alone, shape (6,)."""
        pulse = compute_pulses(np.array([self._exponent]), np.array([STARTING_DAMPING]))
        times = np.linspace(0.0, pulse.duration[0], START_POINTS)
        force = pulse.compute_force(0, times)[0]
        above = times[force >= force.max() / 2.0]
        time = 1.0 / (above[-1] - above[0])
        middle = (above[-1] + above[0]) / 2.0
        return np.array(
            [-middle * time, time, 1.0 / force.max(), 0.0, STARTING_DAMPING, self._exponent]
        )

    def complete(self, varied: FloatArray) -> FloatArray:
        """Return all parameters, shape (6,), n and A within their limits."""
        parameters = np.append(varied, self._exponent)[:COUNT]
        parameters[EXPONENT] = min(max(parameters[EXPONENT], SMALLEST_EXPONENT), LARGEST_EXPONENT)
        parameters[DAMPING] = min(max(parameters[DAMPING], SMALLEST_DAMPING), LARGEST_DAMPING)
        parameters[TIME] = max(parameters[TIME], SHORTEST_TIME)
        return parameters

    def compute_residual(self, varied: FloatArray) -> FloatArray:
        """Return fitted minus measured, shape (n,)."""
        self._evaluate(varied)
        return self._residual

    def compute_jacobian(self, varied: FloatArray) -> FloatArray:
        """Return its derivatives, shape (varied, n)."""
        self._evaluate(varied)
        return self._jacobian

    def _evaluate(self, varied: FloatArray) -> None:
        if self._at == varied.tobytes():
            return
        self._at = varied.tobytes()
        start, time, height, offset, damping, exponent = self.complete(varied).tolist()
        pulses = compute_pulses(
            np.array([exponent, exponent, exponent + STEP]),
            np.array([damping, damping + STEP, damping]),
        )
        times, smoothing = self._window.model_time, self._window.smoothing
        part = slice(None)
        if smoothing is not None:
            # What is zero need not be filtered.
            end = start + time * float(pulses.duration.max())
            part = slice(*np.searchsorted(times, (start, end)))
        scaled = (times[part] - start) / time
        force, slope = pulses.compute_force(0, scaled)
        more_damping, more_exponent = (pulses.compute_force(i, scaled)[0] for i in (1, 2))
        rows = np.stack(
            [
                -height / time * slope,
                -height / time * slope * scaled,
                force,
                height / STEP * (more_damping - force),
                height / STEP * (more_exponent - force),
            ]
        )
        if smoothing is not None:
            rows = rows @ smoothing[:, part].T
        self._residual = height * rows[HEIGHT] + offset - self._window.measured
        self._jacobian = np.insert(rows, OFFSET, 1.0, axis=0)[: varied.size]


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
    jacobian = _LawProblem(window, exponent).compute_jacobian(parameters)
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
