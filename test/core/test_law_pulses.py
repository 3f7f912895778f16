"""Pulses of contact laws against an integration step by step."""

import numpy as np
import pytest

from impact_rig.core.law_pulses import LossForm, ScaledPulses, compute_pulses

from .contacts import integrate, make_viscous, strike_plate

POWERS = {LossForm.ROOT: 0.5, LossForm.FOURTH_ROOT: 0.25, LossForm.DASHPOT: 0.0}
VISCOUS = [form for form in LossForm if form is not LossForm.PLATE]


def compute_one(form: LossForm, exponent: float, loss: float) -> ScaledPulses:
    return compute_pulses(np.array([exponent]), np.array([loss]), form)


@pytest.mark.parametrize("form", VISCOUS)
@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0, 3.0])
@pytest.mark.parametrize("loss", [0.0, 0.1, 0.5])
def test_a_pulse_is_that_of_the_differential_equation(form, exponent, loss):
    motion = integrate(make_viscous(exponent, POWERS.get(form, exponent))(loss))
    pulse = compute_one(form, exponent, loss)
    if form is not LossForm.PROPORTIONAL and loss:
        assert pulse.duration[0] == pytest.approx(motion.time[-1], rel=1e-5)
    assert pulse.restitution[0] == pytest.approx(motion.restitution, abs=1e-6)
    inside = slice(1, -1)
    force = pulse.compute_force(motion.time[inside])[0]
    assert force == pytest.approx(motion.force[inside], abs=1e-5)
    assert pulse.compute_peak_force()[0] == pytest.approx(motion.force.max(), rel=1e-5)


@pytest.mark.parametrize("restitution", [0.9, 0.525])
def test_a_plate_yields_to_the_force(restitution):
    motion = strike_plate(restitution)
    losses = np.linspace(0.01, 0.8, 400)
    pulses = compute_pulses(np.full(400, 1.5), losses, LossForm.PLATE)
    loss = float(np.interp(-restitution, -pulses.restitution, losses))
    pulse = compute_one(LossForm.PLATE, 1.5, loss)
    assert pulse.duration[0] == pytest.approx(motion.time[-1], rel=1e-4)
    inside = slice(1, -1)
    force = pulse.compute_force(motion.time[inside])[0]
    assert force == pytest.approx(motion.force[inside], abs=1e-4)


@pytest.mark.parametrize("form", LossForm)
def test_the_impulse_is_the_integral_of_the_force_which_is_zero_outside(form):
    pulse = compute_one(form, 1.5, 0.3)
    time = np.linspace(-0.5, 6.0, 6501)
    (force,) = pulse.compute_force(time)
    assert not force[(time < 0.0) | (time > pulse.duration[0])].any()
    sums = np.cumsum(force) * (time[1] - time[0])
    assert pulse.compute_impulse(time)[0] == pytest.approx(sums, abs=1e-3)
    assert sums[-1] == pytest.approx(1.0 + pulse.restitution[0], abs=1e-3)
