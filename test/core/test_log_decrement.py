"""Equations (7) and (8) against free decays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import StateSpace, impulse

from impact_rig.core.damping import estimate_log_decrement
from impact_rig.core.equations import (
    estimate_damping_coefficient,
    estimate_damping_ratio,
)
from impact_rig.core.errors import NotDeterminedError

RATE = 2.5e6


def make_decay(ratio: float, frequency: float = 5e3, count: int = 6000) -> np.ndarray:
    """Return a rise to 1 over 200 points, then the free decay from rest at that peak."""
    natural = 2 * np.pi * frequency
    # x'' = -2 zeta w x' - w^2 x released at x = 1 is the impulse response of (s + 2 zeta w) over
    # the characteristic polynomial.
    system = StateSpace(
        [[0, 1], [-(natural**2), -2 * ratio * natural]], [[1], [0]], [[1, 0]], [[0]]
    )
    _, decay = impulse(system, T=np.arange(count - 200) / RATE)
    rise = np.sin(np.pi / 2 * np.arange(200) / 200) ** 2
    return np.concatenate([rise, decay])


@given(ratio=st.floats(0.02, 0.65), sign=st.sampled_from([1, -1]), height=st.floats(1e-3, 1e4))
def test_a_free_decay_gives_its_damping_ratio(ratio, sign, height):
    trace = sign * height * make_decay(ratio)
    peaks = estimate_log_decrement(trace, noise=0.0)
    # Peaks are read on points, 500 per period: at most (pi / 500)^2 / 2 low.
    assert estimate_damping_ratio(peaks.log_decrement) == pytest.approx(ratio, abs=1e-5)
    period = RATE / (5e3 * np.sqrt(1 - ratio**2))
    assert peaks.second_index - peaks.first_index == pytest.approx(period, abs=1)
    assert peaks.first_peak == pytest.approx(height, rel=1e-6)


def test_noise_below_the_second_peak_does_little():
    trace = make_decay(0.3)
    trace += 1e-3 * np.random.default_rng(1).standard_normal(trace.size)
    peaks = estimate_log_decrement(trace, noise=1e-3)
    # The largest of the noisy points around U2 = 0.139 U1 is some three deviations high.
    decrement = 2 * np.pi * 0.3 / np.sqrt(1 - 0.3**2)
    assert peaks.log_decrement == pytest.approx(decrement, abs=0.04)


@pytest.mark.parametrize(("ratio", "noise"), [(0.7, 0.01), (1.0, 1e-6), (1.5, 1e-6)])
def test_a_second_peak_within_the_noise_is_not_invented(ratio, noise):
    # Of 0.7, the second peak is 0.002 of the first; the others have none.
    with pytest.raises(NotDeterminedError, match="no second peak stands out of the noise"):
        estimate_log_decrement(make_decay(ratio), noise=noise)


def test_a_wave_that_does_not_decay_has_no_decrement():
    wave = np.sin(2 * np.pi * np.arange(1000) / 100)
    with pytest.raises(NotDeterminedError, match="as high as the first, so that nothing decays"):
        estimate_log_decrement(np.tile(wave[:100], 10), noise=0.0)


@given(delta=st.floats(1e-3, 50))
def test_a_ratio_gives_its_decrement_back(delta):
    ratio = estimate_damping_ratio(delta)
    assert 0 < ratio < 1
    assert 2 * np.pi * ratio / np.sqrt(1 - ratio**2) == pytest.approx(delta, rel=1e-9)


def test_a_critical_damper_gives_a_double_root():
    c = estimate_damping_coefficient(1.0, 45e6, 0.17)
    first, second = np.roots([0.17, c, 45e6])
    assert first == pytest.approx(second, rel=1e-6)
