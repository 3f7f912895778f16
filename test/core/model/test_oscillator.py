"""The closed form of free oscillators against the matrix exponential."""

import numpy as np
import pytest
from scipy.linalg import block_diag, expm

from impact_rig.core.model.oscillator import (
    FreeOscillator,
    compute_padding,
    simulate_free_oscillators,
)

FREQUENCY = 3.0
RATIOS = (0.0, 0.05, 0.6, 1.0 - 1e-12, 1.0, 1.0 + 1e-12, 1.0 + 1e-4, 3.0, 50.0)


def expect(ratio: float, state: np.ndarray, times: np.ndarray) -> np.ndarray:
    matrix = np.array([[0.0, 1.0], [-(FREQUENCY**2), -2.0 * ratio * FREQUENCY]])
    # One size up: scipy 1.11 has a formula of its own for 2 x 2, which overflows.
    bordered = block_diag(matrix, 0.0)
    return np.array([matrix[1] @ expm(bordered * time)[:2, :2] @ state for time in times])


def make_oscillator(ratio: float, state: np.ndarray, step: float, first: float) -> FreeOscillator:
    """Count time in points, and accelerations as they are."""
    frequency, (position, speed) = step * FREQUENCY, state.tolist()
    return FreeOscillator(
        frequency**2, 2.0 * ratio * frequency, position / step**2, speed / step, first
    )


@pytest.mark.parametrize("count", [1, 2, 3, 10, 26, 100])
def test_oscillators_of_every_damping_agree_side_by_side(count: int) -> None:
    states = np.random.default_rng(1).normal(size=(len(RATIOS), 2))
    steps = np.geomspace(0.01, 0.3, len(RATIOS)).tolist()
    late = np.linspace(0.0, 20.0, len(RATIOS)).tolist()
    oscillators = [
        make_oscillator(ratio, state, step, first)
        for ratio, state, step, first in zip(RATIOS, states, steps, late, strict=True)
    ]
    found = np.full((len(RATIOS), 1 + count + compute_padding(count)), np.nan)
    simulate_free_oscillators(oscillators, count, list(found[:, np.newaxis, 1:]))
    assert np.isnan(found[:, 0]).all()
    for ratio, state, step, first, record in zip(RATIOS, states, steps, late, found, strict=True):
        times = step * (first + np.arange(count))
        expected = expect(ratio, state, times)
        # As large as its velocity makes it at once.
        peak = np.abs(expect(ratio, state, np.zeros(1))).max()
        np.testing.assert_allclose(record[1 : count + 1], expected, rtol=0, atol=1e-12 * peak)


def test_what_has_decayed_for_long_is_zero_and_no_overflow() -> None:
    found = np.ones((3, 50 + compute_padding(50)))
    simulate_free_oscillators(
        [FreeOscillator(1e16, damping, 1.0, 1.0, 100.0) for damping in (1e6, 2e8, 1e11)],
        50,
        [found],
    )
    np.testing.assert_array_equal(found[:, :50], np.zeros((3, 50)))


def test_records_of_different_lengths_are_filled_to_their_ends_and_no_further() -> None:
    lengths, padding = (100, 37, 0), compute_padding(100)
    whole = np.full((3, 400), np.nan)
    simulate_free_oscillators(
        [make_oscillator(0.1, np.ones(2), 0.1, 0.0)] * 3,
        100,
        [whole[place : place + 1, : length + padding] for place, length in enumerate(lengths)],
    )
    for record, length in zip(whole, lengths, strict=True):
        np.testing.assert_allclose(record[:length], whole[0, :length], rtol=0, atol=1e-13)
        assert np.isfinite(record[:length]).all()
        assert np.isnan(record[length + padding :]).all()
