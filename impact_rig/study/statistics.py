"""Bias, spread, coverage and efficiency of estimates whose truth is known."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest, chi2

from impact_rig.core.signals.record import FloatArray

CONFIDENCE = 0.95
"""Of every interval that the study gives for its own figures [-]."""


@dataclass(frozen=True)
class Bias:
    """Where estimates lie about the truth; NaN: too few of them.

    Attributes
    ----------
    bias : float
        Mean error [unit of the errors].
    standard_error : float
        Of that mean [unit of the errors].
    spread : float
        Standard deviation of the errors [unit of the errors].
    """

    bias: float
    standard_error: float
    spread: float


@dataclass(frozen=True)
class Ratio:
    """A figure with its own 95 % interval; NaN: not determined.

    Attributes
    ----------
    value, low, high : float
        [-]
    """

    value: float
    low: float
    high: float


UNDETERMINED_RATIO = Ratio(math.nan, math.nan, math.nan)


def estimate_bias(errors: FloatArray) -> Bias:
    """Estimate bias and spread from errors, shape (n,); NaN where n is too small."""
    count = errors.size
    bias = float(errors.mean()) if count else math.nan
    spread = float(errors.std(ddof=1)) if count > 1 else math.nan
    return Bias(bias, spread / math.sqrt(count) if count > 1 else math.nan, spread)


def estimate_coverage(errors: FloatArray, half_widths: FloatArray) -> Ratio:
    """Estimate how often an interval covers the truth, with Wilson's interval of that figure.

    Parameters
    ----------
    errors : ndarray, shape (n,)
        Estimate less truth.
    half_widths : ndarray, shape (n,)
        Expanded uncertainties in the unit of the errors; NaN: there is none, and the estimate
        does not count.
    """
    stated = np.isfinite(half_widths)
    covered = np.abs(errors[stated]) <= half_widths[stated]
    return find_fraction(int(np.count_nonzero(covered)), covered.size)


def find_fraction(successes: int, count: int) -> Ratio:
    """Return the fraction of successes with Wilson's 95 % interval; NaN where `count` is 0."""
    if count == 0:
        return UNDETERMINED_RATIO
    interval = binomtest(successes, count).proportion_ci(CONFIDENCE, method="wilson")
    return Ratio(successes / count, float(interval.low), float(interval.high))


def estimate_efficiency(errors: FloatArray, bounds: FloatArray) -> Ratio:
    """Estimate the root of the mean squared error over the Cramer-Rao bound.

    Parameters
    ----------
    errors : ndarray, shape (n,)
        Estimate less truth; their conditions, and so their bounds, may differ.
    bounds : ndarray, shape (n,)
        Least standard deviation of an unbiased estimator, in the unit of the errors; NaN where
        it is not defined: these do not count.

    Returns
    -------
    Ratio
        1: no unbiased estimator does better. The interval takes the errors over their bounds as
        normal with zero mean, so that their sum of squares is chi-square of n degrees of freedom.
    """
    defined = np.isfinite(bounds)
    count = int(np.count_nonzero(defined))
    if count == 0:
        return UNDETERMINED_RATIO
    ratio = math.sqrt(float(np.mean(np.square(errors[defined] / bounds[defined]))))
    tail = (1.0 - CONFIDENCE) / 2.0
    low, high = (math.sqrt(count / chi2.ppf(part, count)) for part in (1.0 - tail, tail))
    return Ratio(ratio, ratio * low, ratio * high)
