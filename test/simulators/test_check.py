"""The engines themselves strike with what is exported; the truth is the law, integrated."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from impact_rig.core.errors import ParameterError
from impact_rig.simulators.check import (
    EngineCheck,
    Motion,
    check_engine,
    find_obstacle,
    is_met,
)
from impact_rig.simulators.contact import MeasuredContacts
from impact_rig.simulators.parameters import ENGINES, IMPEDANCE, compute_parameters
from impact_rig.simulators.tables import tabulate_checks
from impact_rig.simulators.texts import format_text

from .conftest import integrate, make_contact

CHECKED = [name for name, engine in ENGINES.items() if engine.package]
FINE = 1e-7
"""Step at which an engine of the first order errs by a few thousandths [s]."""


@pytest.mark.parametrize("engine", CHECKED)
@pytest.mark.parametrize(("damping", "speed"), [(0.0, 0.03), (2.03, 0.3), (12.0, 0.3)])
def test_the_engine_shows_duration_and_restitution_of_the_law(find, need, engine, damping, speed):
    need(engine)
    contact = make_contact(damping=damping, speed=speed)
    k, n = contact.stiffness, contact.exponent
    truth = integrate(lambda x, v: k * x**n * (1.0 + damping * v), contact)
    parameters = find(engine, contact)
    motion = check_engine(parameters, (FINE,)).finest
    # Drake leaves out what is below a millionth of the momentum in a step: the foot of a pulse.
    assert motion.duration == pytest.approx(truth.duration, rel=2e-2 if damping > 10 else 5e-3)
    assert motion.restitution == pytest.approx(truth.restitution, rel=5e-3)
    assert motion.peak_force == pytest.approx(parameters.compute_pulse().peak_force, rel=5e-3)


@pytest.mark.parametrize("engine", CHECKED)
def test_coarse_steps_do_not_hold_a_contact_of_metal(find, need, contact, engine):
    need(engine)
    steps = (1e-3, 1e-5, 5e-6, 5e-7)
    check = check_engine(find(engine, contact), steps)
    coarse, *_, fine = check.strikes
    assert all(motion.duration > 4.0 * contact.duration for motion in coarse)
    assert max(motion.restitution for motion in coarse) > 1.5 * min(
        motion.restitution for motion in coarse
    )
    assert is_met(fine)
    assert check.largest_step == (1e-5 if engine == "mujoco" else 5e-7)
    table = tabulate_checks([check])
    assert len(table.rows) == 2 + len(steps)
    assert 2 in table.marked
    assert len(steps) + 1 not in table.marked
    needed = "10 µs" if engine == "mujoco" else "0.5 µs"
    assert table.notes[-1].endswith(f"within 2 % at steps of {needed} and below.")


def test_a_table_shows_the_range_of_what_came_and_its_worst(contact):
    parameters = compute_parameters(ENGINES["mujoco"], MeasuredContacts((contact,)))
    motions = tuple(
        Motion(contact, 1e-4, np.array([[contact.speed, 0.0], [0.0, e * contact.speed]]))
        for e in (0.5, 1.2, 0.8)
    )
    table = tabulate_checks([EngineCheck(parameters, (motions,))])
    assert table.rows[2][:2] == ("MuJoCo", "0.1 ms")
    assert table.rows[2][4:6] == ("0.500 to 1.200", "-44.5")
    assert table.notes[-1] == (
        "MuJoCo: at none of these steps are duration and restitution within 2 %."
    )


def test_mujoco_carries_a_load_at_rest_as_the_spring_does(find, contact, need):
    """The sample alone on the fixed hammer, under gravity: its spring has m g."""
    need("mujoco")
    import mujoco

    stiff = replace(contact, hammer_mass=1e9).at_speed(contact.speed)
    parameters = find("mujoco", stiff)
    text = format_text(parameters, ".xml").replace('gravity="0 0 0"', 'gravity="-9.81 0 0"')
    hammer = text.index("<freejoint/>")
    model = mujoco.MjModel.from_xml_string(text[:hammer] + text[hammer + len("<freejoint/>") :])
    state = mujoco.MjData(model)
    for _ in range(100_000):
        mujoco.mj_step(model, state)
    stiffness, _, d0, width, power = (value.value for value in parameters.values.values())

    def compute_excess(depth):
        part = d0 / IMPEDANCE + (1.0 - d0 / IMPEDANCE) * (1.0 - (1.0 - depth / width) ** power)
        return stiffness * part**2 * depth - 9.81

    depth = brentq(compute_excess, 0.0, width, xtol=1e-20)
    assert 0.02 - state.qpos[0] == pytest.approx(depth, rel=2 * IMPEDANCE)


def test_an_engine_that_is_missing_or_cannot_be_checked_is_told_of_in_a_sentence(find, contact):
    missing = replace(ENGINES["drake"], module="no_such_engine")
    assert find_obstacle(missing) == (
        "--check needs Drake, which is not installed: pip install drake"
    )
    with pytest.raises(ParameterError, match=r"does not run in Adams: .* MuJoCo, Drake, PyBullet"):
        check_engine(find("adams", contact))


def test_a_motion_is_read_from_its_speeds(contact):
    speeds = np.array([[0.1, 0.0], [0.1, 0.0], [0.05, 0.05], [0.01, 0.09], [0.01, 0.09]])
    motion = Motion(replace(contact, speed=0.1, hammer_mass=0.1), 1e-3, speeds)
    assert motion.duration == pytest.approx(2e-3)
    assert motion.restitution == pytest.approx(0.8)
    assert motion.peak_force == pytest.approx(5.0)
