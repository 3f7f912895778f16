"""The zero-phase low-pass, seen from its frequency response.

Values between the points of a trace.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import butter, sosfiltfilt

from impact_rig.core.errors import ParameterError, SignalError
from impact_rig.core.filtering import check_cutoff, low_pass

RATE = 2.5e6
CUTOFF = 50e3


def find_response(frequency: float) -> complex:
    """Return the gain at a frequency, from the answer to an impulse amid a long record."""
    impulse = np.zeros(20001)
    impulse[10000] = 1.0
    answer = low_pass(impulse, CUTOFF, RATE)
    time = (np.arange(20001) - 10000) / RATE
    return complex(np.sum(answer * np.exp(-2j * np.pi * frequency * time)))


def test_gain_at_the_cutoff_is_minus_3_db():
    # Both passes together; the bilinear transform bends 50 kHz of 2.5 MHz by less than 0.5 %.
    assert abs(find_response(CUTOFF)) == pytest.approx(np.sqrt(0.5), rel=5e-3)


@given(count=st.integers(16, 1200), channels=st.integers(1, 3), seed=st.integers(0, 100))
def test_is_what_scipy_makes_of_the_same_filter_and_padding(count, channels, seed):
    traces = np.random.default_rng(seed).standard_normal((channels, count))
    one_pass = CUTOFF / (np.sqrt(2) - 1) ** 0.25
    sections = butter(2, one_pass, fs=RATE, output="sos")
    expected = sosfiltfilt(sections, traces, padtype="even", padlen=min(count - 1, 150))
    np.testing.assert_allclose(low_pass(traces, CUTOFF, RATE), expected, rtol=0, atol=1e-12)


def test_a_sampling_rate_that_is_too_low_is_named_with_what_would_do():
    with pytest.raises(ParameterError) as error:
        check_cutoff(50e3, 51.2e3)
    message = str(error.value)
    assert "sampling rate of 51.2 kHz is too low for the 50 kHz low-pass" in message
    assert "sample at 125 kHz or more" in message
    assert "cutoff of 20.48 kHz or less" in message
    check_cutoff(50e3, 125e3)


def test_a_trace_that_is_too_short_is_named():
    with pytest.raises(SignalError, match=r"a trace of 15 points is too short .* it needs 16"):
        low_pass(np.zeros(15), CUTOFF, RATE)
    assert low_pass(np.zeros(16), CUTOFF, RATE).size == 16
