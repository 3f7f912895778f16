"""Bias, coverage and efficiency against known distributions and published intervals."""

import math

import numpy as np
import pytest
from scipy.stats import t as student

from impact_rig.study.statistics import (
    estimate_bias,
    estimate_coverage,
    estimate_efficiency,
    find_fraction,
)

NAN = math.nan


def test_wilsons_interval_is_that_of_the_textbook():
    # Newcombe 1998, table I: 81 of 263 gives 0.2553 to 0.3662, 15 of 148 gives 0.0624 to 0.1605.
    for successes, count, low, high in ((81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605)):
        found = find_fraction(successes, count)
        assert found.value == successes / count
        assert (found.low, found.high) == pytest.approx((low, high), abs=5e-5)


def test_no_trial_says_nothing():
    assert math.isnan(find_fraction(0, 0).value)
    assert math.isnan(estimate_coverage(np.array([0.1]), np.array([NAN])).value)


def test_bias_and_spread_are_those_of_the_distribution():
    errors = np.random.default_rng(1).normal(0.3, 2.0, 40_000)
    found = estimate_bias(errors)
    assert found.standard_error == pytest.approx(0.01, rel=0.02)
    assert abs(found.bias - 0.3) < 3 * found.standard_error
    assert found.spread == pytest.approx(2.0, rel=0.02)


@pytest.mark.parametrize("errors", [[], [0.5]])
def test_too_few_errors_have_no_spread(errors):
    found = estimate_bias(np.array(errors))
    assert math.isnan(found.spread)
    assert math.isnan(found.standard_error)
    assert math.isnan(found.bias) is (not errors)


def test_coverage_of_students_intervals_is_what_they_claim():
    hits = np.random.default_rng(2).normal(size=(20_000, 10))
    half_widths = student.ppf(0.975, 9) * hits.std(axis=1, ddof=1) / math.sqrt(10)
    found = estimate_coverage(hits.mean(axis=1), half_widths)
    assert found.low < 0.95 < found.high
    # Without Student's t they would claim too much.
    assert estimate_coverage(hits.mean(axis=1), half_widths * 1.96 / 2.262).high < 0.93


def test_an_estimate_without_an_interval_does_not_count():
    found = estimate_coverage(np.array([0.0, 9.0, 9.0]), np.array([1.0, NAN, NAN]))
    assert found.value == 1.0


def test_efficiency_is_the_rms_error_over_the_bound():
    generator = np.random.default_rng(3)
    bounds = generator.uniform(0.1, 10.0, 20_000)
    found = estimate_efficiency(1.2 * bounds * generator.standard_normal(20_000), bounds)
    assert found.low < 1.2 < found.high
    assert found.high / found.low < 1.03


def test_bias_counts_against_efficiency():
    errors = np.array([3.0, 3.0, 3.0])
    assert estimate_efficiency(errors, np.full(3, 1.5)).value == pytest.approx(2.0)


def test_the_interval_of_an_efficiency_covers_in_95_percent():
    errors = np.random.default_rng(4).standard_normal((2000, 12))
    found = [estimate_efficiency(row, np.ones(12)) for row in errors]
    covered = sum(item.low <= 1.0 <= item.high for item in found)
    # Binomial: 1900 +- 10 standard; four of them.
    assert abs(covered - 1900) < 40


def test_errors_without_a_bound_do_not_count():
    found = estimate_efficiency(np.array([1.0, 50.0]), np.array([1.0, NAN]))
    assert found.value == 1.0
    assert math.isnan(estimate_efficiency(np.array([1.0]), np.array([NAN])).value)
