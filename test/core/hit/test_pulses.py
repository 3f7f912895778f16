"""Contact pulses, of shapes and of laws, against integration and root finding."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from impact_rig.core.estimates.law_pulses import LossForm, compute_pulses, find_losses, find_places
from impact_rig.core.hit.pulses import (
    HALF_SINE,
    HERTZ,
    PULSE_SHAPES,
    VERSED_SINE,
    PulseShape,
    compute_pulse,
)

from ..contacts import integrate, relax, strike_body, strike_plate

every_shape = pytest.mark.parametrize("shape", PULSE_SHAPES, ids=lambda shape: shape.name)


@pytest.mark.parametrize(
    ("shape", "factor", "ratio"),
    # Published to three figures; Hertz has no short closed form.
    [(VERSED_SINE, 2.0, 1.59), (HALF_SINE, 1.5, 1.40), (HERTZ, 1.82, 1.55)],
)
def test_factor_and_ratio_of_widths_are_the_known_ones(shape, factor, ratio):
    assert shape.pulse_factor == pytest.approx(factor, rel=5e-4)
    assert find_width(shape, 0.1) / find_width(shape, 0.5) == pytest.approx(ratio, abs=0.005)


def find_width(shape: PulseShape, level: float) -> float:
    return 1.0 - 2.0 * brentq(
        lambda phase: float(shape.differentiate(np.array(phase))[0]) - level, 1e-12, 0.5
    )


def test_hertz_pulse_solves_its_differential_equation():
    # m d'' = -k d^(3/2) for unit mass, stiffness and speed.
    motion = strike_body(1.5, 0.0)
    duration = motion.time[-1]
    largest = 1.25**0.4
    assert duration / largest == pytest.approx(2.943, abs=1e-3)  # Goldsmith, Impact, eq. 4.26
    force = HERTZ.differentiate(motion.time / duration)[0]
    np.testing.assert_allclose(force, motion.force / largest**1.5, rtol=0, atol=1e-6)


@every_shape
@given(duration=st.floats(1e-6, 1.0), asymmetry=st.floats(-0.5, 0.5))
def test_an_asymmetric_pulse_keeps_height_impulse_and_width(shape, duration, asymmetry):
    time = np.linspace(-0.5, 1.5, 8001) * duration
    pulse = compute_pulse(time, duration, shape, asymmetry)
    step = time[1] - time[0]
    assert np.all(pulse[(time < 0) | (time > duration)] == 0.0)
    # On 4000 points per pulse: half a point in position and width, and in area.
    assert pulse.max() == pytest.approx(1.0, abs=1e-6)
    peak_time = time[np.argmax(pulse)]
    assert peak_time == pytest.approx(duration * (1 + asymmetry) / 2, abs=30 * step)
    width = np.count_nonzero(pulse >= 0.5) * step
    assert width == pytest.approx(duration / shape.pulse_factor, abs=2 * step)
    symmetric = compute_pulse(time, duration, shape)
    assert pulse.sum() == pytest.approx(symmetric.sum(), rel=1e-3)


POWERS = {
    LossForm.LINEAR: 1.0,
    LossForm.ROOT: 0.5,
    LossForm.FOURTH_ROOT: 0.25,
    LossForm.DASHPOT: 0.0,
}


@pytest.mark.parametrize("form", POWERS)
@pytest.mark.parametrize("exponent", [1.2, 1.5, 2.0, 3.0])
@pytest.mark.parametrize(("loss", "pull"), [(0.0, 0.0), (0.2, 0.0), (0.0, 0.3), (0.1, 0.5)])
def test_a_pulse_is_that_of_the_differential_equation(form, exponent, loss, pull):
    one = [np.array([number]) for number in (exponent, loss, pull)]
    losses = find_losses(*one, find_places([form]))
    proportional, other = float(losses.proportional[0]), float(losses.pulling[0])

    def force(x: float, v: float) -> float:
        x = max(x, 0.0)
        return float(x**exponent * (1.0 + proportional * v) + other * x ** POWERS[form] * v)

    # A force that goes to zero with the indentation may touch it before.
    motion = integrate(force, sticks=not pull)
    pulse = compute_pulses(*one, find_places([form]))
    assert pulse.duration[0] == pytest.approx(motion.time[-1], rel=3e-4)
    assert pulse.restitution[0] == pytest.approx(motion.restitution, abs=5e-5)
    # What is fitted is the impulse.
    steps = np.diff(motion.time) * (motion.force[1:] + motion.force[:-1]) / 2.0
    impulse = pulse.compute_impulse(motion.time[np.newaxis])[0, 0]
    assert impulse[1:] == pytest.approx(np.cumsum(steps), abs=3e-5)
    inside = slice(1, -1)
    force_found = pulse.compute_force(motion.time[inside])[0]
    assert force_found == pytest.approx(motion.force[inside], abs=3e-4)
    assert pulse.compute_peak_force()[0] == pytest.approx(motion.force.max(), rel=5e-5)


@pytest.mark.parametrize("form", POWERS)
def test_the_largest_losses_leave_less_than_a_third_of_the_speed(form):
    exponent, whole = np.array([1.0, 1.5, 2.5]), np.ones(3)
    places = find_places([form] * 3)
    for loss, pull in ((0.8, 0.0), (0.0, 1.0)):
        found = compute_pulses(exponent, loss * whole, pull * whole, places).restitution
        assert np.all(found < 0.4)
        assert np.all(found > 0.2)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
@pytest.mark.parametrize(("loss", "pull"), [(0.2, 0.05), (0.9, 0.05), (0.9, 0.5), (0.4, 0.9)])
def test_a_part_of_the_stiffness_relaxes(exponent, loss, pull):
    one = [np.array([number]) for number in (exponent, loss, pull)]
    pulse = compute_pulses(*one, find_places([LossForm.MEMORY]))
    lag, rate = float(pulse.losses.lag[0]), float(pulse.losses.rate[0])
    # In units of the stiffness at once, which is 1 + lag * rate.
    at_once = 1.0 + lag * rate
    unit = at_once ** (-1.0 / (exponent + 1.0))
    motion = relax(exponent, lag * (rate + 1.0 / rate) / at_once, 1.0 / (rate * unit))
    assert pulse.duration[0] == pytest.approx(unit * motion.time[-1], rel=3e-4)
    assert pulse.restitution[0] == pytest.approx(motion.restitution, abs=5e-5)
    assert pulse.compute_peak_force()[0] == pytest.approx(motion.force.max() / unit, rel=1e-4)


def test_the_nodes_of_a_hertz_pulse_are_those_of_the_example():
    one = [np.array([number]) for number in (1.5, 0.0, 0.0)]
    pulse = compute_pulses(*one, find_places([LossForm.PROPORTIONAL]))
    for node, numbers in (
        (0, (0.0, 1.0, 0.0)),
        (32, (1.609, 0.0, 1.143)),
        (64, (3.218, -1.0, 0.0)),
    ):
        found = pulse.time[0, node], pulse.momentum[0, node], pulse.force[0, node]
        assert found == pytest.approx(numbers, abs=5e-4)


@pytest.mark.parametrize("restitution", [0.9, 0.525])
def test_a_plate_yields_to_the_force(restitution):
    motion = strike_plate(restitution)
    losses, places = np.linspace(0.01, 1.0, 400), find_places([LossForm.PLATE] * 400)
    pulses = compute_pulses(np.full(400, 1.5), losses, 0.0 * losses, places)
    loss = float(np.interp(-restitution, -pulses.restitution, losses))
    pulse = compute_pulses(np.array([1.5]), np.array([loss]), np.zeros(1), places[:1])
    assert pulse.duration[0] == pytest.approx(motion.time[-1], rel=1e-4)
    inside = slice(1, -1)
    force = pulse.compute_force(motion.time[inside])[0]
    assert force == pytest.approx(motion.force[inside], abs=1e-4)
