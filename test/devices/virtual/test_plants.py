"""The virtual bodies: the published plant carries the tables, the others obey equation (1)."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.signal import find_peaks

from impact_rig.core.estimates.model import Body, ModelVariant, simulate_impact
from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.setup import PAPER_SETUP, Sample, SampleSet
from impact_rig.core.hit.pulses import compute_pulse
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.plants import (
    ASYMMETRY,
    HitPhysics,
    make_nominal_model,
    make_published_model,
    simulate_plant,
)

RATE = 2.5e6
COUNT = 5000
START = -0.2e-3
names = st.sampled_from(PAPER_SETUP.samples.names)


def find_damping(body: Body) -> tuple[float, float]:
    """Return decay rate and damped angular frequency [1/s] from the roots of m s^2 + c s + k."""
    root = np.roots([body.mass, body.damping_coefficient, body.stiffness])[0]
    return -root.real, abs(root.imag)


@pytest.mark.parametrize("cell", PAPER_SETUP.samples.samples, ids=lambda cell: cell.name)
def test_the_nominal_hit_has_the_papers_numbers(cell):
    model = make_nominal_model(PAPER_SETUP, cell.name)
    assert model.contact_time == cell.reference_contact_time
    assert model.hammer.mass == 0.1
    # 22.54 MN/m is printed with four digits; 212.0 us gives 22.535.
    assert model.hammer.stiffness == pytest.approx(22.54e6, rel=5e-4)
    assert model.specimen.mass == pytest.approx(cell.mass + 3e-3)
    assert model.specimen.stiffness == cell.reference_stiffness
    assert model.specimen.damping_coefficient == cell.reference_damping_coefficient
    # The impulse of the pulse turns the hammer round as an elastic impact does.
    impulse = model.peak_force * model.contact_time / 2
    m1, m2 = model.hammer.mass, model.specimen.mass
    assert impulse == pytest.approx(2 * m1 * m2 / (m1 + m2) * 0.0819)


@given(name=names)
def test_the_published_hammer_is_the_pulse_and_a_tail(name):
    model = make_nominal_model(PAPER_SETUP, name)
    hammer, _ = simulate_plant(Plant.PUBLISHED, HitPhysics(model), 4 * RATE, 4 * COUNT, START)
    time = START + np.arange(4 * COUNT) / (4 * RATE)
    peak = model.peak_force / model.hammer.mass
    during = (time >= 0) & (time < model.contact_time)
    assert not hammer[time < 0].any()
    assert hammer.max() == pytest.approx(peak, rel=1e-4)
    inside = peak * compute_pulse(time[during], model.contact_time, asymmetry=ASYMMETRY)
    np.testing.assert_allclose(hammer[during], inside, rtol=0, atol=1e-9 * peak)
    decay, frequency = find_damping(model.hammer)
    tail = hammer[time >= model.contact_time]
    first = find_peaks(tail)[0][0]
    # Read on a grid of 0.1 us; the tail's period is some 500 us.
    assert tail[first] == pytest.approx(peak * math.exp(-decay * 2 * math.pi / frequency), 1e-4)


@pytest.mark.parametrize("cell", PAPER_SETUP.samples.samples, ids=lambda cell: cell.name)
def test_the_published_sample_is_a_driven_body_whose_log_decrement_gives_table_4(cell):
    model = make_published_model(PAPER_SETUP, cell.name)
    _, specimen = simulate_plant(Plant.PUBLISHED, HitPhysics(model), 4 * RATE, 4 * COUNT, START)
    body, time = model.specimen, START + np.arange(4 * COUNT) / (4 * RATE)

    def accelerate(t, state):
        force = model.peak_force * math.sin(math.pi * t / model.contact_time) ** 2
        force *= 0.0 < t < model.contact_time
        resistance = body.stiffness * state[0] + body.damping_coefficient * state[1]
        return state[1], (force - resistance) / body.mass

    motion = solve_ivp(
        accelerate, (0.0, 1e-3), (0.0, 0.0), t_eval=time[(time >= 0.0) & (time <= 1e-3)],
        rtol=1e-8, atol=1e-14, max_step=2e-6,
    )  # fmt: skip
    expected = [accelerate(t, state)[1] for t, state in zip(motion.t, motion.y.T, strict=True)]
    found = specimen[(time >= 0.0) & (time <= 1e-3)]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5 * found.max())
    # The largest peak, of whatever sign, and the next one of that sign.
    upright = specimen * np.sign(specimen[np.argmax(np.abs(specimen))])
    tops = upright[find_peaks(upright)[0]]
    largest = np.argmax(tops)
    decrement = math.log(tops[largest] / tops[largest + 1])
    ratio = cell.reference_damping_coefficient / 2 / math.sqrt(body.stiffness * body.mass)
    assert decrement == pytest.approx(2 * math.pi * ratio / math.sqrt(1 - ratio**2), rel=1e-4)
    # The contact still drives the body at its largest peak: a decay would give less damping.
    assert 1.04 < body.damping_coefficient / cell.reference_damping_coefficient < 1.17


def test_a_published_body_without_a_decrement_keeps_its_damping():
    cell = Sample("cell", 0.1, "", 200e-6, 20e6, 1e5)
    setup = replace(PAPER_SETUP, samples=SampleSet((cell,), "cell"))
    assert make_published_model(setup, "cell") == make_nominal_model(setup, "cell")


def test_dynamics_is_the_model_itself():
    model = make_nominal_model(PAPER_SETUP, "steel medium")
    for plant, variant in ((Plant.DYNAMICS, "DRIVEN"), (Plant.DYNAMICS_PRINTED, "PRINTED")):
        ours = simulate_plant(plant, HitPhysics(model), RATE, COUNT, START)
        theirs = simulate_impact(model, RATE, COUNT, start=START, variant=ModelVariant[variant])
        np.testing.assert_array_equal(ours, theirs)


def test_what_the_virtual_rig_cannot_strike_is_named():
    known = Sample("known", 0.1, "", 200e-6, 20e6, 500.0)
    bare = Sample("bare", 0.1)
    setup = replace(PAPER_SETUP, samples=SampleSet((known, bare), "known"))
    assert make_nominal_model(setup, "known").contact_time == 200e-6
    with pytest.raises(ParameterError, match="sample 'bare' has no reference contact time"):
        make_nominal_model(setup, "bare")
    with pytest.raises(ParameterError, match="unknown sample 'other': there are 'known', 'bare'"):
        make_nominal_model(setup, "other")
    for control, message in (("bare", "'bare' has no reference contact"), ("", "needs a control")):
        changed = replace(setup, samples=replace(setup.samples, control_sample=control))
        with pytest.raises(ParameterError, match=message):
            make_nominal_model(changed, "known")
