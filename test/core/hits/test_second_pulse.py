"""A second contact is found, whatever its height and place; ringing of one contact is none."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.hits.pulse_width import measure_pulse
from impact_rig.core.hits.second_pulse import (
    SecondPulse,
    estimate_duration,
    find_second_pulse,
)
from impact_rig.core.model.pulses import PULSE_SHAPES, VERSED_SINE, PulseShape, compute_pulse

LEVEL = 0.05
COUNT = 2000
DURATION = 200.0
"""Of the first pulse, in points."""
REAL_DATA = Path(__file__).parents[2] / "data" / "repeat_shock"


def make_pulse(
    start: float = 300.0, duration: float = DURATION, shape: PulseShape = VERSED_SINE
) -> np.ndarray:
    return compute_pulse(np.arange(COUNT) - start, duration, shape)


def find(trace: np.ndarray) -> SecondPulse | None:
    return find_second_pulse(trace, measure_pulse(trace), LEVEL)


@pytest.mark.parametrize("shape", PULSE_SHAPES, ids=lambda shape: shape.name)
def test_the_duration_of_every_shape_is_known_within_five_percent(shape: PulseShape) -> None:
    pulse = measure_pulse(make_pulse(shape=shape))
    assert estimate_duration(pulse) == pytest.approx(DURATION, rel=0.05)


def test_the_duration_of_a_pulse_that_does_not_come_down_is_that_of_the_shortest() -> None:
    pulse = measure_pulse(make_pulse() + 0.2)
    assert np.isnan(pulse.width_ratio)
    assert estimate_duration(pulse) == pytest.approx(1.5 * pulse.half_amplitude_width)


@given(
    shape=st.sampled_from(PULSE_SHAPES),
    sign=st.sampled_from([1, -1]),
    height=st.floats(LEVEL, 0.99),
    delay=st.floats(1.2, 6.0),
    stretch=st.floats(0.7, 1.6),
    seed=st.integers(0, 1000),
)
def test_every_second_contact_is_found(
    shape: PulseShape, sign: int, height: float, delay: float, stretch: float, seed: int
) -> None:
    first = make_pulse(shape=shape)
    # The delay runs from middle to middle; a longer second contact must not reach into the first.
    delay = max(delay, (1.0 + stretch) / 2.0 + 0.1)
    start = 300.0 + DURATION * (0.5 + delay - stretch / 2.0)
    second = height * make_pulse(start, stretch * DURATION, shape)
    # White noise of 1 in 1000 of the peak after a low-pass that leaves every tenth point new.
    noise = np.repeat(np.random.default_rng(seed).standard_normal(COUNT // 10), 10)
    found = find(sign * (first + second + 1e-3 * noise))
    assert found is not None
    assert found.height == pytest.approx(height, abs=0.005)
    assert found.delay == pytest.approx(delay * DURATION, abs=0.05 * DURATION)


@given(height=st.floats(LEVEL, 0.95), delay=st.floats(1.2, 4.0))
def test_a_smaller_contact_before_the_largest_is_found_too(height: float, delay: float) -> None:
    trace = make_pulse(1200.0) + height * make_pulse(1200.0 - delay * DURATION)
    found = find(trace)
    assert found is not None
    assert found.height == pytest.approx(height, rel=1e-3)
    assert found.delay == pytest.approx(-delay * DURATION, rel=1e-3)


@given(height=st.floats(0.0, 0.044), delay=st.floats(1.2, 6.0))
def test_a_smaller_echo_is_none(height: float, delay: float) -> None:
    assert find(make_pulse() + height * make_pulse(300.0 + delay * DURATION)) is None


@given(height=st.floats(0.1, 0.9), delay=st.floats(0.5, 1.0))
def test_what_follows_within_the_contact_time_is_none(height: float, delay: float) -> None:
    pulse = measure_pulse(make_pulse())
    trace = make_pulse() + height * make_pulse(300.0 + delay * DURATION)
    assert find_second_pulse(trace, pulse, LEVEL) is None


@given(
    height=st.floats(0.05, 0.5),
    period=st.floats(0.2, 2.5),
    decrement=st.floats(0.0, 0.3),
    phase=st.floats(0.0, 2.0 * np.pi),
)
def test_a_ringing_tail_is_none(
    height: float, period: float, decrement: float, phase: float
) -> None:
    late = (np.arange(COUNT) - 500.0) / (period * DURATION)
    decay = np.exp(-decrement * np.maximum(late, 0.0))
    wave = height * decay * np.sin(2.0 * np.pi * late + phase)
    # It builds up over half a contact time, as the response of a structure does.
    build = np.clip((np.arange(COUNT) - 450.0) / (0.5 * DURATION), 0.0, 1.0)
    assert find(make_pulse() + build * wave) is None


@given(height=st.floats(0.05, 1.0), place=st.integers(600, 1900))
def test_a_spike_is_none(height: float, place: int) -> None:
    spike = height * make_pulse(place, 0.3 * DURATION)
    assert find(make_pulse() + spike) is None


def test_an_undershoot_is_none() -> None:
    assert find(make_pulse() - 0.3 * make_pulse(500.0)) is None


def test_a_drift_is_none() -> None:
    assert find(make_pulse() + 0.2 * np.linspace(0.0, 1.0, COUNT)) is None


def test_a_contact_is_found_within_weaker_ringing() -> None:
    ringing = 0.03 * np.sin(2.0 * np.pi * np.arange(COUNT) / 260.0) * (np.arange(COUNT) > 500)
    found = find(make_pulse() + 0.2 * make_pulse(900.0) + ringing)
    assert found is not None
    assert found.height == pytest.approx(0.2, abs=0.03)


def test_the_ringing_of_a_real_shock_is_none() -> None:
    # Bumps of 4 to 15 % within a ringing of the table that another laboratory measured.
    _, acceleration = np.loadtxt(REAL_DATA / "acc_base_a0_start.txt").T
    trace = acceleration - acceleration[:20].mean()
    pulse = measure_pulse(trace)
    tail = trace[pulse.peak_index + 24 :]
    assert tail.max() > LEVEL * pulse.peak
    assert find_second_pulse(trace, pulse, LEVEL) is None
