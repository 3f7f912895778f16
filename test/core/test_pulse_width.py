"""Widths of pulses against exact shapes and scipy's own width finder."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import peak_widths

from impact_rig.core.errors import SignalError
from impact_rig.core.pulse_width import measure_pulse


def make_pulse(middle: float, width: float, count: int = 400) -> np.ndarray:
    """Return a versed-sine of the given half-amplitude width around `middle`, in points."""
    phase = (np.arange(count) - middle) / (2.0 * width)
    return np.where(np.abs(phase) < 0.5, np.cos(np.pi * phase) ** 2, 0.0)


@given(seed=st.integers(0, 1000), width=st.floats(20, 100))
def test_agrees_with_scipy(seed, width):
    middle = 150 + 100 * np.random.default_rng(seed).random()
    trace = make_pulse(middle, width)
    pulse = measure_pulse(trace)
    assert pulse.middle == pytest.approx(middle, abs=1e-3)
    for rel_height, ours in (
        (0.5, pulse.half_amplitude_width),
        (0.9, pulse.tenth_amplitude_width),
    ):
        # The pulse stands on zero, so that its prominence is its height.
        theirs = peak_widths(trace, [pulse.peak_index], rel_height=rel_height)[0][0]
        assert ours == pytest.approx(theirs, abs=1e-9)


def test_a_pulse_that_never_comes_down_to_a_tenth_has_no_ratio():
    trace = np.maximum(0.3, make_pulse(200.0, 60.0))
    pulse = measure_pulse(trace)
    assert np.isnan(pulse.width_ratio)
    assert np.isfinite(pulse.half_amplitude_width)


@pytest.mark.parametrize(
    ("trace", "message"),
    [
        (np.zeros(50), "has no pulse: it must leave its baseline and come back"),
        (np.full(50, np.nan), "has no pulse"),
        (np.linspace(0, 1, 50), "cut off: the trace must fall to half its peak on both sides"),
        (np.linspace(-1, 0, 50), "cut off"),
    ],
)
def test_what_is_no_whole_pulse_is_refused(trace, message):
    with pytest.raises(SignalError, match=message):
        measure_pulse(trace)
