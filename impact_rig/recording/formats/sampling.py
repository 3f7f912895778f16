"""The sampling rate behind a time step that a file states with so many digits."""

import math

DOUBLE_DIGITS = 17
"""Digits that tell every float64 from all others [-]."""

TIE = 1.0 + 1e-6
"""Factor that lets a step in the very middle between two printed ones be either [-]."""


def find_round_rate(step: float, error: float = 0.0) -> float:
    """Find the rate that a step stands for, as round as the step allows.

    Parameters
    ----------
    step : float
        Time from point to point [s], as its file states it.
    error : float
        What rounding may have made of it [s]: 1.95312e-05 s to six digits may be 51200 Hz.

    Returns
    -------
    float
        [Hz], with as few digits as possible among those whose step is that near; NaN if the step
        is no finite number above zero.
    """
    if not (math.isfinite(step) and step > 0 and math.isfinite(1.0 / step)):
        return math.nan
    for digits in range(1, DOUBLE_DIGITS + 1):
        rate = float(f"{1.0 / step:.{digits}g}")
        if abs(1.0 / rate - step) <= TIE * error:
            return rate
    return 1.0 / step


def find_rounding(value: float, digits: int) -> float:
    """Return the largest error of a number that was rounded to so many digits."""
    return 0.5 * 10.0 ** (math.floor(math.log10(abs(value))) - digits + 1)
