"""Contacts whose law is known, and a sight of engines that need not be installed."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from impact_rig.simulators.check import find_obstacle
from impact_rig.simulators.contact import Contact, MeasuredContacts
from impact_rig.simulators.parameters import ENGINES, compute_parameters


def make_contact(*, exponent=1.5, damping=2.03, **changes):
    """Return 100 g on 105.38 g at 81.9 mm/s for 212 us, with e = 0.9 where nothing is said."""
    values = {
        "hammer_mass": 0.1,
        "sample_mass": 0.10538,
        "speed": 0.0819,
        "stiffness": {1.0: 1.13e7, 1.5: 5.3e9}.get(exponent, 5.3e9 * 3e-6 ** (1.5 - exponent)),
        "duration": math.nan,
        "restitution": math.nan,
        "peak_force": math.nan,
        **changes,
    }
    return Contact("steel", exponent=exponent, damping=damping, **values).at_speed(values["speed"])


def integrate(force, contact):
    """Return the contact as DOP853 has it, of a force [N] over indentation [m] and speed [m/s]."""

    def move(_, state):
        return state[1], -max(force(max(state[0], 0.0), state[1]), 0.0) / contact.equivalent_mass

    def is_over(_, state):
        return force(max(state[0], 0.0), state[1])

    def is_apart(_, state):
        return state[0]

    for event in (is_over, is_apart):
        event.terminal, event.direction = True, -1.0
    found = solve_ivp(
        move,
        (0.0, 10.0 * contact.duration),
        (0.0, contact.speed),
        method="DOP853",
        events=(is_over, is_apart),
        rtol=1e-11,
        atol=(1e-18, 1e-14),
        dense_output=True,
    )
    time = np.linspace(0.0, found.t[-1], 2001)
    forces = [force(max(x, 0.0), v) for x, v in found.sol(time).T]
    return replace(
        contact,
        duration=found.t[-1],
        restitution=-found.y[1, -1] / contact.speed,
        peak_force=max(forces),
    )


@pytest.fixture
def contact():
    return make_contact()


@pytest.fixture
def find():
    """Return the function that finds an engine's parameters of one contact."""
    return lambda engine, contact: compute_parameters(
        ENGINES[engine], MeasuredContacts((contact,))
    )


def skip_without(engine):
    """Skip a test where an engine is not installed."""
    if find_obstacle(ENGINES[engine]):
        pytest.skip(f"{engine} is missing: pip install {ENGINES[engine].package}")


@pytest.fixture
def need():
    return skip_without
