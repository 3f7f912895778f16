"""The sampling rate behind a time step that a file states."""

import math

DOUBLE_DIGITS = 17
"""Digits that tell every float64 from all others [-]."""


def find_round_rate(step: float, digits: int = DOUBLE_DIGITS) -> float:
    """Find the rate that a step stands for, as round as the step allows.

    Parameters
    ----------
    step : float
        Time from point to point [s], as its file states it.
    digits : int
        Digits that the file gives of the step: 1.95312e-05 s with six may be 51200 Hz.

    Returns
    -------
    float
        [Hz], with as few digits as possible among those whose step has the same `digits`; NaN if
        the step is no finite number above zero.
    """
    if not (math.isfinite(step) and step > 0 and math.isfinite(1.0 / step)):
        return math.nan
    printed = f"{step:.{digits - 1}e}"
    for count in range(1, DOUBLE_DIGITS + 1):
        rate = float(f"{1.0 / step:.{count}g}")
        if f"{1.0 / rate:.{digits - 1}e}" == printed:
            return rate
    return 1.0 / step
