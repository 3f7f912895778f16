"""Least squares of the low-passed model on thinned, weighted mean traces.

Each search sees R of the QR decomposition of all derivatives and the residual: its last column
stands for the residual and the others for the derivatives, and lengths and angles are what they
were. It begins at several starts on few points, and ends on all points from the best.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import fftconvolve

from impact_rig.core.errors import NotDeterminedError, RigError
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.hits.pulse_width import measure_pulse
from impact_rig.core.identification.identifiability import GOOD_CHI_SQUARE, LARGEST_RESIDUAL
from impact_rig.core.identification.measured_model import MeasuredModel
from impact_rig.core.identification.starting_values import StartingValues, find_starts
from impact_rig.core.model.pulses import VERSED_SINE
from impact_rig.core.signals.filtering import low_pass
from impact_rig.core.signals.record import FloatArray, make_read_only

CORRELATION_REACH = 5.0
"""How far filtered noise is correlated, over 1 / cutoff [-]: beyond, less than e^-20 is left."""


def compute_raw_noise(mean: MeanHit) -> FloatArray:
    """Return the mean's raw noise [m/s^2], at least that of the converters' steps, shape (2,)."""
    if not mean.count:
        return np.asarray(mean.raw_noise)
    steps = np.sqrt(mean.summary.square_steps / 12.0)
    return np.asarray(np.maximum(mean.raw_noise, steps / mean.count))


@lru_cache(maxsize=16)
def compute_noise_correlation(
    cutoff_frequency: float, sampling_rate: float, step: int = 1
) -> FloatArray:
    """Compute what the low-pass makes of white noise of 1.

    Parameters
    ----------
    cutoff_frequency, sampling_rate : float
        Of the low-pass [Hz].
    step : int
        Points between those that are looked at.

    Returns
    -------
    ndarray, shape (2 k + 1,)
        Autocovariance from -k to k steps, its variance in the middle [-]; read-only.
    """
    if cutoff_frequency == 0.0:
        return make_read_only(np.ones(1))
    reach = math.ceil(CORRELATION_REACH * sampling_rate / cutoff_frequency)
    impulse = np.zeros(4 * reach + 1)
    impulse[2 * reach] = 1.0
    # The low-pass is symmetric in time, so that its autocorrelation is to apply it twice.
    for _ in range(2):
        impulse = low_pass(impulse, cutoff_frequency, sampling_rate)
    most = reach // step * step
    return make_read_only(impulse[2 * reach - most : 2 * reach + most + 1 : step])


EDGE = 1.5
"""Left out at both ends of the record, over 1 / cutoff [-]: the low-pass's padding disturbs them,
by e^-8 at that distance."""
LARGEST_EDGE_PART = 0.1
"""The same over the record at most [-], our choice."""
OVERSAMPLING = 3.0
"""Rate of the fitted points over twice the cutoff [-], our choice: what the low-pass leaves of
the noise beyond is 1e-4, so that nothing is lost by leaving out the points between."""
COARSE_POINTS = 40
"""Points in a contact on which the search begins [-], our choice: the traces are smooth."""
SMALLEST_NOISE = 1e-5
"""Noise over the peak that is assumed at least [-], our choice: a trace without noise would
weigh infinitely."""
TOLERANCE = 1e-5
"""Relative change of cost or parameters at which the search ends [-], our choice: the last step
has then left far less, since Gauss-Newton steps shrink by their square."""
DURATION_RANGE = 5.0
"""tau_p lies within this factor of its start either way [-], our choice."""
STIFFNESS_RANGE = 1e6
"""k lies within this factor of m (pi / tau_p)^2 either way [-], our choice: beyond lies
no metal."""
DAMPING_RANGE = 1e3
"""Largest c over 2 m pi / tau_p [-], our choice."""


@dataclass(frozen=True)
class FitSolution:
    """Where a search ended.

    Attributes
    ----------
    values : ndarray, shape (p,)
        Parameters [SI units].
    cost : float
        Half the weighted sum of squares [-].
    converged : bool
        False: the search used up its evaluations.
    at_bounds : tuple of str
        Parameters at the end of their range.
    """

    values: FloatArray
    cost: float
    converged: bool
    at_bounds: tuple[str, ...]


class FitProblem:
    """The model on the fitted points of two mean traces, each weighted by its noise.

    Parameters
    ----------
    traces : ndarray, shape (2, n)
        Mean traces [m/s^2].
    noise : ndarray, shape (2,)
        White noise of the mean traces before the low-pass [m/s^2].

    Attributes
    ----------
    points : slice
        Those that are fitted: the padding of the low-pass does not reach them.
    independent_points : float
        Of each trace, 2 * cutoff * duration [-].
    peaks : ndarray, shape (2,)
        Largest magnitudes of the traces [m/s^2].
    noise, filtered_noise : ndarray, shape (2,)
        White noise before the low-pass, and what that leaves of it [m/s^2].
    """

    def __init__(self, traces: FloatArray, noise: FloatArray, measured: MeasuredModel) -> None:
        self.traces, self.measured = traces, measured
        self.peaks = np.abs(traces).max(axis=1)
        rate, cutoff, count = measured.sampling_rate, measured.cutoff_frequency, measured.count
        edge, thinning, independent = 0, 1, 1.0
        if cutoff > 0.0:
            thinning = max(int(rate / (2.0 * cutoff * OVERSAMPLING)), 1)
            edge = min(math.ceil(EDGE * rate / cutoff), int(LARGEST_EDGE_PART * count))
            # Points that the thinned problem has as well: both then end at the same values.
            edge = math.ceil(edge / thinning) * thinning
            independent = min(2.0 * cutoff / rate, 1.0)
        self.points = slice(edge, count - edge, thinning)
        self.independent_points = independent * (count - 2 * edge)
        self.noise = np.maximum(noise, SMALLEST_NOISE * self.peaks)
        variance = compute_noise_correlation(cutoff, rate)
        self.filtered_noise = self.noise * math.sqrt(variance[variance.size // 2])
        self._last: tuple[FloatArray, FloatArray, FloatArray] | None = None

    def thin(self) -> "FitProblem":
        """Return the same problem on every few points: quick to solve, and nearly as good."""
        measured = self.measured
        width = measure_pulse(self.traces[0]).half_amplitude_width
        step = int(VERSED_SINE.pulse_factor * width / COARSE_POINTS)
        if measured.cutoff_frequency > 0.0:
            step = min(step, self.points.step)
        if step <= 1:
            return self
        traces = self.traces[:, ::step]
        return FitProblem(
            traces,
            # As much noise below the cutoff, at fewer points.
            self.noise / math.sqrt(step),
            replace(
                measured,
                sampling_rate=measured.sampling_rate / step,
                count=traces.shape[1],
            ),
        )

    def evaluate(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the model's traces and derivatives at the fitted points; the last are kept."""
        if self._last is None or not np.array_equal(self._last[0], values):
            self._last = (values.copy(), *self.measured.evaluate(values, self.points))
        return self._last[1], self._last[2]

    def weigh(self, rows: FloatArray) -> FloatArray:
        """Return rows of both traces, weighted and joined: shape (2, ..., m) to (..., 2 m)."""
        weighted = rows / self.noise.reshape(2, *(1,) * (rows.ndim - 1))
        return np.concatenate([weighted[0], weighted[1]], axis=-1)

    def solve(
        self, start: FloatArray, evaluations: int, tolerance: float = TOLERANCE
    ) -> FitSolution | None:
        """Search for the least sum of squares.

        Parameters
        ----------
        start : ndarray, shape (p,)
            Where to begin [SI units].
        evaluations : int
            Of the model at most.
        tolerance : float
            Relative change of cost or parameters at which the search ends [-].

        Returns
        -------
        FitSolution or None
            None: the search ran into numbers that no float holds.
        """
        # Without bounds it is quicker, and as a rule they are not met.
        free = self._minimise(start, evaluations, tolerance, bounded=False)
        return free or self._minimise(start, evaluations, tolerance, bounded=True)

    def _minimise(
        self, start: FloatArray, evaluations: int, tolerance: float, *, bounded: bool
    ) -> FitSolution | None:
        scales, low, high = self._find_scales_and_bounds(start)

        last: dict[bytes, FloatArray] = {}

        def rotate(scaled: FloatArray) -> FloatArray:
            """Return R; the last is kept: residual and derivatives are asked for apart."""
            key = scaled.tobytes()
            if key not in last:
                traces, derivatives = self.evaluate(scaled * scales)
                residual = traces - self.traces[:, self.points]
                rows = self.weigh(np.concatenate([derivatives, residual[:, np.newaxis]], axis=1))
                rows[:-1] *= scales[:, np.newaxis]
                last.clear()
                last[key] = np.asarray(np.linalg.qr(rows.T, mode="r"))
            return last[key]

        try:
            found = least_squares(
                lambda scaled: rotate(scaled)[:, -1],
                np.clip(start, low, high) / scales,
                jac=lambda scaled: rotate(scaled)[:, :-1],
                method="trf" if bounded else "lm",
                bounds=(low / scales, high / scales) if bounded else (-np.inf, np.inf),
                x_scale="jac",
                ftol=tolerance,
                xtol=tolerance,
                gtol=tolerance,
                max_nfev=evaluations,
            )
        except (RigError, ValueError, np.linalg.LinAlgError):
            # It strayed to where the model has no meaning.
            return None
        values = found.x * scales
        if not (np.all(np.isfinite(values)) and math.isfinite(found.cost)):
            return None
        if not bounded and np.any((values <= low) | (values >= high)):
            return None
        at_bounds = tuple(
            name for name, mark in zip(self.measured.names, found.active_mask, strict=True) if mark
        )
        return FitSolution(values, float(found.cost), found.status > 0, at_bounds)

    def _find_scales_and_bounds(
        self, start: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        given = dict(zip(self.measured.names, start.tolist(), strict=True))
        tau = given["tau_p"]
        ranges: dict[str, tuple[float, float, float]] = {
            "tau_p": (tau, tau / DURATION_RANGE, tau * DURATION_RANGE),
            "t0": (tau, given["t0"] - DURATION_RANGE * tau, given["t0"] + DURATION_RANGE * tau),
            "F0": (abs(given["F0"]) or 1.0, -math.inf, math.inf),
            "sample gain": (abs(given["sample gain"]) or 1.0, -math.inf, math.inf),
            "hammer offset": (float(self.peaks[0]), -math.inf, math.inf),
            "sample offset": (float(self.peaks[1]), -math.inf, math.inf),
        }
        for body, mass in (("1", self.measured.hammer_mass), ("2", self.measured.moving_mass)):
            stiffness = mass * (math.pi / tau) ** 2
            damping = 2.0 * mass * math.pi / tau
            ranges["k" + body] = (
                stiffness, stiffness / STIFFNESS_RANGE, stiffness * STIFFNESS_RANGE,
            )  # fmt: skip
            ranges["c" + body] = (damping, 0.0, damping * DAMPING_RANGE)
        table = np.array([ranges[name] for name in self.measured.names])
        return table[:, 0], table[:, 1], table[:, 2]

    def compute_residual_rms(self, values: FloatArray) -> FloatArray:
        """Return the RMS residual of both traces over the fitted points [m/s^2], shape (2,)."""
        residual = self.traces[:, self.points] - self.evaluate(values)[0]
        return np.asarray(np.sqrt(np.mean(residual**2, axis=1)))

    def compute_covariance(self, values: FloatArray, factors: FloatArray) -> FloatArray:
        """Compute the covariance of the parameters for white noise that went through the low-pass.

        Parameters
        ----------
        values : ndarray, shape (p,)
            Parameters [SI units].
        factors : ndarray, shape (2,)
            By which the noise of each trace is larger than `noise` [-].

        Returns
        -------
        ndarray, shape (p, p)
            [SI units]
        """
        weighted = self.evaluate(values)[1] / self.noise[:, np.newaxis, np.newaxis]
        lengths = np.sqrt(np.sum(weighted**2, axis=(0, 2)))
        weighted /= lengths[:, np.newaxis]
        measured = self.measured
        correlation = compute_noise_correlation(
            measured.cutoff_frequency, measured.sampling_rate, self.points.step
        )
        # Least squares is (J^T J)^-1 J^T r, and r has the covariance C of filtered noise.
        seen = fftconvolve(weighted, correlation[np.newaxis, np.newaxis], mode="same", axes=-1)
        information = np.einsum("cip,cjp->ij", weighted, weighted)
        spread = np.einsum("c,cip,cjp->ij", factors**2, weighted, seen, optimize=True)
        inverse = np.linalg.inv(information)
        covariance = inverse @ spread @ inverse / np.outer(lengths, lengths)
        return np.asarray((covariance + covariance.T) / 2.0)

    def step_to_hits(self, values: FloatArray, hits: Sequence[FloatArray]) -> FloatArray:
        """Take one Gauss-Newton step from the mean's solution to every hit.

        Parameters
        ----------
        values : ndarray, shape (p,)
            Solution for the mean [SI units].
        hits : sequence of ndarray, shape (2, n)
            Traces of the hits, aligned as the mean's [m/s^2].

        Returns
        -------
        ndarray, shape (hits, p)
            [SI units]
        """
        traces, derivatives = self.evaluate(values)
        jacobian = self.weigh(derivatives).T
        lengths = np.linalg.norm(jacobian, axis=0)
        inverse = np.linalg.pinv(jacobian / lengths)
        steps = [inverse @ self.weigh(hit[:, self.points] - traces) / lengths for hit in hits]
        return np.asarray(values + np.array(steps).reshape(-1, values.size))


MOST_STARTS = 4
"""That are tried at most [-], our choice."""
FIRST_EVALUATIONS = 15
"""Evaluations of the model from each start [-], our choice: a good one needs some ten."""
MOST_EVALUATIONS = 50
"""The same when the search goes on from the best [-], our choice."""
ROUGH_TOLERANCE = 1e-4
"""Relative change of cost or parameters at which the search on few points ends [-], our choice:
the one on all points goes on from there."""
HOPELESS_RESIDUAL = 2.0 * LARGEST_RESIDUAL
"""RMS residual over the peak that no search goes on from [-], our choice: of traces that a model
describes, a few steps from one of the starts leave less."""
EQUAL_COST = 1e-3
"""Relative difference of cost below which two minima are one [-], our choice."""
GOOD_RESIDUAL = 0.02
"""RMS residual over the peak below which no other start is tried [-], our choice: a minimum that
is not the lowest leaves several times that."""


class MisfitError(NotDeterminedError):
    """The search found no parameters that come near the traces."""


def find_best_fit(problem: FitProblem, given: StartingValues) -> FitSolution:
    """Search on every few points from several starts, then on all from the best.

    Raises
    ------
    MisfitError
        If the search does not converge.
    SignalError
        If the hammer's trace has no whole pulse.
    """
    coarse = problem.thin()
    starts = find_starts(coarse.measured, coarse.traces, given)
    solution = _search(coarse, islice(starts, MOST_STARTS))
    if coarse is problem:
        return solution
    refined = problem.solve(solution.values, MOST_EVALUATIONS)
    if refined is None or not refined.converged:
        raise MisfitError(_describe_failure(problem, refined))
    return refined


def _search(problem: FitProblem, starts: Iterable[FloatArray]) -> FitSolution:
    """Look a few steps from several starts, and go on from the best."""
    best: FitSolution | None = None
    for values in starts:
        found = problem.solve(values, FIRST_EVALUATIONS, ROUGH_TOLERANCE)
        if found is None:
            continue
        if best is None or found.cost < (1.0 - EQUAL_COST) * best.cost:
            best = found
        elif found.converged and found.cost < (1.0 + EQUAL_COST) * best.cost:
            # Two ways lead to the same place.
            break
        if _is_good(problem, best):
            return best
    if best is not None and not best.converged and not _is_hopeless(problem, best):
        best = problem.solve(best.values, MOST_EVALUATIONS, ROUGH_TOLERANCE)
    if best is None or not best.converged:
        raise MisfitError(_describe_failure(problem, best))
    return best


def _is_hopeless(problem: FitProblem, solution: FitSolution) -> bool:
    """Whether the model is too far from a trace to come near it."""
    rms = problem.compute_residual_rms(solution.values)
    return bool(np.any(rms > HOPELESS_RESIDUAL * problem.peaks))


def _describe_failure(problem: FitProblem, last: FitSolution | None) -> str:
    text = f"identification: the search for the {problem.measured.variant.value} model "
    if last is None:
        return text + "failed from every start"
    left = 100.0 * problem.compute_residual_rms(last.values) / problem.peaks
    return (
        f"{text}did not converge, and leaves {left[0]:.2g} % of the hammer's and"
        f" {left[1]:.2g} % of the sample's peak"
    )


def _is_good(problem: FitProblem, solution: FitSolution) -> bool:
    """Whether no other start can do much better."""
    rms = problem.compute_residual_rms(solution.values)
    by_peak = rms < GOOD_RESIDUAL * problem.peaks
    by_noise = rms**2 < GOOD_CHI_SQUARE * problem.filtered_noise**2
    return solution.converged and not solution.at_bounds and bool(np.all(by_peak | by_noise))
