"""Pulse shape: every shape is known again, and the contact time that belongs to it is found."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impact_rig.core.estimates.pulse_shape import PulseShapeEstimate, estimate_pulse_shape
from impact_rig.core.given.errors import NotDeterminedError
from impact_rig.core.given.filtering import Chain, low_pass
from impact_rig.core.given.records import FloatArray
from impact_rig.core.hit.judging import FilteredHit
from impact_rig.core.hit.pulse_width import measure_pulse
from impact_rig.core.hit.pulses import (
    HALF_SINE,
    HERTZ,
    PULSE_SHAPES,
    VERSED_SINE,
    PulseShape,
    compute_pulse,
)
from impact_rig.core.mean import mean_hit
from impact_rig.core.mean.mean_hit import MeanHit

RATE = 2.5e6
CUTOFF = 50e3
PEAK = 800.0
TAU = 200e-6
REAL_DATA = Path(__file__).parents[2] / "data"

every_shape = pytest.mark.parametrize("shape", PULSE_SHAPES, ids=lambda shape: shape.name)


def make_mean(
    hammer: FloatArray,
    *,
    noise: float = 0.0,
    cutoff: float = CUTOFF,
    rate: float = RATE,
    seed: int = 1,
) -> MeanHit:
    """Return the mean of one hit with white noise, filtered."""
    disturbance = low_pass(
        noise * np.random.default_rng(seed).standard_normal(hammer.size), cutoff, rate
    )
    traces = (low_pass(hammer, cutoff, rate) + disturbance)[np.newaxis]
    levels = np.array([disturbance.std()])
    pulse = measure_pulse(traces[0])
    hit = FilteredHit(traces, rate, pulse, levels, np.array([noise]), np.zeros(1), 100)
    return mean_hit.make_mean(
        mean_hit.TraceSum(traces, round(pulse.middle)), [mean_hit.shift_hit(hit)]
    )


def strike(
    shape: PulseShape = VERSED_SINE,
    asymmetry: float = 0.0,
    *,
    tau: float = TAU,
    rate: float = RATE,
    count: int = 2500,
    start: float = 500.3,
) -> FloatArray:
    return PEAK * compute_pulse((np.arange(count) - start) / rate, tau, shape, asymmetry)


def estimate(hammer: FloatArray, noise: float = 0.0, seed: int = 1) -> PulseShapeEstimate:
    return estimate_pulse_shape(make_mean(hammer, noise=noise, seed=seed), Chain(RATE, CUTOFF))


@every_shape
@given(
    asymmetry=st.floats(-0.3, 0.3),
    tau=st.floats(100e-6, 500e-6),
    start=st.floats(500.0, 501.0),
    sign=st.sampled_from([-1.0, 1.0]),
)
@settings(max_examples=25, deadline=None)
def test_every_shape_is_known_again(shape, asymmetry, tau, start, sign):
    found = estimate(sign * strike(shape, asymmetry, tau=tau, start=start))
    fit = found.find_fit(shape.name)
    assert found.best_shape == shape.name
    assert found.is_clear
    # The trace is filtered point by point, the model on every second or fourth.
    assert fit.residual_percent < 0.05
    assert fit.duration == pytest.approx(tau, rel=5e-4)
    assert fit.asymmetry == pytest.approx(asymmetry, abs=2e-3)


def test_noise_moves_neither_contact_time_nor_sides_to_one_side():
    hammer = strike(VERSED_SINE, 0.02)
    found = [estimate(hammer, 4.0, seed) for seed in range(60)]
    times = np.array([item.find_fit(VERSED_SINE.name).duration for item in found])
    sides = np.array([item.fall_over_rise for item in found])
    assert {(item.best_shape, item.warning) for item in found} == {("versed-sine", None)}
    for values, true in ((times, TAU), (sides, 0.98 / 1.02)):
        # Within four standard errors; the low-pass itself widens by some 1e-4.
        assert abs(values.mean() - true) < 4 * values.std() / np.sqrt(values.size) + 3e-4 * true
    assert times.std() < 2e-3 * TAU


def test_a_half_sine_is_warned_of_with_its_contact_time():
    found = estimate(strike(HALF_SINE), 0.5)
    assert "no versed-sine: that leaves 3.2 % of the peak, half-sine 0.0" in str(found.warning)
    assert "contact time is 200 µs, where the width times 2 gives 266.6 µs" in str(found.warning)
    # Equation (5): stiffness goes with the inverse square, and F = 2 gives 0.5625 of it.
    read = found.find_fit(VERSED_SINE.name).contact_time
    assert (found.best_fit.duration / read) ** 2 == pytest.approx(0.5625, rel=2e-3)


def test_in_noise_shapes_are_seldom_told_apart_wrongly():
    hammer = strike(HERTZ)
    found = [estimate(hammer, 40.0, seed) for seed in range(100)]
    wrong = [item for item in found if item.is_clear and item.best_shape != "Hertz"]
    # Two standard deviations, one side: 2.3 %; of 100 seldom more than six.
    assert len(wrong) <= 6
    assert np.mean([item.is_clear for item in found]) < 0.5
    assert not any(item.warning for item in found)


@pytest.mark.parametrize("number", [1, 2])
def test_a_real_force_hammer_falls_slower_than_it_rises(number):
    _, force, _ = np.load(REAL_DATA / "pyfrf_hammer" / f"measurements_{number}_start.npy")
    found = estimate_pulse_shape(
        make_mean(force - force[:14].mean(), cutoff=0.0, rate=25.6e3), Chain(25.6e3)
    )
    assert 1.5 < found.fall_over_rise < 3.0
    assert found.warning.explanation.startswith("no known shape describes the pulse")
    assert found.find_fit(VERSED_SINE.name).asymmetry < -0.3


def test_a_real_drop_is_nearest_to_a_versed_sine():
    time, table = np.loadtxt(REAL_DATA / "repeat_shock" / "acc_base_a0_start.txt").T
    rate = 1.0 / float(np.mean(np.diff(time)))
    found = estimate_pulse_shape(make_mean(table, cutoff=0.0, rate=rate), Chain(rate))
    assert found.best_shape == "versed-sine"
    assert found.best_fit.residual_percent < 3.0
    assert 400e-6 < found.best_fit.duration < 480e-6


def test_too_few_points_are_named():
    coarse = strike(rate=10e3, count=100, start=20.4)
    with pytest.raises(NotDeterminedError, match=r"3 points on the pulse do not tell it, 8 may"):
        estimate_pulse_shape(make_mean(coarse, cutoff=0.0, rate=10e3), Chain(10e3))
