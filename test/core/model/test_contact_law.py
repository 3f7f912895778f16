"""Pulses of the contact law against an integration step by step."""

import numpy as np
import pytest

from impact_rig.core.model.contact_law import ScaledPulses, compute_pulses

from ..struck import collide


def compute_one(exponent: float, damping: float) -> ScaledPulses:
    return compute_pulses(np.array([exponent]), np.array([damping]))


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0, 3.0])
@pytest.mark.parametrize("damping", [-0.2, 0.0, 0.1, 0.8, 2.0])
def test_a_pulse_is_that_of_the_differential_equation(exponent, damping):
    solution = collide(exponent, damping)
    (duration,), ((_, speed),) = solution.t_events[0], solution.y_events[0]
    time = np.linspace(0.0, duration, 1001)
    x, v = solution.sol(time)
    force = np.maximum(x, 0.0) ** exponent * (1.0 + damping * v)
    pulse = compute_one(exponent, damping)
    assert pulse.duration[0] == pytest.approx(duration, rel=1e-6)
    assert pulse.restitution[0] == pytest.approx(-speed, abs=1e-6)
    assert pulse.largest_compression[0] == pytest.approx(x.max(), rel=1e-5)
    assert pulse.compute_peak_force()[0] == pytest.approx(force.max(), rel=1e-4)
    assert pulse.compute_force(time)[0][0] == pytest.approx(force, abs=1e-5)


@pytest.mark.parametrize(
    ("damping", "restitution"), [(0.1, 0.9375), (0.2, 0.8822), (0.4, 0.7885), (0.8, 0.6480)]
)
def test_restitution_follows_from_the_damping_whatever_the_exponent(damping, restitution):
    for exponent in (1.0, 1.5, 2.5):
        assert compute_one(exponent, damping).restitution[0] == pytest.approx(
            restitution, abs=5e-5
        )


def test_the_force_has_its_derivative_and_is_zero_outside():
    pulse = compute_one(1.5, 0.3)
    time = np.linspace(-0.5, 4.0, 901)
    (force,), (slope,) = pulse.compute_force(time)
    outside = (time < 0.0) | (time > pulse.duration[0])
    assert not force[outside].any()
    assert not slope[outside].any()
    later, earlier = (pulse.compute_force(time + step)[0][0] for step in (1e-5, -1e-5))
    inside = (time > 0.01) & (time < pulse.duration[0] - 0.01)
    assert slope[inside] == pytest.approx(((later - earlier) / 2e-5)[inside], abs=1e-4)
