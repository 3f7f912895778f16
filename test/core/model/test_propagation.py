"""Exponentials and powers of matrices against scipy, eigenvalues and extended precision."""

import numpy as np
import pytest
from scipy.linalg import expm

from impact_rig.core.model.propagation import (
    exponentiate,
    find_blocks,
    find_room,
    find_way_to_end,
    propagate,
    propagate_output,
)


def make_oscillator(frequency: float, damping: float) -> np.ndarray:
    return np.array([[0.0, 1.0], [-(frequency**2), -damping]])


def test_exponentials_of_many_matrices_are_those_of_each() -> None:
    matrices = np.random.default_rng(1).normal(size=(3, 4, 7, 7))
    found = exponentiate(matrices)
    for index in np.ndindex(3, 4):
        expected = expm(matrices[index])
        np.testing.assert_allclose(
            found[index], expected, rtol=0, atol=1e-13 * np.abs(expected).max()
        )


def test_a_small_matrix_beside_a_large_one_keeps_its_digits() -> None:
    # Scaled down and squared up with the large one, some 40 times.
    small, large = 1e-6 * make_oscillator(2.0, 0.5), make_oscillator(1e6, 2e6)
    found = exponentiate(np.stack([small, large]))[0] - np.eye(2)
    # Three terms of the series are all that a float has room for.
    expected = small + small @ small / 2.0 + small @ small @ small / 6.0
    np.testing.assert_allclose(found, expected, rtol=0, atol=3e-16)


def test_nothing_exponentiated_is_the_identity() -> None:
    np.testing.assert_array_equal(exponentiate(np.zeros((2, 3, 3))), np.stack([np.eye(3)] * 2))


def test_propagation_by_doubling_is_repeated_multiplication() -> None:
    matrix = np.array([[0.0, 0.1], [-0.2, -0.05]])
    values, vectors = np.linalg.eig(matrix)
    initial = np.array([1.0, -2.0])
    found = propagate(expm(matrix), initial, 77)
    for n in (0, 1, 2, 63, 64, 76):
        power = (vectors * np.exp(values * n)) @ np.linalg.inv(vectors)
        np.testing.assert_allclose(found[:, n], (power @ initial).real, rtol=0, atol=1e-12)


@pytest.mark.parametrize("count", [1, 2, 3, 64, 77, 508])
def test_what_is_read_off_states_needs_no_states(count: int) -> None:
    powers = np.stack([expm(0.05 * make_oscillator(w, 0.3)) for w in (0.5, 1.0, 2.0)])
    initial = np.array([[1.0, -2.0], [0.5, 0.0], [0.0, 1.0]])
    readout = np.random.default_rng(2).normal(size=(3, 4, 2))
    found, states = propagate_output(powers, initial, readout, count)
    assert found.shape == (3, 4, count)
    expected = propagate(powers, initial, count)
    np.testing.assert_allclose(found, readout @ expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(states, expected[..., :: find_blocks(count)[1]], rtol=0, atol=1e-12)


@pytest.mark.parametrize("count", [1, 2, 77, 508])
def test_output_is_put_where_it_is_wanted(count: int) -> None:
    power = expm(0.05 * make_oscillator(1.0, 0.3))
    initial, readout = np.array([1.0, -2.0]), np.eye(2)
    wanted = np.zeros((2, 3 + find_room(count) + 1))
    found, _ = propagate_output(power, initial, readout, count, wanted[:, 3:])
    np.testing.assert_array_equal(wanted[:, 3 : 3 + count], found)
    assert not wanted[:, :3].any()
    assert not wanted[:, -1].any()
    expected, _ = propagate_output(power, initial, readout, count)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("duration", "expected"),
    [(0.0, (0, 0.0)), (0.31, (0, 0.31)), (1.65, (1, 0.05)), (20.0, (7, 8.8))],
)
def test_a_time_is_reached_from_the_last_block_before_it(
    duration: float, expected: tuple[int, float]
) -> None:
    # Eight blocks of eight points, one every 1.6.
    assert find_blocks(64) == (8, 8)
    assert find_way_to_end(duration, 0.2, 64) == pytest.approx(expected)
