"""The exponents of the impact speed come back from contacts that were integrated in SI units."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from impact_rig.core.records import Block, ChannelBlock, FloatArray, HitLabel
from impact_rig.core.session import Session, SessionResults
from impact_rig.core.setup import RigSetup, Sample, SampleSet

RATE, COUNT, START = 2.5e6, 5000, 200e-6
HAMMER, SAMPLE = 0.1, 0.105
SPEED, ANGLE = 0.08, math.radians(4.0)
DEGREES = (4.0, 8.0, 16.0)
SETUP = RigSetup(
    SampleSet((Sample("alike", SAMPLE, "steel"),), "alike"), HAMMER, SPEED, release_angle=ANGLE
).at_angles([math.radians(degrees) for degrees in DEGREES])
HITS = 4
STIFFNESS = {1.0: 1.2e7, 1.5: 1.2e10}
"""[N/m^n] Contacts of some 200 us."""


def collide(exponent: float, alpha: float, speed: float) -> tuple[FloatArray, FloatArray]:
    """Return the force [N] at the points of a record, and duration, largest force and e."""

    def find_force(state):
        depth, rate = np.maximum(state[0] - state[1], 0.0), state[2] - state[3]
        return STIFFNESS[exponent] * depth**exponent * (1.0 + alpha * rate)

    def change(_time, state):
        force = find_force(state)
        return [state[2], state[3], -force / HAMMER, force / SAMPLE]

    def separate(time, state):
        return state[0] - state[1] if time > 5e-6 else 1.0

    separate.terminal = True
    found = solve_ivp(
        change, (0.0, 2e-3), [0.0, 0.0, speed, 0.0], method="DOP853", rtol=1e-10, atol=1e-14,
        events=separate, dense_output=True,
    )  # fmt: skip
    duration, last = found.t[-1], found.y[:, -1]
    time = np.arange(COUNT) / RATE - START
    inside = (time > 0.0) & (time < duration)
    force = np.zeros(COUNT)
    force[inside] = find_force(found.sol(time[inside]))
    peak = find_force(found.sol(np.linspace(0.0, duration, 4001))).max()
    return force, np.array([duration, peak, (last[3] - last[2]) / speed])


def strike(exponent: float, alpha: float) -> tuple[SessionResults, FloatArray]:
    """Strike from every angle with noise and scatter; return results and true exponents."""
    generator = np.random.default_rng(5)
    session, truth, record = Session(SETUP), [], 0
    for name in SETUP.samples.names:
        # By the height it falls from: v^2 goes with 1 - cos(angle).
        degrees = float(name.split()[-1].removesuffix("°"))
        fall = (1.0 - math.cos(math.radians(degrees))) / (1.0 - math.cos(ANGLE))
        speed = SPEED * math.sqrt(fall)
        truth.append([speed, *collide(exponent, alpha, speed)[1]])
        for impact in range(1, HITS + 1):
            record += 1
            force, _ = collide(exponent, alpha, speed * (1.0 + 0.02 * generator.standard_normal()))
            traces = np.stack([-force / HAMMER, force / SAMPLE])
            scale = 2.0 * np.abs(traces).max()
            traces += 5e-4 * scale * generator.standard_normal(traces.shape)
            hammer, specimen = (ChannelBlock(trace, 1.0, 0.0, scale) for trace in traces)
            label = HitLabel(name, record, impact)
            session.feed(Block(0, RATE, hammer, specimen, label, last=True))
    logarithms = np.log(truth)
    return session.estimate_all_without_models(), np.polyfit(
        logarithms[:, 0], logarithms[:, 1:], 1
    )[0]


@pytest.mark.parametrize(
    ("exponent", "alpha", "known"),
    [(1.5, 0.0, (-0.2, 1.2, 0.0)), (1.0, 0.0, (0.0, 1.0, 0.0)), (1.5, 1.0, None)],
    ids=["Hertz", "spring", "Hertz with loss"],
)
def test_the_exponents_are_those_of_the_contact(exponent, alpha, known):
    results, truth = strike(exponent, alpha)
    if known:
        assert truth == pytest.approx(known, abs=1e-6)
    (found,) = results.speed_exponents
    assert (found.sample, found.series) == ("alike", len(DEGREES))
    for quantity, true in zip(
        (found.duration, found.peak_force, found.restitution), truth, strict=True
    ):
        assert quantity.value == pytest.approx(true, abs=5e-3)
        # Twice: three laws times three results at 95 %.
        assert abs(quantity.value - true) < 2.0 * quantity.expanded
    if known:
        # Masses, clock and scatter of the speeds, which all have, are not counted again.
        assert found.peak_force.expanded < 0.03


def test_each_angle_has_its_own_control_experiment():
    results, _ = strike(1.5, 0.0)
    for sample in results.samples:
        assert sample.impacts_accepted == HITS
        # Alike to the hammer: k1 = k2, whatever the speed makes of the contact's stiffness.
        assert sample.stiffness.value == pytest.approx(2.0 * sample.equivalent_stiffness.value)
    slow, _, fast = results.samples
    assert fast.stiffness.value > 1.5 * slow.stiffness.value
    assert results.hammer.stiffness.value == pytest.approx(slow.stiffness.value)


def test_a_sample_struck_from_one_angle_has_no_exponents():
    setup = SETUP.for_series("alike 4°")
    session = Session(setup)
    assert session.estimate_all().speed_exponents == ()
