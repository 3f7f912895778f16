"""Free bodies under a contact law: against two bodies in SI units, and found again."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.setup import PAPER_SETUP, Sample, SampleSet
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.contact import make_nominal_contact
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings


@pytest.mark.parametrize(("exponent", "restitution"), [(1.0, 1.0), (1.5, 0.9), (2.0, 0.5)])
def test_a_contact_is_two_bodies_that_push_each_other(exponent, restitution):
    contact = make_nominal_contact(PAPER_SETUP, "steel small", exponent, restitution)

    def change(_time, state):
        depth, rate = max(state[0] - state[1], 0.0), state[2] - state[3]
        force = contact.stiffness * depth**exponent * (1.0 + contact.damping * rate)
        return [state[2], state[3], -force / contact.hammer_mass, force / contact.moving_mass]

    end = contact.duration
    time = np.linspace(0.0, end, 401)
    states = solve_ivp(
        change,
        (0.0, end),
        [0.0, 0.0, contact.impact_speed, 0.0],
        method="LSODA",
        t_eval=time,
        rtol=1e-10,
        atol=1e-15,
    ).y
    assert states[0, -1] == pytest.approx(states[1, -1], abs=1e-4 * (states[0] - states[1]).max())
    parting = (states[3, -1] - states[2, -1]) / contact.impact_speed
    assert parting == pytest.approx(restitution, abs=1e-5)
    hammer = np.array([change(0.0, state)[2] for state in states.T])
    ours, specimen = contact.simulate(400 / end, 401, 0.0)
    inside = slice(1, -1)
    assert ours[inside] == pytest.approx(hammer[inside], abs=1e-5 * np.abs(hammer).max())
    assert specimen == pytest.approx(-ours * contact.hammer_mass / contact.moving_mass)


def test_hertz_takes_stiffness_from_both_materials():
    aluminium = make_nominal_contact(PAPER_SETUP, "aluminium large", 1.5, 0.0)
    by_hertz = 4.0 / 3.0 * 70e9 / (2.0 * (1.0 - 0.33**2)) * np.sqrt(10e-3)
    assert aluminium.stiffness == pytest.approx(by_hertz)
    # As the paper's control sample.
    assert aluminium.duration == pytest.approx(212e-6, rel=2e-3)
    steel = make_nominal_contact(PAPER_SETUP, "steel large", 1.5, 0.0)
    assert steel.stiffness > aluminium.stiffness


def test_what_the_plant_does_not_know_is_refused():
    lead = Sample("lead", 0.1, "lead")
    setup = replace(PAPER_SETUP, samples=SampleSet((lead,), ""))
    rig = VirtualRig(setup, VirtualRigSettings(plant=Plant.CONTACT))
    with pytest.raises(ParameterError, match="is of lead: for the plant contact"):
        rig.check_sample("lead")
    unknown = replace(PAPER_SETUP, hammer_mass=float("nan"))
    with pytest.raises(ParameterError, match="mass of hammer"):
        VirtualRig(unknown, rig.settings).check_sample("steel small")
    with pytest.raises(ParameterError, match="restitution"):
        VirtualRigSettings(plant=Plant.CONTACT, restitution=1.5)
