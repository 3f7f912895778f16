"""Peaks are those that scipy finds."""

import numpy as np
import pytest
from scipy.signal import find_peaks as find_by_scipy

from impact_rig.core.hit.pulse_width import find_peaks


@pytest.mark.parametrize("seed", range(200))
def test_peaks_are_those_of_scipy(seed):
    random = np.random.default_rng(seed)
    steps = random.normal(size=random.integers(3, 60))
    least = random.uniform(0.01, 2.0)
    for trace in (steps, steps.cumsum()):
        expected, _ = find_by_scipy(trace, height=least, prominence=least)
        assert find_peaks(trace, least) == expected.tolist()
