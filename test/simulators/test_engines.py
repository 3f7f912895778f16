"""Contacts in the files of simulators: MuJoCo strikes, and a spring has its closed form."""

import math
import xml.etree.ElementTree as ET
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq

from impact_rig.core.estimates.contact_law import NO_LAW
from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.quantity import UNKNOWN
from impact_rig.devices.virtual.choices import Plant
from impact_rig.simulators.engines import ENGINES, format_contact, make_contact

SAMPLE = "steel small"
STEP = 1e-7  # [s], at which an engine of the first order errs by a few thousandths
RUN = 2.5  # contact durations until the bodies are apart


@pytest.fixture(scope="module")
def results(strike):
    """Return a campaign of contacts with a law."""
    return strike(("aluminium large", SAMPLE), plant=Plant.CONTACT)


def change_law(results, **changes):
    """Return results in which the law of `SAMPLE` is another."""
    samples = tuple(
        replace(item, contact_law=replace(item.contact_law, **changes))
        if item.name == SAMPLE
        else item
        for item in results.samples
    )
    return replace(results, samples=samples)


def give_restitution(results, restitution):
    """Return the contact of `SAMPLE` with this restitution."""
    law = make_contact(results, SAMPLE).law
    changed = replace(law.restitution, value=restitution)
    return make_contact(change_law(results, restitution=changed), SAMPLE)


@pytest.mark.parametrize("restitution", [0.5, 0.9, 1.0])
def test_mujoco_strikes_with_duration_and_restitution_of_the_law(results, restitution):
    contact = give_restitution(results, restitution)
    model = mujoco.MjModel.from_xml_string(format_contact(ENGINES["mujoco"], contact))
    model.opt.timestep = STEP
    state = mujoco.MjData(model)
    hammer, sample = (model.body(name).dofadr[0] for name in ("hammer", "sample"))
    state.qvel[hammer] = speed = contact.law.impact_speed.value
    steps = round(RUN * contact.law.duration.value / STEP)
    velocity = np.empty(steps)
    for step in range(steps):
        mujoco.mj_step(model, state)
        velocity[step] = state.qvel[hammer]
    force = -contact.hammer_mass * np.diff(velocity) / STEP
    duration = np.count_nonzero(force > 1e-6 * force.max()) * STEP
    assert duration == pytest.approx(contact.law.duration.value, rel=5e-3)
    found = (state.qvel[sample] - state.qvel[hammer]) / speed
    assert found == pytest.approx(restitution, rel=5e-3)


def read_sdf(contact):
    """Return kp and kd of both bodies."""
    root = ET.fromstring(format_contact(ENGINES["sdf"], contact))
    return [[float(item.text) for item in root.iter(name)] for name in ("kp", "kd")]


def test_the_spring_and_damper_of_sdformat_have_their_closed_form(results):
    """Schwager and Poeschel, Granular Matter 9 (2007) 465: e and duration without a pull."""
    contact = give_restitution(results, 0.9)

    def compute_restitution(ratio):
        return math.exp(-ratio / math.sqrt(1 - ratio**2) * (math.pi - 2.0 * math.asin(ratio)))

    ratio = brentq(lambda z: compute_restitution(z) - 0.9, 0.0, 0.9)
    duration, mass = contact.law.duration.value, contact.equivalent_mass
    frequency = (math.pi - 2.0 * math.asin(ratio)) / (duration * math.sqrt(1 - ratio**2))
    stiffness, damping = read_sdf(contact)
    # Two equal springs in series are half as stiff; dampings add.
    assert stiffness == pytest.approx([2.0 * mass * frequency**2] * 2, rel=1e-7)
    assert damping == pytest.approx([mass * ratio * frequency] * 2, rel=1e-7)


def test_a_contact_that_seems_to_gain_speed_is_elastic(results):
    assert read_sdf(give_restitution(results, 1.02))[1] == [0.0, 0.0]


@pytest.mark.parametrize("engine", ENGINES.values(), ids=ENGINES)
def test_the_comment_says_what_was_measured_whatever_the_sample_is_called(results, engine):
    contact = replace(make_contact(results, SAMPLE), sample="a --> b\n\x00</sdf>&")
    text = format_contact(engine, contact)
    ET.fromstring(text)
    duration = f"{1e6 * contact.law.duration.value:.1f}"
    assert f"Contact duration {duration}" in text
    assert "Origin of the hits: simulated" in text


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"duration": UNKNOWN, "notes": ("the trace is too short",)}, "the trace is too short"),
        ({"stiffness": UNKNOWN, "notes": ("a mass is not known",)}, "a mass is not known"),
        ({item: getattr(NO_LAW, item) for item in ("duration", "notes")}, "none was looked for"),
    ],
)
def test_a_sample_without_a_law_is_refused_with_the_reason(results, changes, words):
    with pytest.raises(ParameterError, match=f"'steel small' has no identified.*{words}"):
        make_contact(change_law(results, **changes), SAMPLE)


def test_a_sample_that_was_not_struck_is_refused_with_those_that_were(results):
    with pytest.raises(ParameterError, match=r"no result of sample 'gold'.*'steel small'"):
        make_contact(results, "gold")
