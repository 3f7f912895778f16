"""A rotated problem against the one it stands for."""

import numpy as np
from scipy.optimize import least_squares

from impact_rig.core.identification.fitting import RotatedProblem

TIME = np.linspace(0.0, 3.0, 200)
MEASURED = 2.0 * np.exp(-1.3 * TIME) + 0.01 * np.random.default_rng(1).normal(size=TIME.size)


def evaluate(parameters: np.ndarray) -> np.ndarray:
    height, rate = parameters
    decay = np.exp(-rate * TIME)
    return np.stack([decay, -height * TIME * decay, height * decay - MEASURED])


def test_lengths_and_angles_are_what_they_were() -> None:
    parameters = np.array([1.0, 0.5])
    rows = evaluate(parameters)
    problem = RotatedProblem(evaluate)
    residual, jacobian = problem.compute_residual(parameters), problem.compute_jacobian(parameters)
    assert residual.shape == (3,)
    assert jacobian.shape == (3, 2)
    rotated = np.column_stack([jacobian, residual])
    np.testing.assert_allclose(rotated.T @ rotated, rows @ rows.T, rtol=1e-12)


def test_a_search_ends_where_it_would_have_ended() -> None:
    problem = RotatedProblem(evaluate)
    found = least_squares(problem.compute_residual, [1.0, 0.5], jac=problem.compute_jacobian)
    expected = least_squares(
        lambda values: evaluate(values)[2], [1.0, 0.5], jac=lambda values: evaluate(values)[:2].T
    )
    np.testing.assert_allclose(found.x, expected.x, rtol=1e-9)
    assert found.nfev == expected.nfev


def test_residual_and_derivatives_at_one_place_cost_one_evaluation() -> None:
    calls = []

    def count(parameters: np.ndarray) -> np.ndarray:
        calls.append(parameters)
        return evaluate(parameters)

    problem, here, there = RotatedProblem(count), np.array([1.0, 0.5]), np.array([1.0, 0.6])
    problem.compute_residual(here)
    problem.compute_jacobian(here)
    assert len(calls) == 1
    problem.compute_residual(there)
    assert len(calls) == 2
