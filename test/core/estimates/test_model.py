"""The closed-form model against numerical integration, and compared with measurements."""

from dataclasses import replace

import numpy as np
import pytest
from bench.model import integrate_impact
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.integrate import quad

from impact_rig.core.estimates.model import (
    Body,
    ImpactModel,
    ModelVariant,
    compare_trace,
    compare_with_model,
    compute_peak_force,
    simulate_impact,
)
from impact_rig.core.given.filtering import Chain, low_pass
from impact_rig.core.mean.mean_hit import MeanHit

from ..blocks import make_plain_mean

RATE = 2.5e6
COUNT = 5000
TAU = 203.2e-6


def make_body(mass: float, stiffness: float, ratio: float) -> Body:
    return Body(mass, stiffness, 2.0 * ratio * np.sqrt(stiffness * mass))


def make_model(first_ratio: float = 0.64, second_ratio: float = 0.3) -> ImpactModel:
    return ImpactModel(
        make_body(0.1, 22.54e6, first_ratio), make_body(0.17, 45.29e6, second_ratio), TAU, 0.08, 60
    )


# The pulse's cosine strikes the second body at its natural frequency: a particular solution of
# that frequency does not exist.
RESONANT = ImpactModel(
    make_body(0.1, 22.54e6, 0.0), make_body(0.17, 0.17 * (2 * np.pi / TAU) ** 2, 0.0), TAU, 0.0, 60
)
DAMPINGS = ((0.0, 0.0), (0.64, 0.2), (1.0, 1.0), (1.0, 0.3), (2.5, 1.0), (0.3, 2.5))


@pytest.mark.parametrize("variant", ModelVariant)
@pytest.mark.parametrize("model", [*(make_model(*ratios) for ratios in DAMPINGS), RESONANT])
def test_agrees_with_integration_for_every_damping(model, variant):
    expected = integrate_impact(model, np.arange(COUNT) / RATE, variant, 5e-6)
    for ours, theirs in zip(
        simulate_impact(model, RATE, COUNT, variant=variant), expected, strict=True
    ):
        # What is asked for; steps of 5 us keep the integrator itself within 2e-10 of the peak.
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-8 * np.abs(theirs).max())


@given(moving_mass=st.floats(0.01, 1))
def test_peak_force_carries_the_momentum_of_an_elastic_impact(moving_mass):
    force = compute_peak_force(0.1, moving_mass, 0.0819, TAU)
    impulse, _ = quad(lambda t: force * np.sin(np.pi * t / TAU) ** 2, 0.0, TAU)
    common = 0.1 * 0.0819 / (0.1 + moving_mass)
    hammer_after = common - moving_mass * 0.0819 / (0.1 + moving_mass)
    assert impulse == pytest.approx(0.1 * (0.0819 - hammer_after), rel=1e-9)


MODEL = make_model()


def make_bell(middle: float, width: float = 30.0, count: int = 600) -> np.ndarray:
    return np.exp(-(((np.arange(count) - middle) / width) ** 2))


def test_errors_of_a_comparison_are_what_their_names_say():
    measured = make_bell(300.0)
    model = make_bell(300.0, width=45.0)
    contact = slice(250, 350)
    result = compare_trace(measured, model, RATE, contact, 100)
    assert result.shift == pytest.approx(0.0, abs=1e-6 / RATE)
    error = model - measured
    assert result.mse_percent == pytest.approx(100 * np.mean(error**2), rel=1e-6)
    assert result.contact_error_percent == pytest.approx(
        100 * np.sqrt(np.mean(error[contact] ** 2)), rel=1e-6
    )


def make_mean(variant: ModelVariant, origin: int = 754) -> MeanHit:
    start = MODEL.contact_time / 2 - origin / RATE
    traces = np.stack(simulate_impact(MODEL, RATE, 5000, start=start, variant=variant))
    return make_plain_mean(low_pass(traces, 50e3, RATE), RATE, origin)


@pytest.mark.parametrize("variant", ModelVariant)
def test_the_model_itself_compares_without_error(variant):
    result = compare_with_model(make_mean(variant), MODEL, variant, [Chain(RATE, 50e3)] * 2)
    for body in (result.hammer, result.specimen):
        # What has not died away at the end of the record moves the best shift by 1e-4 points.
        assert body.mse_percent < 1e-9
        assert body.contact_error_percent < 1e-3
        assert abs(body.shift) < 1e-3 / RATE
        assert np.abs(body.measured).max() == 1.0
    # Half a contact before the middle, which lies at point 754.
    assert result.start_time == pytest.approx(MODEL.contact_time / 2 - 754 / RATE)


@given(delay=st.integers(-200, 200))
@settings(max_examples=30)
def test_a_delay_of_the_sample_is_its_shift(delay):
    mean = make_mean(ModelVariant.DRIVEN, origin=1000)
    hammer, specimen = mean.traces
    late = replace(mean, traces=np.stack([hammer, ndimage.shift(specimen, delay)]))
    result = compare_with_model(late, MODEL, ModelVariant.DRIVEN, [Chain(RATE, 50e3)] * 2)
    assert result.specimen.shift * RATE == pytest.approx(delay, abs=1e-3)
    # An earlier sample lacks its end, where 0.3 % of the peak was left.
    assert result.specimen.mse_percent < 1e-4
    assert abs(result.hammer.shift) < 1e-3 / RATE
