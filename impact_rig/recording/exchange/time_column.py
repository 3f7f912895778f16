"""The sampling rate of a file that states the time of each point."""

from pathlib import Path

import numpy as np

from impact_rig.core.errors import SignalError
from impact_rig.core.signals.record import FloatArray

RATE_DIGITS = 9
"""Digits that a sampling rate found in a time column is rounded to, our choice: files of one
series get the same rate, whatever the last bits of their times."""
LARGEST_TIME_ERROR = 0.05
"""How far a point may lie from an even time grid, part of the step [-]. Our choice: above what
rounding to the printed digits makes of even steps, far below a point that is missing."""


TIME_UNITS = {"": 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
"""Units of a column of times [s]; none stated: seconds."""


def find_sampling_rate(path: Path, times: FloatArray, unit: str = "") -> float:
    """Find the rate of a column of times.

    Parameters
    ----------
    path : Path
        Of the file, for the message.
    times : ndarray, shape (n,)
        Of each point, finite; two at least.
    unit : str
        Of the times, as the file states it.

    Returns
    -------
    float
        [Hz], rounded to `RATE_DIGITS` digits.

    Raises
    ------
    SignalError
        If time does not run in even steps, or its unit is unknown.
    """
    if unit.strip() not in TIME_UNITS:
        raise SignalError(f"{path}: times are in {unit!r}: they must be in s, ms, us or ns")
    time = times * TIME_UNITS[unit.strip()]
    step = (time[-1] - time[0]) / (time.size - 1)
    steps = np.diff(time)
    if not (step > 0 and np.isfinite(step)) or steps.min() <= 0:
        worst = int(np.argmin(steps))
        raise SignalError(
            f"{path}: time does not grow from point {worst} to {worst + 1}"
            f" ({time[worst]:g} s, {time[worst + 1]:g} s): is this the time column?"
        )
    deviation = np.abs(time - (time[0] + step * np.arange(time.size)))
    if deviation.max() > LARGEST_TIME_ERROR * step:
        worst = int(np.argmax(np.abs(steps - step)))
        raise SignalError(
            f"{path}: time does not run in even steps of {step:g} s: it goes on by"
            f" {steps[worst]:g} s at point {worst}"
        )
    return float(f"{1.0 / step:.{RATE_DIGITS}g}")
