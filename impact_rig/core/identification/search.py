"""The search for the best fit: where to start, when to stop."""

from collections.abc import Iterable
from itertools import islice

import numpy as np

from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.identification.fitting import FitProblem, FitSolution
from impact_rig.core.identification.identifiability import GOOD_CHI_SQUARE, LARGEST_RESIDUAL
from impact_rig.core.identification.starting_values import StartingValues, find_starts
from impact_rig.core.model.impact import ModelVariant
from impact_rig.core.signals.record import FloatArray

STARTS = {ModelVariant.DRIVEN: 4, ModelVariant.PRINTED: 4}
"""Starts that are tried at most [-], our choice."""
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

    Parameters
    ----------
    problem : FitProblem
        What is fitted.
    given : StartingValues
        What is believed.

    Raises
    ------
    MisfitError
        If the search does not converge.
    SignalError
        If the hammer's trace has no whole pulse.
    """
    coarse = problem.thin()
    starts = find_starts(coarse.measured, coarse.traces, given)
    solution = _search(coarse, islice(starts, STARTS[problem.measured.variant]))
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
    rms = problem.find_residual_rms(solution.values)
    return bool(np.any(rms > HOPELESS_RESIDUAL * problem.peaks))


def _describe_failure(problem: FitProblem, last: FitSolution | None) -> str:
    text = f"identification: the search for the {problem.measured.variant.value} model "
    if last is None:
        return text + "failed from every start"
    left = 100.0 * problem.find_residual_rms(last.values) / problem.peaks
    return (
        f"{text}did not converge, and leaves {left[0]:.2g} % of the hammer's and"
        f" {left[1]:.2g} % of the sample's peak"
    )


def _is_good(problem: FitProblem, solution: FitSolution) -> bool:
    """Whether no other start can do much better."""
    rms = problem.find_residual_rms(solution.values)
    by_peak = rms < GOOD_RESIDUAL * problem.peaks
    by_noise = rms**2 < GOOD_CHI_SQUARE * problem.filtered_noise**2
    return solution.converged and not solution.at_bounds and bool(np.all(by_peak | by_noise))
