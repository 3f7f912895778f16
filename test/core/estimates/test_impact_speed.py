"""The hammer's speed, measured at each hit or stated, and the operational check of the chain."""

import math
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.estimates.checks import advise_check, check_chain, use_measured_speed
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.findings import Reason, Subject
from impact_rig.core.given.records import NO_SPEED, Block, ChannelBlock, HitLabel, MeasuredSpeed
from impact_rig.core.given.sensors import CHANNELS, Sensor
from impact_rig.core.given.setup import RigSetup, Sample, SampleSet
from impact_rig.core.hit.judging import FilteredHit, JudgedHit
from impact_rig.core.hit.pulse_width import measure_pulse
from impact_rig.core.session import Session

from ..blocks import make_plain_mean
from ..contacts import crush
from ..struck import HAMMER, RATE, SAMPLE, SPEED, Impact

CRUSHED = Impact(motion=crush(0.8), resonance=0.0)
"""A contact with e = 0.8, at the speed `SPEED`."""
SETUP = RigSetup(
    SampleSet((Sample("struck", SAMPLE, mass_uncertainty=1e-5),), "struck"),
    HAMMER,
    SPEED,
    hammer_mass_uncertainty=1e-5,
)
COMMON = 1e-3
"""Relative standard uncertainty of the barrier."""


