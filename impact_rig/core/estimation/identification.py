"""Least squares of the two-body model on both mean traces together.

The low-passed model is laid onto the low-passed mean traces, each weighted by its noise. Since
the low-pass takes from the noise what the derivatives do not have, this is as good as white noise
allows, up to the Cramer-Rao bound. The derivatives are closed forms.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice

import numpy as np
from scipy.optimize import least_squares

from impact_rig.core.errors import NotDeterminedError, RigError
from impact_rig.core.estimation.identifiability import check_independence, find_undetermined
from impact_rig.core.estimation.measured_model import MeasuredModel
from impact_rig.core.estimation.starting_values import StartingValues, find_starts
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.hits.pulse_width import measure_pulse
from impact_rig.core.model.impact import ModelVariant
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.filtering import low_pass
from impact_rig.core.signals.record import FloatArray, make_read_only

EDGE = 1.5
"""Left out at both ends of the record, over 1 / cutoff [-]: the low-pass's padding disturbs them,
by e^-8 at that distance."""
LARGEST_EDGE_PART = 0.1
"""The same over the record at most [-], our choice."""
OVERSAMPLING = 3.0
"""Rate of the fitted points over twice the cutoff [-], our choice: what the low-pass leaves of
the noise beyond is 1e-4, so that nothing is lost by leaving out the points between."""
SMALLEST_NOISE = 1e-6
"""Noise over the peak that is assumed at least [-], our choice: a trace without noise would
weigh infinitely."""
GOOD_RESIDUAL = 0.02
"""RMS residual over the peak below which no other start is tried [-], our choice: a minimum that
is not the lowest leaves several times that."""
GOOD_CHI_SQUARE = 2.0
"""The same for the reduced chi-square [-]: noise alone does not reach it."""
STARTS = {ModelVariant.DRIVEN: 3, ModelVariant.PRINTED: 4}
"""Starts that are tried at most [-], our choice."""
TOLERANCE = 1e-9
"""Relative change of cost or parameters at which the search ends [-], our choice: far below what
noise does to them."""
MOST_EVALUATIONS = 60
"""Evaluations of the model per start [-], our choice: from a good start some six are enough."""
DURATION_RANGE = 5.0
"""tau_p lies within this factor of its start either way [-], our choice."""
STIFFNESS_RANGE = 1e6
"""k lies within this factor of m (pi / tau_p)^2 either way [-], our choice: no metal is outside."""
DAMPING_RANGE = 1e3
"""Largest c over 2 m pi / tau_p [-], our choice."""


@dataclass(frozen=True)
class Identification:
    """The model laid onto the mean traces of one sample.

    Attributes
    ----------
    variant : ModelVariant
        Which model.
    names : tuple of str
        Parameters: tau_p [s], t0 (start of the contact from the mean's first point) [s], k2
        [N/m], c2 [N s/m], F0 [N]; of the printed model also k1 [N/m] and c1 [N s/m]; gain of the
        sample's channel, signed [-], and offsets of hammer and sample [m/s^2].
    values : ndarray, shape (p,)
        [SI units]
    covariance : ndarray, shape (p, p)
        Of the mean traces' noise [SI units]; scaled up where `noise_factors` are above 1.
    noise_factors : ndarray, shape (2,)
        Birge ratio of each channel, 1 at least: residual over what white noise of the baseline's
        size would leave [-]. Above 1 the model does not describe the trace, or the noise is not
        white, and the covariance is larger by the square.
    hit_values : ndarray, shape (hits, p)
        Parameters of each hit, one Gauss-Newton step from `values` [SI units]. Their mean is
        `values`; their scatter holds what differs from hit to hit.
    sampling_rate : float
        [Hz]
    measured, model, residual : ndarray, shape (2, n)
        Mean traces, the low-passed model, and their difference [m/s^2].
    fitted : slice
        The points that were fitted, before thinning.
    residual_percent : tuple of float
        RMS of the residual over the trace's peak, hammer and sample [%].
    chi_square : float
        Reduced chi-square of both traces [-]; 1: nothing but noise is left.
    criterion : float
        Bayesian information criterion, sum of N ln(mean square over peak^2) over both traces plus
        p ln(2 N), where N = 2 * cutoff * duration is the number of independent points [-]. The
        smaller one describes the traces better; ten less is very strong evidence.
    undetermined : tuple of str
        What the traces do not determine, one sentence each.
    at_bounds : tuple of str
        Parameters that stand at the end of their range.
    notes : tuple of str
        What else must be known to read the values.
    """

    variant: ModelVariant
    names: tuple[str, ...]
    values: FloatArray
    covariance: FloatArray
    noise_factors: FloatArray
    hit_values: FloatArray
    sampling_rate: float
    measured: FloatArray
    model: FloatArray
    residual: FloatArray
    fitted: slice
    residual_percent: tuple[float, float]
    chi_square: float
    criterion: float
    undetermined: tuple[str, ...] = ()
    at_bounds: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def find(self, name: str) -> float:
        """Return the value of one parameter [its SI unit]."""
        return float(self.values[self.names.index(name)])

    @property
    def contact_time(self) -> float:
        """tau_p [s]."""
        return self.find("tau_p")

    @property
    def stiffness(self) -> float:
        """k2 [N/m]."""
        return self.find("k2")

    @property
    def damping_coefficient(self) -> float:
        """c2 [N s/m]."""
        return self.find("c2")

    @property
    def force_balance(self) -> float:
        """Force that the sample feels over force that the hammer feels, magnitudes [-].

        1 by Newton's third law if masses and calibrations are right. The printed model takes its
        force from v1 as well, and says less about it.
        """
        return abs(self.find("sample gain"))


def identify_model(
    mean: MeanHit,
    setup: RigSetup,
    sample: str,
    variant: ModelVariant = ModelVariant.DRIVEN,
    start: StartingValues | None = None,
) -> Identification:
    """Fit one variant of the model to both mean traces of a sample.

    Parameters
    ----------
    mean : MeanHit
        Both channels, either polarity.
    setup : RigSetup
        Masses, v1 and the low-pass; all are taken as exact.
    sample : str
        Which sample was struck.
    variant : ModelVariant
        How the bodies are driven.
    start : StartingValues or None
        What is already believed; poor values do no harm.

    Returns
    -------
    Identification

    Raises
    ------
    NotDeterminedError
        If the sample was not measured, the search does not converge, or the traces do not tell
        the parameters from each other.
    SignalError
        If the hammer's trace has no whole pulse.
    """
    if mean.traces.shape[0] <= 1:
        raise NotDeterminedError("identification: the sample's trace was not measured")
    peaks = np.abs(mean.traces).max(axis=1)
    if not np.all(np.isfinite(peaks) & (peaks > 0.0)):
        raise NotDeterminedError(
            "identification: a trace is flat or has points that are no numbers"
        )
    pulse = measure_pulse(mean.traces[0])
    measured = MeasuredModel(
        variant=variant,
        hammer_mass=setup.hammer_mass,
        moving_mass=setup.samples.find_moving_mass(sample),
        impact_speed=setup.impact_speed,
        sampling_rate=mean.sampling_rate,
        count=mean.traces.shape[1],
        cutoff_frequency=setup.analysis.cutoff_frequency,
        # In the printed model the sample pushes the hammer back; the driven one has F0 signed.
        hammer_polarity=-math.copysign(1.0, pulse.peak)
        if variant is ModelVariant.PRINTED
        else 1.0,
    )
    problem = _Problem(mean, measured, peaks)
    starts = find_starts(measured, mean.traces, pulse, start or StartingValues())
    best: _Solution | None = None
    for values in islice(starts, STARTS[variant]):
        found = problem.solve(values)
        if found is not None and (best is None or found.cost < best.cost):
            best = found
        if best is not None and problem.is_good(best):
            break
    if best is None:
        raise NotDeterminedError(
            f"identification: the search for the {variant.value} model did not converge within"
            f" {MOST_EVALUATIONS} evaluations from any start"
        )
    return _report(problem, best)


@dataclass(frozen=True)
class _Solution:
    """Where a search ended."""

    values: FloatArray
    cost: float
    at_bounds: tuple[str, ...]


class _Problem:
    """What is fitted, thinned and weighted."""

    def __init__(self, mean: MeanHit, measured: MeasuredModel, peaks: FloatArray) -> None:
        self.mean, self.measured, self.peaks = mean, measured, peaks
        rate, cutoff, count = measured.sampling_rate, measured.cutoff_frequency, measured.count
        edge, thinning, independent = 0, 1, 1.0
        if cutoff > 0.0:
            edge = min(math.ceil(EDGE * rate / cutoff), int(LARGEST_EDGE_PART * count))
            thinning = max(int(rate / (2.0 * cutoff * OVERSAMPLING)), 1)
            independent = min(2.0 * cutoff / rate, 1.0)
        self.fitted = slice(edge, count - edge)
        self.points = slice(edge, count - edge, thinning)
        self.independent_points = independent * (count - 2 * edge)
        """Of each trace."""
        self.noise = np.maximum(_find_raw_noise(mean), SMALLEST_NOISE * peaks)
        """White noise of the raw traces [m/s^2]."""
        self.filtered_noise = self.noise * find_noise_gain(cutoff, rate)
        self._last: tuple[FloatArray, FloatArray, FloatArray] | None = None

    def evaluate(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the model's traces and derivatives; the last ones are kept."""
        if self._last is None or not np.array_equal(self._last[0], values):
            traces, derivatives = self.measured.evaluate(values)
            self._last = (values.copy(), traces, derivatives)
        return self._last[1], self._last[2]

    def weigh(self, traces: FloatArray) -> FloatArray:
        """Return the fitted points of rows of both traces, weighted, shape (..., points)."""
        chosen = traces[..., self.points] / self.noise.reshape(2, *(1,) * (traces.ndim - 1))
        return np.concatenate([chosen[0], chosen[1]], axis=-1)

    def solve(self, start: FloatArray) -> _Solution | None:
        """Search from one start; None: not converged."""
        names = self.measured.names
        scales, low, high = self._find_scales_and_bounds(start)

        def find_residual(scaled: FloatArray) -> FloatArray:
            return self.weigh(self.evaluate(scaled * scales)[0] - self.mean.traces)

        def find_jacobian(scaled: FloatArray) -> FloatArray:
            return (self.weigh(self.evaluate(scaled * scales)[1]) * scales[:, np.newaxis]).T

        try:
            found = least_squares(
                find_residual,
                np.clip(start, low, high) / scales,
                jac=find_jacobian,
                bounds=(low / scales, high / scales),
                x_scale="jac",
                ftol=TOLERANCE,
                xtol=TOLERANCE,
                gtol=TOLERANCE,
                max_nfev=MOST_EVALUATIONS,
            )
        except (RigError, ValueError, np.linalg.LinAlgError):
            # The search ran into numbers that no float holds.
            return None
        if found.status <= 0 or not np.all(np.isfinite(found.x)):
            return None
        at_bounds = tuple(
            name for name, mark in zip(names, found.active_mask, strict=True) if mark
        )
        return _Solution(found.x * scales, float(found.cost), at_bounds)

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
        residual = (self.mean.traces - self.evaluate(values)[0])[:, self.points]
        return np.asarray(np.sqrt(np.mean(residual**2, axis=1)))

    def is_good(self, solution: _Solution) -> bool:
        """Whether no other start can do much better."""
        rms = self.find_residual_rms(solution.values)
        by_peak = rms < GOOD_RESIDUAL * self.peaks
        by_noise = rms**2 < GOOD_CHI_SQUARE * self.filtered_noise**2
        return bool(np.all(by_peak | by_noise)) and not solution.at_bounds


def _report(problem: _Problem, solution: _Solution) -> Identification:
    values, names = solution.values, problem.measured.names
    traces, derivatives = problem.evaluate(values)
    jacobian = problem.weigh(derivatives).T
    check_independence(names, jacobian)
    rms = problem.find_residual_rms(values)
    total = 2.0 * problem.independent_points
    freedom = max(total - len(names), 1.0)
    squares = (rms / problem.filtered_noise) ** 2 * total / freedom
    factors = np.sqrt(np.maximum(squares, 1.0))
    covariance = _find_covariance(problem, derivatives, factors)
    if not np.all(np.isfinite(covariance)):
        raise NotDeterminedError("identification: the covariance is no finite number")
    physical = [i for i, name in enumerate(names) if not name.endswith("offset")]
    mean_square = np.maximum(rms / problem.peaks, SMALLEST_NOISE) ** 2
    return Identification(
        variant=problem.measured.variant,
        names=names,
        values=make_read_only(values),
        covariance=make_read_only(covariance),
        noise_factors=make_read_only(factors),
        hit_values=make_read_only(_step_to_hits(problem, values, jacobian)),
        sampling_rate=problem.measured.sampling_rate,
        measured=problem.mean.traces,
        model=make_read_only(traces),
        residual=make_read_only(problem.mean.traces - traces),
        fitted=problem.fitted,
        residual_percent=(
            100.0 * float(rms[0] / problem.peaks[0]),
            100.0 * float(rms[1] / problem.peaks[1]),
        ),
        chi_square=float(np.mean(squares)),
        criterion=float(
            problem.independent_points * np.log(mean_square).sum() + len(names) * math.log(total)
        ),
        undetermined=find_undetermined(
            [names[i] for i in physical],
            covariance[np.ix_(physical, physical)],
            _find_relative_scales(names, values)[physical],
        ),
        at_bounds=solution.at_bounds,
        notes=_make_notes(problem, solution, rms, factors),
    )


def _find_covariance(
    problem: _Problem, derivatives: FloatArray, factors: FloatArray
) -> FloatArray:
    """Return the covariance of least squares on white noise that went through the low-pass."""
    inside = derivatives[:, :, problem.fitted]
    cutoff, rate = problem.measured.cutoff_frequency, problem.measured.sampling_rate
    # The noise is H e, so that the estimate J^T H e sees the derivatives filtered once more.
    seen = low_pass(inside, cutoff, rate)
    weights = problem.noise[:, np.newaxis, np.newaxis]
    information = np.zeros((inside.shape[1],) * 2)
    spread = np.zeros_like(information)
    lengths = np.sqrt(np.sum((inside / weights) ** 2, axis=(0, 2)))
    for channel in (0, 1):
        scale = problem.noise[channel] * lengths[:, np.newaxis]
        weighted, doubly = inside[channel] / scale, seen[channel] / scale
        information += weighted @ weighted.T
        spread += factors[channel] ** 2 * doubly @ doubly.T
    inverse = np.linalg.inv(information)
    covariance = inverse @ spread @ inverse / np.outer(lengths, lengths)
    return np.asarray((covariance + covariance.T) / 2.0)


def _step_to_hits(problem: _Problem, values: FloatArray, jacobian: FloatArray) -> FloatArray:
    """Return one Gauss-Newton step from the mean's solution for every hit."""
    mean = problem.mean
    lengths = np.linalg.norm(jacobian, axis=0)
    inverse = np.linalg.pinv(jacobian / lengths)
    model = problem.weigh(problem.evaluate(values)[0])
    hits = np.empty((mean.count, values.size))
    for index in range(mean.count):
        residual = problem.weigh(mean.cut_hit(index)) - model
        hits[index] = values + inverse @ residual / lengths
    return hits


def _find_relative_scales(names: tuple[str, ...], values: FloatArray) -> FloatArray:
    scales = np.abs(values)
    scales[names.index("t0")] = scales[names.index("tau_p")]
    # A damper of nothing has an uncertainty, but no relative one.
    smallest = np.finfo(float).tiny ** 0.25
    return np.asarray(np.maximum(scales, smallest))


def _make_notes(
    problem: _Problem, solution: _Solution, rms: FloatArray, factors: FloatArray
) -> tuple[str, ...]:
    notes = [f"{name} stands at the end of its range" for name in solution.at_bounds]
    for channel, trace in enumerate(("hammer", "sample")):
        if factors[channel] ** 2 > GOOD_CHI_SQUARE:
            notes.append(
                f"the {problem.measured.variant.value} model leaves"
                f" {100.0 * rms[channel] / problem.peaks[channel]:.2g} % of the {trace}'s peak,"
                f" {factors[channel]:.2g} times its noise: the covariance is scaled up by that"
            )
    return tuple(notes)


def _find_raw_noise(mean: MeanHit) -> FloatArray:
    """Return the mean's raw noise [m/s^2], at least that of the converters' steps, shape (2,)."""
    if not mean.hits:
        return np.asarray(mean.raw_noise)
    steps = np.sqrt(np.sum([hit.resolution**2 for hit in mean.hits], axis=0) / 12.0)
    return np.maximum(mean.raw_noise, steps / mean.count)


@lru_cache(maxsize=16)
def find_noise_gain(cutoff_frequency: float, sampling_rate: float) -> float:
    """Return the standard deviation that the low-pass leaves of white noise of 1 [-]."""
    if cutoff_frequency == 0.0:
        return 1.0
    reach = math.ceil(10.0 * sampling_rate / cutoff_frequency)
    impulse = np.zeros(2 * reach + 1)
    impulse[reach] = 1.0
    return float(np.linalg.norm(low_pass(impulse, cutoff_frequency, sampling_rate)))
