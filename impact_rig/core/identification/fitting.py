"""One least-squares problem: the low-passed model on thinned, weighted mean traces."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import fftconvolve

from impact_rig.core.errors import RigError
from impact_rig.core.hits.pulse_width import measure_pulse
from impact_rig.core.identification.filtered_noise import find_noise_correlation
from impact_rig.core.identification.measured_model import MeasuredModel
from impact_rig.core.identification.rotation import RotatedProblem
from impact_rig.core.model.pulses import VERSED_SINE
from impact_rig.core.signals.record import FloatArray

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
    measured : MeasuredModel
        What is fitted.

    Attributes
    ----------
    fitted : slice
        What the padding of the low-pass does not reach.
    points : slice
        Those of them that are fitted.
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
        self.fitted = slice(edge, count - edge)
        self.points = slice(edge, count - edge, thinning)
        self.independent_points = independent * (count - 2 * edge)
        self.noise = np.maximum(noise, SMALLEST_NOISE * self.peaks)
        variance = find_noise_correlation(cutoff, rate)
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

        def evaluate(scaled: FloatArray) -> FloatArray:
            traces, derivatives = self.evaluate(scaled * scales)
            residual = traces - self.traces[:, self.points]
            rows = self.weigh(np.concatenate([derivatives, residual[:, np.newaxis]], axis=1))
            rows[:-1] *= scales[:, np.newaxis]
            return rows

        rotated = RotatedProblem(evaluate)
        try:
            found = least_squares(
                rotated.find_residual,
                np.clip(start, low, high) / scales,
                jac=rotated.find_jacobian,
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

    def find_residual_rms(self, values: FloatArray) -> FloatArray:
        """Return the RMS residual of both traces over the fitted points [m/s^2], shape (2,)."""
        residual = self.traces[:, self.points] - self.evaluate(values)[0]
        return np.asarray(np.sqrt(np.mean(residual**2, axis=1)))

    def find_covariance(self, values: FloatArray, factors: FloatArray) -> FloatArray:
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
        correlation = find_noise_correlation(
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
