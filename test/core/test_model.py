"""The closed-form model against numerical integration and the laws it must obey.

Many impacts in one call are those of single calls.
"""

import numpy as np
import pytest
from bench.model import integrate_impact
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from impact_rig.core.model import (
    Body,
    ImpactModel,
    ModelVariant,
    compute_peak_force,
    simulate_impact,
    simulate_impacts,
)

RATE = 2.5e6
COUNT = 5000
TAU = 203.2e-6


def make_body(mass: float, stiffness: float, ratio: float) -> Body:
    return Body(mass, stiffness, 2.0 * ratio * np.sqrt(stiffness * mass))


def make_model(first_ratio: float = 0.64, second_ratio: float = 0.3) -> ImpactModel:
    return ImpactModel(
        make_body(0.1, 22.54e6, first_ratio), make_body(0.17, 45.29e6, second_ratio), TAU, 0.08, 60
    )


def check_against_integration(model: ImpactModel, variant: ModelVariant) -> None:
    expected = integrate_impact(model, np.arange(COUNT) / RATE, variant, 5e-6)
    for ours, theirs in zip(
        simulate_impact(model, RATE, COUNT, variant=variant), expected, strict=True
    ):
        # What is asked for; steps of 5 us keep the integrator itself within 2e-10 of the peak.
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-8 * np.abs(theirs).max())


@pytest.mark.parametrize("variant", ModelVariant)
@pytest.mark.parametrize(
    ("first_ratio", "second_ratio"),
    [(0.0, 0.0), (0.64, 0.2), (1.0, 1.0), (1.0, 0.3), (2.5, 1.0), (0.3, 2.5)],
)
def test_agrees_with_integration_for_every_damping(first_ratio, second_ratio, variant):
    check_against_integration(make_model(first_ratio, second_ratio), variant)


def test_resonance_without_damping_is_no_special_case():
    # The pulse's cosine strikes the body at its natural frequency: a particular solution of
    # that frequency does not exist.
    mass = 0.17
    model = ImpactModel(
        make_body(0.1, 22.54e6, 0.0), Body(mass, mass * (2 * np.pi / TAU) ** 2, 0.0), TAU, 0.0, 60
    )
    check_against_integration(model, ModelVariant.DRIVEN)


@given(moving_mass=st.floats(0.01, 1))
def test_peak_force_carries_the_momentum_of_an_elastic_impact(moving_mass):
    force = compute_peak_force(0.1, moving_mass, 0.0819, TAU)
    impulse, _ = quad(lambda t: force * np.sin(np.pi * t / TAU) ** 2, 0.0, TAU)
    common = 0.1 * 0.0819 / (0.1 + moving_mass)
    hammer_after = common - moving_mass * 0.0819 / (0.1 + moving_mass)
    assert impulse == pytest.approx(0.1 * (0.0819 - hammer_after), rel=1e-9)


MODELS = [make_model(*ratios) for ratios in ((0.0, 0.0), (1.0, 1.0), (0.01, 3.0), (8.0, 0.2))]


@pytest.mark.parametrize("variant", ModelVariant)
def test_many_impacts_in_one_call_are_those_of_single_calls(variant):
    starts = np.random.default_rng(1).uniform(-2e-4, 4e-4, len(MODELS))
    found = simulate_impacts(MODELS, RATE, 700, start=starts, variant=variant)
    assert found.shape == (len(MODELS), 2, 700)
    for traces, model, start in zip(found, MODELS, starts.tolist(), strict=True):
        one = np.stack(simulate_impact(model, RATE, 700, start=start, variant=variant))
        np.testing.assert_allclose(traces, one, rtol=0, atol=1e-9 * np.abs(one).max())
