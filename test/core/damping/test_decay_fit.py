"""The least-squares problem of one damped oscillation and an offset."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.damping.decay_fit import DecayFit

COUNT = 300
POINTS = np.arange(COUNT)
decays = st.floats(1e-3, 0.2)
frequencies = st.floats(0.05, 1.5)


def make_tail(decay: float, frequency: float, *, noise: float = 0.0, seed: int = 1) -> np.ndarray:
    wave = np.exp(-decay * POINTS) * np.cos(frequency * POINTS + 0.3)
    return wave + 0.1 + noise * np.random.default_rng(seed).standard_normal(COUNT)


def make_columns(decay: float, frequency: float) -> np.ndarray:
    envelope = np.exp(-decay * POINTS)
    waves = (np.cos(frequency * POINTS), np.sin(frequency * POINTS), np.exp(decay * POINTS))
    return np.stack([envelope * wave for wave in waves], axis=1)


@given(pairs=st.lists(st.tuples(decays, frequencies), min_size=1, max_size=12))
def test_what_pairs_leave_is_what_linear_least_squares_leave(
    pairs: list[tuple[float, float]],
) -> None:
    tail = make_tail(0.02, 0.2, noise=0.05)
    expected = [
        np.sum((tail - columns @ np.linalg.lstsq(columns, tail)[0]) ** 2)
        for columns in (make_columns(*pair) for pair in pairs)
    ]
    found = DecayFit(tail).find_errors(np.array(pairs))
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    one_by_one = [np.sum(DecayFit(tail).find_residual(np.array(pair)) ** 2) for pair in pairs]
    np.testing.assert_allclose(found, one_by_one, rtol=1e-9)


@given(decay=decays, frequency=frequencies)
def test_the_oscillation_and_its_amplitude_are_found(decay: float, frequency: float) -> None:
    fit = DecayFit(make_tail(decay, frequency))
    left = fit.find_residual(np.array([decay, frequency]))
    np.testing.assert_allclose(left, 0.0, atol=1e-9)
    assert fit.amplitude == pytest.approx(1.0, rel=1e-6)
    np.testing.assert_allclose(fit.oscillation, make_tail(decay, frequency) - 0.1, atol=1e-8)


def test_without_oscillation_there_is_no_sine() -> None:
    fit = DecayFit(np.exp(-0.05 * POINTS) + 2.0)
    assert np.abs(fit.find_residual(np.array([0.05, 0.0]))).max() < 1e-12
    assert fit.amplitude == pytest.approx(1.0, rel=1e-9)
    assert np.isfinite(fit.find_jacobian(np.array([0.05, 0.0]))).all()


@given(decay=st.floats(5e-3, 0.1), frequency=st.floats(0.1, 1.0), seed=st.integers(0, 100))
def test_the_search_ends_in_a_minimum(decay: float, frequency: float, seed: int) -> None:
    tail = make_tail(decay, frequency, noise=0.01, seed=seed)
    fit = DecayFit(tail)
    solution = fit.solve(0.5)
    least = np.sum(fit.residual**2)
    jacobian = fit.find_jacobian(solution)
    uncertainties = 0.01 * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    # A tenth of a standard uncertainty away it leaves 0.01 variances more.
    for step in np.diag(0.1 * uncertainties):
        for side in (-1.0, 1.0):
            left = DecayFit(tail).find_residual(solution + side * step)
            assert np.sum(left**2) > least
