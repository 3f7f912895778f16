"""Contacts of a sample, from the results of campaigns, and at other speeds."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import trapezoid

from impact_rig.core.errors import ParameterError
from impact_rig.core.estimation.contact_law import NO_LAW
from impact_rig.core.quantity import UNKNOWN, Quantity
from impact_rig.simulators.contact import MeasuredContacts, make_contacts

from .conftest import integrate, make_contact

SAMPLE = "steel small"


def change_law(results, **changes):
    """Return results whose law on `SAMPLE` is another."""
    samples = [
        replace(item, contact_law=replace(item.contact_law, **changes))
        if item.name == SAMPLE
        else item
        for item in results.samples
    ]
    return replace(results, samples=tuple(samples))


@pytest.mark.parametrize(
    ("exponent", "damping", "speed"), [(1.0, 0.0, 0.5), (1.5, 2.03, 0.02), (2.0, 8.0, 0.5)]
)
def test_at_any_speed_a_contact_is_that_of_the_differential_equation(exponent, damping, speed):
    contact = make_contact(exponent=exponent, damping=damping, speed=speed)
    k = contact.stiffness
    truth = integrate(lambda x, v: k * x**exponent * (1.0 + damping * v), contact)
    assert contact.duration == pytest.approx(truth.duration, rel=1e-6)
    assert contact.restitution == pytest.approx(truth.restitution, rel=1e-6)
    assert contact.peak_force == pytest.approx(truth.peak_force, rel=1e-4)
    time = np.linspace(0.0, contact.duration, 1001)
    impulse = contact.equivalent_mass * speed * (1.0 + contact.restitution)
    assert trapezoid(contact.compute_force(time), time) == pytest.approx(impulse, rel=1e-4)


def test_the_contact_of_a_sample_is_what_its_law_says(results):
    law = next(item for item in results.samples if item.name == SAMPLE).contact_law
    contact = make_contacts([results], SAMPLE).at_speed()
    assert contact.duration == pytest.approx(law.duration.value, rel=1e-9)
    assert contact.peak_force == pytest.approx(law.peak_force.value, rel=1e-9)
    assert contact.peak_indentation == pytest.approx(law.peak_indentation.value, rel=1e-9)
    assert contact.speed == law.impact_speed.value
    assert contact.sample_mass == results.setup.samples.get_moving_mass(SAMPLE)


def test_more_than_all_speed_is_no_restitution(results):
    law = next(item for item in results.samples if item.name == SAMPLE).contact_law
    assert law.restitution.value > 1.0  # the published plant's pulse is no contact of free bodies
    assert make_contacts([results], SAMPLE).at_speed().restitution == 1.0


def test_another_hammer_strikes_by_the_same_law(results):
    light, heavy = (make_contacts([results], SAMPLE, mass).at_speed() for mass in (0.1, 1e6))
    assert light.stiffness == heavy.stiffness
    ratio = (heavy.equivalent_mass / light.equivalent_mass) ** (1.0 / (light.exponent + 1.0))
    assert heavy.duration == pytest.approx(ratio * light.duration, rel=1e-9)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"duration": UNKNOWN, "notes": ("the trace is too short",)}, "the trace is too short"),
        (
            {"stiffness": UNKNOWN, "notes": ("stiffness: the mass of hammer is not known",)},
            "the mass of hammer is not known",
        ),
        ({item: getattr(NO_LAW, item) for item in ("duration", "notes")}, "none was looked for"),
    ],
)
def test_a_sample_without_a_law_is_refused_with_the_reason(results, changes, words):
    with pytest.raises(ParameterError, match=f"'steel small' has no identified.*{words}"):
        make_contacts([change_law(results, **changes)], SAMPLE)


def test_a_sample_that_was_not_struck_is_refused_with_those_that_were(results):
    with pytest.raises(ParameterError, match=r"no result of sample 'gold'.*'steel small'"):
        make_contacts([results], "gold")


def test_the_release_angles_of_a_sample_are_its_speeds(results):
    (found,) = (item for item in results.samples if item.name == SAMPLE)
    series = tuple(
        replace(
            found,
            name=f"{SAMPLE} {angle}°",
            contact_law=replace(found.contact_law, impact_speed=Quantity(speed)),
        )
        for angle, speed in ((5, 0.1), (10, 0.2))
    )
    setup = results.setup.at_angles([math.radians(5.0), math.radians(10.0)])
    struck = replace(results, setup=setup, samples=series)
    assert make_contacts([struck], SAMPLE).speeds == (0.1, 0.2)
    assert make_contacts([struck], f"{SAMPLE} 10°").speeds == (0.2, 0.2)


def test_between_measured_speeds_the_law_lies_between_theirs():
    slow = make_contact(speed=0.05, damping=2.0)
    fast = make_contact(speed=0.1, damping=1.0, stiffness=5.5e9)
    contacts = MeasuredContacts((slow, fast))
    assert contacts.at_speed(0.05).duration == pytest.approx(slow.duration, rel=1e-12)
    between = contacts.at_speed(0.075)
    assert between.damping == pytest.approx(1.5)
    assert between.stiffness == pytest.approx(math.sqrt(slow.stiffness * fast.stiffness))
    assert fast.duration < between.duration < slow.duration
    assert contacts.describe_speeds() == "50.00 to 100.00 mm/s"


@pytest.mark.parametrize("speed", [0.049, 0.102])
def test_a_speed_outside_what_was_measured_is_refused(speed):
    contacts = MeasuredContacts((make_contact(speed=0.05), make_contact(speed=0.1)))
    with pytest.raises(ParameterError, match=r"outside what was measured.*50.00 to 100.00 mm/s"):
        contacts.at_speed(speed)
