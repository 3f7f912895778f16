"""Searches of several models at once end where scipy's end, one by one."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from impact_rig.core.least_squares import minimise

TIME = np.linspace(0.0, 3.0, 60)
TRUTHS = np.array([[2.0, 0.7, 0.1], [1.0, 2.0, -0.3], [3.0, 0.2, 0.0]])
START = np.ones((3, 3))


def evaluate_all(measured):
    """Return residuals and derivatives of a exp(-b t) + c for each row of parameters."""

    def evaluate(parameters):
        height, rate, offset = parameters.T[..., np.newaxis]
        decay = np.exp(-rate * TIME)
        slopes = np.stack((decay, -height * TIME * decay, np.ones_like(decay)), axis=1)
        return height * decay + offset - measured, slopes

    return evaluate


@pytest.fixture
def measured():
    noise = np.random.default_rng(3).normal(0.0, 0.02, (3, TIME.size))
    height, rate, offset = TRUTHS.T[..., np.newaxis]
    return height * np.exp(-rate * TIME) + offset + noise


@pytest.mark.parametrize("highest_rate", [10.0, 1.5, 0.1], ids=["free", "one held", "all held"])
def test_each_search_ends_at_scipys_minimum_within_the_bounds(measured, highest_rate):
    bounds = np.array([[0.0, 0.01, -1.0], [10.0, highest_rate, 1.0]])[:, np.newaxis]
    found, (residual, _), is_found = minimise(evaluate_all(measured), START, bounds)
    assert is_found.all()
    for number, row in enumerate(measured):
        one = evaluate_all(row)
        start = np.clip(START[:1], bounds[0], bounds[1])[0] * 0.9 + 0.01 * bounds[1, 0]
        oracle = least_squares(
            lambda p, one=one: one(p[np.newaxis])[0][0],
            np.clip(start, bounds[0, 0] + 1e-3, bounds[1, 0] - 1e-3),
            bounds=bounds[:, 0],
            xtol=1e-12, ftol=1e-12, gtol=1e-12,
        )  # fmt: skip
        assert 0.5 * residual[number] @ residual[number] == pytest.approx(oracle.cost, rel=1e-4)
        assert found[number] == pytest.approx(oracle.x, abs=5e-3)


def test_a_search_that_cannot_come_near_is_given_up_and_the_others_go_on(measured):
    useless = np.vstack([measured[:2], 100.0 * np.sin(40.0 * TIME)])
    bounds = np.array([[0.0, 0.01, -1.0], [10.0, 10.0, 1.0]])[:, np.newaxis]
    found, _, is_found = minimise(evaluate_all(useless), START, bounds, most=10.0)
    assert is_found.tolist() == [True, True, False]
    assert found[0] == pytest.approx(TRUTHS[0], abs=0.05)
