"""Linear systems on a grid against scipy, eigenvalues and a series summed by hand."""

import numpy as np
import pytest
from scipy.linalg import expm

from impact_rig.core.linear_systems import (
    LARGEST_NORM,
    Moments,
    simulate_linear_systems,
)


@pytest.mark.parametrize("size", [1, 2, 5, 7, 19])
@pytest.mark.parametrize("norm", [1e-3, 0.9 * LARGEST_NORM, 1.1 * LARGEST_NORM, 40.0])
def test_systems_of_every_size_and_speed_are_followed(size, norm):
    # Antisymmetric, less a decay: nothing grows.
    drawn = np.random.default_rng(size).normal(size=(size, size))
    matrix = drawn - drawn.T - 0.1 * np.eye(size)
    matrix *= norm / np.abs(matrix).sum(axis=0).max()
    initial = np.ones(size)
    found, states = simulate_linear_systems(
        matrix[np.newaxis], initial[np.newaxis], np.eye(size)[np.newaxis], [Moments(0.3, 8.4)], 20
    )
    for n in (0, 1, 7, 19):
        expected = expm((n + 0.3) * matrix) @ initial
        np.testing.assert_allclose(found[0, :, n], expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(states[0], expm(8.4 * matrix) @ initial, rtol=0, atol=1e-12)
