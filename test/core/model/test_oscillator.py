"""The closed form of free oscillators against the matrix exponential."""

import numpy as np
import pytest
from scipy.linalg import expm

from impact_rig.core.model.oscillator import find_padding, simulate_free_oscillators

FREQUENCY = 3.0
RATIOS = (0.0, 0.05, 0.6, 1.0 - 1e-12, 1.0, 1.0 + 1e-12, 1.0 + 1e-4, 3.0, 50.0)


def expect(ratio: float, state: np.ndarray, times: np.ndarray) -> np.ndarray:
    matrix = np.array([[0.0, 1.0], [-(FREQUENCY**2), -2.0 * ratio * FREQUENCY]])
    return np.array([matrix[1] @ expm(matrix * time) @ state for time in times])


@pytest.mark.parametrize("count", [1, 2, 3, 10, 26, 100])
def test_oscillators_of_every_damping_agree_side_by_side(count: int) -> None:
    states = np.random.default_rng(1).normal(size=(len(RATIOS), 2, 2))
    late = np.linspace(0.0, 2.0, len(RATIOS))
    step = np.geomspace(0.01, 0.3, len(RATIOS))
    # The second body of each has the damping of the next.
    pairs = np.array([(ratio, RATIOS[index - 1]) for index, ratio in enumerate(RATIOS)])
    found = np.full((len(RATIOS), 2, 1 + count + find_padding(count)), np.nan)
    simulate_free_oscillators(
        np.full(pairs.shape, FREQUENCY**2),
        2.0 * pairs * FREQUENCY,
        states,
        np.stack([step, late]),
        count,
        list(found[:, :, 1:]),
    )
    assert np.isnan(found[:, :, 0]).all()
    for model, body in np.ndindex(pairs.shape):
        times = late[model] + step[model] * np.arange(count)
        expected = expect(pairs[model, body], states[model, :, body], times)
        # As large as its velocity makes it at once.
        peak = np.abs(expect(pairs[model, body], states[model, :, body], np.zeros(1))).max()
        ours = found[model, body, 1 : count + 1]
        np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-12 * peak)


def test_what_has_decayed_for_long_is_zero_and_no_overflow() -> None:
    found = np.ones((1, 3, 50 + find_padding(50)))
    simulate_free_oscillators(
        np.full((1, 3), 1e8),
        np.array([[1e2, 2e4, 1e7]]),
        np.ones((1, 2, 3)),
        np.array([[1e4], [1e6]]),
        50,
        list(found),
    )
    np.testing.assert_array_equal(found[..., :50], np.zeros((1, 3, 50)))


def test_records_of_different_lengths_are_filled_to_their_ends_and_no_further() -> None:
    lengths, padding = (100, 37, 0), find_padding(100)
    whole = np.full((3, 1, 400), np.nan)
    simulate_free_oscillators(
        np.full((3, 1), FREQUENCY**2),
        np.full((3, 1), 0.5),
        np.ones((3, 2, 1)),
        np.array([[0.1] * 3, [0.0] * 3]),
        100,
        [record[:, : length + padding] for record, length in zip(whole, lengths, strict=True)],
    )
    for record, length in zip(whole[:, 0], lengths, strict=True):
        np.testing.assert_allclose(record[:length], whole[0, 0, :length], rtol=0, atol=1e-13)
        assert np.isfinite(record[:length]).all()
        assert np.isnan(record[length + padding :]).all()
