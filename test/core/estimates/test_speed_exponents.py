"""The exponents of the impact speed come back from contacts that were integrated."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.given.records import FloatArray, HitLabel
from impact_rig.core.given.setup import RigSetup, Sample, SampleSet
from impact_rig.core.session import Session, SessionResults

from ..contacts import strike_body
from ..struck import HAMMER, SAMPLE, Impact

SPEED, ANGLE = 0.06, math.radians(4.0)
DEGREES = (4.0, 8.0, 12.0)
SETUP = RigSetup(
    SampleSet((Sample("alike", SAMPLE, "steel"),), "alike"), HAMMER, SPEED, release_angle=ANGLE
).at_angles([math.radians(degrees) for degrees in DEGREES])
HITS = 4


def collide(exponent: float, loss: float, speed: float) -> Impact:
    """Return a contact of some 250 us at the lowest speed; the loss is A there."""
    part = speed / SPEED
    motion = strike_body(exponent, round(loss * part, 4))
    unit = 80e-6 * part ** ((1.0 - exponent) / (1.0 + exponent))
    duration = unit * motion.time[-1]
    return Impact(duration, noise=3e-4, resonance=0.0, corner=1e-3, speed=speed, motion=motion)


def strike(exponent: float, loss: float) -> tuple[SessionResults, FloatArray]:
    """Strike from every angle with noise and scatter; return results and true exponents."""
    generator = np.random.default_rng(5)
    session, truth, record = Session(SETUP), [], 0
    for name in SETUP.samples.names:
        # By the height it falls from: v^2 goes with 1 - cos(angle).
        degrees = float(name.split()[-1].removesuffix("°"))
        fall = (1.0 - math.cos(math.radians(degrees))) / (1.0 - math.cos(ANGLE))
        speed = SPEED * math.sqrt(fall)
        true = collide(exponent, loss, speed)
        force = true.find_force(np.linspace(0.0, true.duration, 4001))
        truth.append([speed, true.duration, force.max(), true.motion.restitution])
        for impact in range(1, HITS + 1):
            record += 1
            hit = collide(exponent, loss, speed * (1.0 + 0.02 * generator.standard_normal()))
            session.feed(replace(hit, seed=record).make_block(HitLabel(name, record, impact)))
    logarithms = np.log(truth)
    return session.estimate_all(), np.polyfit(logarithms[:, 0], logarithms[:, 1:], 1)[0]


@pytest.mark.parametrize(
    ("exponent", "loss", "known"),
    [(1.5, 0.0, (-0.2, 1.2, 0.0)), (1.0, 0.0, (0.0, 1.0, 0.0)), (1.5, 0.1, None)],
    ids=["Hertz", "spring", "Hertz with loss"],
)
def test_the_exponents_are_those_of_the_contact(exponent, loss, known):
    results, truth = strike(exponent, loss)
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
        assert sample.paper.stiffness.value == pytest.approx(
            2.0 * sample.paper.equivalent_stiffness.value
        )
    slow, _, fast = results.samples
    assert fast.paper.stiffness.value > 1.5 * slow.paper.stiffness.value
    assert results.hammer.stiffness.value == pytest.approx(slow.paper.stiffness.value)
