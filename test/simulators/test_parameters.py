"""Each engine's parameters, put into the equation that its documentation gives."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest
from scipy.optimize import brentq

from impact_rig.simulators.contact import MeasuredContacts
from impact_rig.simulators.parameters import ENGINES, IMPEDANCE, compute_parameters

from .conftest import integrate, make_contact

Force = Callable[[float, float], float]


def make_mujoco_force(contact, stiffness, damping, d0, width, power):
    def force(x, v):
        d = d0 + (IMPEDANCE - d0) * (1.0 - (1.0 - min(x / width, 1.0)) ** power)
        b, k = damping / IMPEDANCE, stiffness * d / IMPEDANCE**2
        return contact.equivalent_mass * d * (k * x + b * v)

    return force


def make_drake_force(_, point_contact_stiffness, hunt_crossley_dissipation):
    k = point_contact_stiffness**2 / (2.0 * point_contact_stiffness)
    return lambda x, v: k * x * (1.0 + hunt_crossley_dissipation * v)


def make_series_force(_, stiffness, damping):
    return lambda x, v: x / (2.0 / stiffness) + (damping + damping) * v


def make_chrono_force(contact, kn, gn):
    if contact.exponent < 1.25:
        return lambda x, v: kn * x + contact.equivalent_mass * gn * v
    return lambda x, v: math.sqrt(x) * kn * x + math.sqrt(x) * gn * v


def make_adams_force(_, k, e, cmax, d):
    def step(x, begin, low, end, high):
        part = min(max((x - begin) / (end - begin), 0.0), 1.0)
        return low + (high - low) * part**2 * (3.0 - 2.0 * part)

    def force(x, v):
        gap, rate = 1.0 - 1e3 * x, -1e3 * v  # IMPACT's x and x1 = 1, in mm
        if gap >= 1.0:
            return 0.0
        return k * (1.0 - gap) ** e - step(gap, 1.0 - d, cmax, 1.0, 0.0) * rate

    return force


FORCES: dict[str, Callable[..., Force]] = {
    "mujoco": make_mujoco_force,
    "drake": make_drake_force,
    "sdf": make_series_force,
    "pybullet": make_series_force,
    "chrono": make_chrono_force,
    "adams": make_adams_force,
}


def make_force(parameters):
    """Return the force of an engine, its parameters in the order of its documentation."""
    return FORCES[parameters.engine.name](parameters.contact, *list_numbers(parameters).values())


def list_numbers(parameters):
    return {name: value.value for name, value in parameters.values.items()}


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("exponent", "damping"), [(1.0, 12.0), (1.5, 2.03), (1.9, 0.0)])
def test_duration_and_restitution_are_met_by_the_documented_equation(
    find, engine, exponent, damping
):
    contact = make_contact(exponent=exponent, damping=damping)
    parameters = find(engine, contact)
    found = integrate(make_force(parameters), contact)
    assert found.duration == pytest.approx(contact.duration, rel=1e-6)
    assert found.restitution == pytest.approx(contact.restitution, rel=1e-6)
    own = parameters.compute_pulse()
    assert own.duration == pytest.approx(found.duration, rel=1e-6)
    assert own.restitution == pytest.approx(found.restitution, rel=1e-6)
    assert own.peak_force == pytest.approx(found.peak_force, rel=1e-3)


@pytest.mark.parametrize(
    ("engine", "ratio"), tuple(zip(ENGINES, (0.5, 2.0, 0.5, 2.0, 0.5, 2.0), strict=True))
)
def test_what_is_said_of_other_speeds_is_what_the_equation_says(find, engine, ratio):
    contact = make_contact()
    parameters = find(engine, contact)
    moved = replace(contact, speed=ratio * contact.speed)
    found = integrate(make_force(parameters), moved)
    own = parameters.compute_pulse(moved.speed)
    assert own.duration == pytest.approx(found.duration, rel=1e-6)
    assert own.restitution == pytest.approx(found.restitution, rel=1e-6)


def test_a_spring_and_a_damper_have_their_closed_form(find, contact):
    """Schwager and Poeschel, Granular Matter 9 (2007) 465: e and duration without a pull."""

    def compute_restitution(ratio):
        return math.exp(-ratio / math.sqrt(1 - ratio**2) * (math.pi - 2.0 * math.asin(ratio)))

    ratio = brentq(lambda z: compute_restitution(z) - contact.restitution, 0.0, 0.9)
    frequency = (math.pi - 2.0 * math.asin(ratio)) / (contact.duration * math.sqrt(1 - ratio**2))
    numbers, mass = list_numbers(find("sdf", contact)), contact.equivalent_mass
    assert numbers["kp"] / 2.0 == pytest.approx(mass * frequency**2, rel=1e-7)
    assert numbers["kd"] * 2.0 == pytest.approx(mass * 2.0 * ratio * frequency, rel=1e-7)


@pytest.mark.parametrize("exponent", [1.0, 1.2, 2.0])
@pytest.mark.parametrize("ratio", [0.25, 1.0, 2.0])
def test_mujoco_bends_its_spring_to_the_exponent(find, exponent, ratio):
    contact = make_contact(exponent=exponent, damping=0.0)
    parameters = find("mujoco", contact)
    assert 1e-4 <= list_numbers(parameters)["d0"] <= IMPEDANCE
    wanted = contact.at_speed(ratio * contact.speed)
    found = parameters.compute_pulse(wanted.speed)
    assert found.duration == pytest.approx(wanted.duration, rel=0.06)
    if ratio == 1.0:
        assert found.peak_force == pytest.approx(contact.peak_force, rel=0.01)


def test_uncertainties_are_those_of_what_is_met(find, contact):
    known = replace(contact, duration_expanded=0.01 * contact.duration, restitution_expanded=0.005)
    values = find("sdf", known).values
    # Of a spring with little loss, z = -ln(e) / pi: K as (1 - 4 z / pi) / duration^2, C as z.
    turn = 0.005 / contact.restitution / math.pi
    loss = 0.005 / contact.restitution / -math.log(contact.restitution)
    relative = {name: item.expanded / item.value for name, item in values.items()}
    assert relative["kp"] == pytest.approx(math.hypot(0.02, 4 * turn / math.pi), rel=0.05)
    assert relative["kd"] == pytest.approx(math.hypot(0.01, loss), rel=0.05)
    assert math.isnan(find("sdf", contact).values["kd"].expanded)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("exponent", "damping"), [(0.5, 230.0), (3.5, -4.0)])
def test_the_strangest_law_that_is_identified_has_parameters(find, engine, exponent, damping):
    """E from 1, where noise makes it more, down to 0.05, and uncertain to as much as it is."""
    contact = make_contact(exponent=exponent, damping=damping)
    unsure = replace(
        contact,
        duration_expanded=contact.duration,
        restitution_expanded=contact.restitution,
    )
    parameters = find(engine, unsure)
    assert all(math.isfinite(value.expanded) for value in parameters.values.values())
    own = parameters.compute_pulse()
    assert own.duration == pytest.approx(contact.duration, rel=1e-6)
    assert own.restitution == pytest.approx(contact.restitution, rel=1e-5)


def test_over_several_speeds_the_spread_is_told():
    elastic = make_contact(damping=0.0)
    measured = MeasuredContacts(tuple(elastic.at_speed(speed) for speed in (0.04, 0.0819, 0.16)))
    stiffness = compute_parameters(ENGINES["drake"], measured).values["point_contact_stiffness"]
    # The duration of a Hertz contact goes as v^(-1/5), and so K of a spring as v^(2/5).
    assert stiffness.highest / stiffness.lowest == pytest.approx(4.0**0.4, rel=1e-6)
    assert stiffness.lowest < stiffness.value < stiffness.highest