def strike(
    setup: RigSetup,
    speeds: Sequence[float] = (),
    gains: tuple[float, float] = (1.0, 1.0),
    name: str = "struck",
    blocks: int = 1,
    barrier: float = 1.0,
) -> tuple[SampleEstimate, list[JudgedHit]]:
    """Return what hits say whose impact speeds, over `SPEED`, a barrier measures.

    It measures `barrier` times the speed; 0: nothing.
    """
    session = Session(setup)
    hits: list[JudgedHit] = []
    for record, speed in enumerate(speeds or [0.0] * 6, start=1):
        traces = replace(CRUSHED, seed=record).measure() * np.array(gains)[:, np.newaxis]
        traces *= speed or 1.0
        whole = Block(
            0, RATE, *(ChannelBlock(trace, 1.0, 0.0, 0.0) for trace in traces),
            HitLabel(name, record, record), last=True,
        )  # fmt: skip
        for number, part in enumerate(whole.split(whole.stop // blocks + 1)):
            # The barrier's value comes with the block of the contact alone.
            value = barrier * SPEED * speed
            is_there = value and number == blocks // 2
            measured = MeasuredSpeed(value, COMMON * value) if is_there else NO_SPEED
            hits += session.feed(replace(part, impact_speed=measured))
    return session.estimate_sample(name), hits


def find_budget(quantity, source: str) -> float:
    return sum(line.contribution for line in quantity.budget if line.source.startswith(source))


SCATTERED = (0.9, 1.05, 1.0, 1.1, 0.95, 1.0)


@pytest.mark.parametrize("blocks", [1, 5])
def test_e_is_that_of_the_measured_speeds_and_their_scatter_cancels(blocks):
    found, hits = strike(replace(SETUP, impact_speed=2.0 * SPEED), SCATTERED, blocks=blocks)
    checks = found.checks
    assert [hit.impact_speed.value for hit in hits] == pytest.approx(
        [SPEED * x for x in SCATTERED]
    )
    assert checks.impact_speed.value == pytest.approx(SPEED, rel=1e-9)
    assert checks.stated_restitution.value == pytest.approx(0.8, abs=6e-3)
    assert checks.separation_restitution.value == pytest.approx(0.8, abs=6e-3)
    for body, other in (("hammer", SAMPLE), ("sample", HAMMER)):
        part = 1.8 * other / (HAMMER + SAMPLE)
        assert find_budget(
            checks.separation_restitution, f"gain of the {body}'s channel"
        ) == pytest.approx(0.03 * part, rel=0.02)
    # Impulse and speed scatter by 3 % of the mean, and their ratio does not.
    assert find_budget(checks.impact_speed, "scatter") == pytest.approx(
        SPEED * np.std(SCATTERED, ddof=1) / np.sqrt(6.0), rel=1e-6
    )
    assert find_budget(checks.stated_restitution, "scatter") < 5e-3
    assert find_budget(checks.stated_restitution, "measured impact speed") == pytest.approx(
        1.8 * COMMON * max(SCATTERED), rel=0.02
    )
    assert not [note for note in found.warnings if note.about is Subject.IMPACT_SPEED]


def test_the_mean_of_measured_speeds_is_as_sure_as_their_scatter_and_the_barrier():
    pulse = measure_pulse(np.hanning(9))
    known = (np.ones((2, 9)), RATE, pulse, np.zeros(2), np.zeros(2), np.zeros(2), 1)
    hits = [FilteredHit(*known, impact_speed=MeasuredSpeed(speed, COMMON)) for speed in SCATTERED]
    mean = replace(make_plain_mean(np.ones((2, 9)), RATE), hits=tuple(hits))
    found = use_measured_speed(SETUP, mean)
    assert found.impact_speed == pytest.approx(np.mean(SCATTERED))
    scatter = np.std(SCATTERED, ddof=1) / np.sqrt(6.0)
    assert found.impact_speed_uncertainty == pytest.approx(np.hypot(scatter, COMMON))


def test_a_hit_that_the_barrier_missed_has_the_mean_of_the_others():
    found, hits = strike(SETUP, (1.0, 0.0, 1.0, 1.0))
    assert not hits[1].impact_speed.is_known
    assert found.checks.impact_speed.value == pytest.approx(SPEED)


@pytest.mark.parametrize("word", ["stated", "measured"])
def test_a_speed_that_is_not_that_of_the_traces_is_named(word):
    if word == "stated":
        found, _ = strike(replace(SETUP, impact_speed=3.0 * SPEED))
    else:
        found, _ = strike(SETUP, [1.0] * 6, barrier=3.0)
    (told,) = [note for note in found.warnings if note.about is Subject.IMPACT_SPEED]
    assert f"the 24.57 cm/s that are {word}" in told.explanation


@pytest.mark.parametrize(("stated", "source"), [(0.0, "impact speed, assumed"), (2e-3, "impact")])
def test_a_stated_speed_has_its_stated_uncertainty_else_an_assumed_one(stated, source):
    setup = replace(SETUP, impact_speed_uncertainty=stated * SPEED)
    checks = strike(setup)[0].checks
    expected = (stated or 0.03) * checks.stated_restitution.value + (stated or 0.03)
    assert find_budget(checks.stated_restitution, source) == pytest.approx(expected, rel=1e-3)
    assert checks.impact_speed.standard == pytest.approx((stated or 0.03) * SPEED)


def test_an_uncertainty_beyond_the_speed_is_refused():
    with pytest.raises(
        ParameterError, match=r"impact speed uncertainty is .* less than the speed"
    ):
        replace(SETUP, impact_speed_uncertainty=2.0 * SPEED)


CHECKED = replace(
    SETUP, samples=SETUP.samples.with_check(Sample("check mass", SAMPLE, mass_uncertainty=1e-5))
)


@pytest.mark.parametrize(
    ("gain", "known", "stated"),
    [
        (1.0, 0.005, "passed"),
        (1.02, 0.005, "passed"),
        (0.96, 0.005, "undecided"),  # 1 / 0.96 is 4.2 % more, and the ± is 1.4 %
        (1.0, 0.0, "undecided"),  # gains that are assumed within 3 % tell nothing of 5 %
    ],
)
def test_the_operational_check_is_passed_with_its_whole_interval(gain, known, stated):
    sensors = tuple(Sensor(name, sensitivity_uncertainty=known) for name in CHANNELS)
    setup = replace(CHECKED, sensors=sensors)
    found, hits = strike(setup, gains=(1.0, gain), name="check mass")
    assert all(hit.accepted for hit in hits)
    notes = found.notes if stated == "passed" else found.warnings
    (told,) = [note for note in notes if note.about is Subject.OPERATIONAL_CHECK]
    assert told.explanation.startswith(f"{stated}: the free mass of")
    assert found.checks.traced_mass.value == pytest.approx(SAMPLE / gain, rel=2e-3)


@pytest.mark.parametrize(
    ("known", "told"),
    [
        ((0.018, 0.018), None),
        ((0.0181, 0.0181), "ends undecided: the sensitivities alone make ±5 %, and 5 % are"),
        ((0.01, 0.0), r"unless sensitivity_uncertainty stands in \[source.specimen\] of the rig"),
        ((0.0, 0.0), r"\[source.hammer\] and \[source.specimen\] .* make ±8.3 %"),
    ],
)
def test_what_the_operational_check_needs_is_said_beforehand(known, told):
    pairs = zip(CHANNELS, known, strict=True)
    sensors = tuple(Sensor(name, sensitivity_uncertainty=it) for name, it in pairs)
    advice = advise_check(replace(CHECKED, sensors=sensors))
    assert advice is None if told is None else re.search(told, advice)


@pytest.mark.parametrize("gain", [1.06, 0.94, 10.0])
def test_a_chain_beyond_it_is_rejected_on_the_check_mass_and_on_no_other(gain):
    found, hits = strike(CHECKED, gains=(1.0, gain), name="check mass")
    assert found.impacts_accepted == 0
    for hit in hits:
        (reason,) = hit.rejections
        assert reason.reason is Reason.OPERATIONAL_CHECK
        assert "more than the 5 % of ISO 7626-1" in reason.explanation
    assert strike(CHECKED, gains=(1.0, gain))[1][0].accepted


def test_a_check_mass_that_is_not_in_the_set_is_refused():
    with pytest.raises(ParameterError, match="check sample 'lead' is missing from the set"):
        replace(SETUP.samples, check_sample="lead")


def test_a_check_mass_that_cannot_be_weighed_fails_the_check_in_words():
    (finding,) = check_chain(math.nan, 0.15)
    assert "the free mass of 150 g, accelerometer included, cannot be weighed" in str(finding)
    assert "nan" not in str(finding)
