"""Least squares of the two-body model on both mean traces together.

The low-passed model is laid onto the low-passed mean traces, each weighted by its noise. Since
the low-pass takes from the noise what the derivatives do not have, this is as good as white noise
allows, up to the Cramer-Rao bound.
"""

import math
from dataclasses import dataclass

import numpy as np

from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.identification.fitting import (
    SMALLEST_NOISE,
    FitProblem,
    FitSolution,
    compute_raw_noise,
    find_best_fit,
)
from impact_rig.core.identification.identifiability import (
    LARGEST_RESIDUAL,
    check_independence,
    describe_misfit,
    explain_covariance,
    find_undetermined,
)
from impact_rig.core.identification.measured_model import OFFSETS, MeasuredModel
from impact_rig.core.identification.starting_values import StartingValues
from impact_rig.core.model.impact import ModelVariant
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import FloatArray, make_read_only


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
        Of the mean traces' noise [SI units]; scaled up by the square of each channel's
        Birge ratio, residual over what white noise of the baseline's size would leave, where
        that is above 1. Start and offsets scatter more: alignment and baseline have moved them
        before.
    hit_values : ndarray, shape (hits, p)
        Parameters of each hit, one Gauss-Newton step from `values` [SI units]. Their mean is
        `values`; their scatter holds what differs from hit to hit.
    measured, model, residual : ndarray, shape (2, n)
        Mean traces, the low-passed model, and their difference [m/s^2].
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
    notes : tuple of str
        What else must be known to read the values.
    """

    variant: ModelVariant
    names: tuple[str, ...]
    values: FloatArray
    covariance: FloatArray
    hit_values: FloatArray
    measured: FloatArray
    model: FloatArray
    residual: FloatArray
    residual_percent: tuple[float, float]
    chi_square: float
    criterion: float
    undetermined: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def find(self, name: str) -> float:
        """Return the value of one parameter [its SI unit]."""
        return float(self.values[self.names.index(name)])

    @property
    def describes_traces(self) -> bool:
        """Whether the residual of both traces is below `LARGEST_RESIDUAL`."""
        return max(self.residual_percent) <= 100.0 * LARGEST_RESIDUAL

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
        Masses, v1, sensors and the low-pass; all are taken as exact.
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
    if variant is ModelVariant.PRINTED and math.isnan(setup.impact_speed):
        raise NotDeterminedError("identification of the printed model: v1 is not known")
    peaks = np.abs(mean.traces).max(axis=1)
    if not np.all(np.isfinite(peaks) & (peaks > 0.0)):
        raise NotDeterminedError(
            "identification: a trace is flat or has points that are no numbers"
        )
    polarity = float(np.sign(mean.traces[0, np.argmax(np.abs(mean.traces[0]))]))
    measured = MeasuredModel(
        variant=variant,
        hammer_mass=setup.hammer_mass,
        moving_mass=setup.samples.get_moving_mass(sample),
        impact_speed=float(np.nan_to_num(setup.impact_speed)),
        sampling_rate=mean.sampling_rate,
        count=mean.traces.shape[1],
        cutoff_frequency=setup.analysis.cutoff_frequency,
        # In the printed model the sample pushes the hammer back; the driven one has F0 signed.
        hammer_polarity=-polarity if variant is ModelVariant.PRINTED else 1.0,
        responses=setup.responses,
    )
    problem = FitProblem(mean.traces, compute_raw_noise(mean), measured)
    solution = find_best_fit(problem, start or StartingValues())
    return _report(problem, solution, mean)


def _report(problem: FitProblem, solution: FitSolution, mean: MeanHit) -> Identification:
    values, names = solution.values, problem.measured.names
    traces, _ = problem.measured.evaluate(values)
    check_independence(names, problem.weigh(problem.evaluate(values)[1]).T)
    rms = problem.compute_residual_rms(values)
    total = 2.0 * problem.independent_points
    freedom = max(total - len(names), 1.0)
    squares = (rms / problem.filtered_noise) ** 2 * total / freedom
    factors = np.sqrt(np.maximum(squares, 1.0))
    covariance = problem.compute_covariance(values, factors)
    if not np.all(np.isfinite(covariance)):
        raise NotDeterminedError("identification: the covariance is no finite number")
    hits = list(mean.cut_hits())
    left = rms / problem.peaks
    variant = problem.measured.variant
    model = f"the {variant.value} model"
    by_peak = np.log(np.maximum(left, SMALLEST_NOISE) ** 2)
    return Identification(
        variant=variant,
        names=names,
        values=make_read_only(values),
        covariance=make_read_only(covariance),
        hit_values=make_read_only(problem.step_to_hits(values, hits)),
        measured=problem.traces,
        model=make_read_only(traces),
        residual=make_read_only(problem.traces - traces),
        residual_percent=(100.0 * float(left[0]), 100.0 * float(left[1])),
        chi_square=float(np.mean(squares)),
        criterion=problem.independent_points * float(by_peak.sum()) + len(names) * math.log(total),
        undetermined=describe_misfit(model, left)
        + tuple(
            f"{name}: not determined, since the search ran to the end of its range"
            for name in solution.at_bounds
        )
        + _find_open_combinations(names, values, covariance, solution.at_bounds),
        notes=explain_covariance(model, left, factors),
    )


def _find_open_combinations(
    names: tuple[str, ...], values: FloatArray, covariance: FloatArray, at_bounds: tuple[str, ...]
) -> tuple[str, ...]:
    scales = np.abs(values)
    scales[names.index("t0")] = scales[names.index("tau_p")]
    chosen = [
        index
        for index, name in enumerate(names)
        if name not in (*at_bounds, *OFFSETS) and scales[index] > 0.0
    ]
    return find_undetermined(
        [names[index] for index in chosen], covariance[np.ix_(chosen, chosen)], scales[chosen]
    )
