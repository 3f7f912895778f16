"""Bias and coverage of an estimator of yours, on hits whose truth is known."""

import numpy as np

from impact_rig.testing import score


def estimate_contact_time(hit):
    """Twice the width at half amplitude, and 2 % as its U at 95 % [s]."""
    size = np.abs(hit.hammer - np.median(hit.hammer))
    above = hit.time[size > 0.5 * size.max()]
    time = 2.0 * (above[-1] - above[0])
    return time, 0.02 * time


scores = score(estimate_contact_time, samples="steel small", impacts=5, plant="published")
print(scores)
