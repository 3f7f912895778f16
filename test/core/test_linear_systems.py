"""Linear systems on a grid against scipy, eigenvalues and a series summed by hand."""

import numpy as np
import pytest
from scipy.linalg import expm

from impact_rig.core.linear_systems import (
    LARGEST_NORM,
    LONGEST_BLOCK,
    Moments,
    simulate_linear_systems,
)

COUNTS = (1, 2, 3, 64, LONGEST_BLOCK, LONGEST_BLOCK + 1, 508)


def make_oscillator(frequency: float, damping: float) -> np.ndarray:
    return np.array([[0.0, 1.0], [-(frequency**2), -damping]])


def expect(matrix: np.ndarray, initial: np.ndarray, time: float) -> np.ndarray:
    """Return e^(At) y by eigenvalues."""
    values, vectors = np.linalg.eig(matrix)
    return ((vectors * np.exp(values * time)) @ np.linalg.solve(vectors, initial)).real


@pytest.mark.parametrize("count", COUNTS)
def test_what_is_read_off_several_systems_is_that_of_each(count):
    matrices = 0.05 * np.stack([make_oscillator(w, 0.3) for w in (0.5, 1.0, 2.0)])
    initial = np.array([[1.0, -2.0], [0.5, 0.0], [0.0, 1.0]])
    readout = np.random.default_rng(2).normal(size=(3, 4, 2))
    moments = [Moments(0.0, 0.7 * count), Moments(0.25, count), Moments(3.5, 3.5)]
    found, states = simulate_linear_systems(matrices, initial, readout, moments, count)
    assert found.shape == (3, 4, count)
    for system in range(3):
        expected = np.stack(
            [
                readout[system]
                @ expect(matrices[system], initial[system], moments[system].first + n)
                for n in range(count)
            ],
            axis=1,
        )
        np.testing.assert_allclose(found[system], expected, rtol=0, atol=1e-12)
        at_end = expect(matrices[system], initial[system], moments[system].end)
        np.testing.assert_allclose(states[system], at_end, rtol=0, atol=1e-12)


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


def test_a_slow_system_beside_a_fast_one_keeps_its_digits():
    # Scaled down and squared up with the fast one, some 40 times.
    slow, fast = 1e-6 * make_oscillator(2.0, 0.5), make_oscillator(1e6, 2e6)
    found, _ = simulate_linear_systems(
        np.stack([slow, fast]),
        np.array([[1.0, 0.0], [1.0, 0.0]]),
        np.stack([np.eye(2)] * 2),
        [Moments(1.0, 1.0)] * 2,
        1,
    )
    # Three terms of the series are all that a float has room for.
    expected = slow + slow @ slow / 2.0 + slow @ slow @ slow / 6.0
    change = found[0, :, 0] - (1.0, 0.0)
    np.testing.assert_allclose(change, expected[:, 0], rtol=0, atol=3e-16)
