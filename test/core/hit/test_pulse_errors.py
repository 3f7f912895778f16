"""Widths of pulses, and what may be wrong with them, against what simulated pulses show."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.signal import find_peaks as find_by_scipy
from scipy.signal import peak_widths

from impact_rig.core.given.errors import SignalError
from impact_rig.core.given.filtering import low_pass
from impact_rig.core.hit.pulse_width import (
    BASE,
    HALF,
    TraceQuality,
    compute_low_pass_widening,
    compute_quantisation_error,
    estimate_pulse_errors,
    find_ends,
    find_peaks,
    measure_pulse,
)

START, COUNT = 600, 4000
PERFECT = TraceQuality(0.0, 0.0, 0.0, 0.0, 400, 0.0)


def make_pulse(
    duration: float, *, height: float = 500.0, shift: float = 0.0, power: float = 2.0
) -> NDArray[np.float64]:
    """Return a power of a sine of `duration` points."""
    phase = (np.arange(COUNT) - START - shift) / duration
    inside = (phase > 0.0) & (phase < 1.0)
    wave = np.abs(np.sin(np.pi * np.clip(phase, 0.0, 1.0))) ** power
    return np.asarray(height * np.where(inside, wave, 0.0))


def measure_width(trace: NDArray[np.float64], level: float = HALF) -> float:
    pulse = measure_pulse(trace)
    rise, fall = find_ends(trace, pulse, level)
    return fall - rise


def estimate(
    trace: NDArray[np.float64], quality: TraceQuality, level: float = HALF
) -> dict[str, float]:
    return estimate_pulse_errors(trace, measure_pulse(trace), quality, level)


@pytest.mark.parametrize(("level", "sigma"), [(HALF, 4.0), (BASE, 1.0)])
def test_filtered_noise_and_a_noisy_zero_scatter_a_width_as_predicted(level, sigma):
    rate, cutoff = 2.5e6, 50e3
    generator = np.random.default_rng(3)
    clean = make_pulse(500.0)
    widths, noises = [], []
    for _ in range(400):
        raw = clean + sigma * generator.standard_normal(COUNT)
        raw -= raw[:400].mean()
        trace = low_pass(raw, cutoff, rate)
        widths.append(measure_width(trace, level))
        noises.append(trace[:400].std())
    quality = TraceQuality(float(np.mean(noises)), sigma, sigma, 0.0, 400, cutoff / rate)
    errors = estimate(low_pass(clean, cutoff, rate), quality, level)
    predicted = math.hypot(errors["noise"], errors["zero of the baseline"])
    # 400 widths know their standard deviation to 3.5 %; three of those.
    assert predicted == pytest.approx(np.std(widths), rel=0.11)
    assert errors["peak reading"] < 0.1 * predicted


def test_quantisation_without_noise_is_rectangular_and_is_dithered_away_by_noise():
    assert compute_quantisation_error(0.0, 1.0) == 0.0
    assert compute_quantisation_error(2.0, 0.0) == pytest.approx(2.0 / math.sqrt(12), rel=0.02)
    generator = np.random.default_rng(5)
    for sigma in (0.2, 0.35, 0.5):
        # The mean of many noisy readings of levels spread over a step, q = 1.
        levels = np.linspace(0.0, 1.0, 40, endpoint=False)
        noisy = levels + sigma * generator.standard_normal((200_000, 1))
        remains = np.rint(noisy).mean(axis=0) - levels
        observed = float(np.sqrt(np.mean(remains**2)))
        total = math.hypot(sigma, 1.0 / math.sqrt(12.0))
        # What the mean of 200 000 readings still scatters: 0.0013 for these noises.
        assert compute_quantisation_error(1.0, total) == pytest.approx(observed, rel=0.1, abs=2e-3)


@pytest.mark.parametrize(("power", "duration"), [(2.0, 10.0), (2.0, 30.0), (1.0, 8.0)])
def test_sparse_points_misread_the_width_as_predicted(power, duration):
    dense = duration * (1.0 - 2.0 / math.pi * math.asin(0.5 ** (1.0 / power)))
    shifts = np.random.default_rng(6).uniform(0.0, 1.0, 300)
    traces = [make_pulse(duration, shift=shift, power=power) for shift in shifts]
    observed = np.sqrt(np.mean([(measure_width(trace) - dense) ** 2 for trace in traces]))
    predicted = np.sqrt(np.mean([estimate(trace, PERFECT)["sampling"] ** 2 for trace in traces]))
    # An estimate of an error: right within a factor of two.
    assert 0.5 < predicted / observed < 2.0


@pytest.mark.parametrize("cutoff_contact_time", [2.0, 5.0, 10.0])
def test_the_low_pass_widens_a_versed_sine_as_it_does_a_simulated_one(cutoff_contact_time):
    duration = 500.0
    raw = make_pulse(duration)
    filtered = low_pass(raw, cutoff_contact_time / duration, 1.0)
    observed = measure_width(filtered) / measure_width(raw) - 1.0
    # Found for two digits of cutoff times duration, at 400 instead of 500 points.
    assert compute_low_pass_widening(cutoff_contact_time) == pytest.approx(observed, rel=0.05)


@given(shift=st.floats(0.0, 100.0), width=st.floats(20.0, 100.0))
def test_agrees_with_scipy(shift, width):
    trace = make_pulse(2.0 * width, shift=shift)
    pulse = measure_pulse(trace)
    assert pulse.middle == pytest.approx(START + shift + width, abs=1e-3)
    for rel_height, ours in (
        (0.5, pulse.half_amplitude_width),
        (0.9, pulse.tenth_amplitude_width),
    ):
        # The pulse stands on zero, so that its prominence is its height.
        theirs = peak_widths(trace, [pulse.peak_index], rel_height=rel_height)[0][0]
        assert ours == pytest.approx(theirs, abs=1e-9)


def test_a_pulse_that_never_comes_down_to_a_tenth_has_no_ratio():
    trace = np.maximum(150.0, make_pulse(240.0))
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


@pytest.mark.parametrize("seed", range(200))
def test_peaks_are_those_of_scipy(seed):
    random = np.random.default_rng(seed)
    steps = random.normal(size=random.integers(3, 60))
    least = random.uniform(0.01, 2.0)
    for trace in (steps, steps.cumsum()):
        expected, _ = find_by_scipy(trace, height=least, prominence=least)
        assert find_peaks(trace, least) == expected.tolist()
