"""Trends and groups of a series of hits, against scipy's regression and known exponents."""

import numpy as np
import pytest
from scipy.stats import linregress

from impact_rig.core.mean.trends import CHANCE, describe_groups, find_trend


@pytest.mark.parametrize("slope", [0.0, 0.4, -0.6])
@pytest.mark.parametrize("count", [5, 10, 40])
def test_a_trend_is_one_where_the_regressions_probability_says_so(count, slope):
    random = np.random.default_rng(count)
    found = 0
    for _ in range(300):
        values = 3.0 + slope * np.arange(count) + random.normal(0.0, 1.0, count)
        fit, change = linregress(np.arange(count), values), find_trend(values)
        assert (change != 0.0) is bool(fit.pvalue < CHANCE)
        if change:
            assert change == pytest.approx(fit.slope * (count - 1))
        found += change != 0.0
    # Without a slope three in a thousand; with one all long series.
    assert found < 5 if slope == 0.0 else found == 300 or count < 40


@pytest.mark.parametrize(
    ("power", "told"),
    [(-1 / 6, "one contact by Hertz"), (0.0, "one linear spring"), (-0.4, "two contacts")],
)
def test_two_groups_of_strength_are_named_with_the_power_of_the_width(power, told):
    random = np.random.default_rng(3)
    peaks = random.permutation(np.repeat([0.0, np.log(2.0)], [4, 6])) + random.normal(0, 0.01, 10)
    found = describe_groups(peaks, power * peaks + random.normal(0.0, 1e-3, 10))
    assert found is not None
    for words in ("4 hits, and 6 that are 2 times as strong", f"power of {power:.2f}", told):
        assert words in found


def test_one_group_and_one_stray_hit_are_no_two_groups():
    peaks = np.random.default_rng(4).normal(0.0, 0.05, 10)
    assert describe_groups(peaks, peaks) is None
    peaks[3] = 2.0
    assert describe_groups(peaks, peaks) is None
