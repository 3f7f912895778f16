"""What momenta say without a law: gains, masses, speeds, and what holds the sample."""

from dataclasses import replace

import numpy as np
import pytest
from study.laboratories import Laboratory, run_series

from impact_rig.core.estimates.checks import check_momenta
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.estimates.uncertainty import RigInputs
from impact_rig.core.given.findings import Note, Reason, join_findings
from impact_rig.core.given.records import Block, ChannelBlock, HitLabel
from impact_rig.core.given.setup import RigSetup, Sample, SampleSet
from impact_rig.core.hit.judging import JudgedHit
from impact_rig.core.hit.pulse_width import ZERO_AFTER
from impact_rig.core.session import Session

from ..contacts import crush
from ..struck import DURATION, HAMMER, RATE, SAMPLE, SETUP, SPEED, Impact

CRUSHED = Impact(motion=crush(0.8), resonance=0.0)
"""A contact of no law that is given."""


def estimate(
    impact: Impact,
    gains: tuple[float, float] = (1.0, 1.0),
    mass: float = SAMPLE,
    odd: float = 1.0,
    growth: tuple[float, float] = (0.0, 0.0),
    count: int = 10,
) -> tuple[SampleEstimate, list[JudgedHit]]:
    """Return what hits say whose gains are off, or grow, of another stated mass."""
    samples = SampleSet((Sample("struck", mass, mass_uncertainty=1e-4),), "struck")
    session = Session(RigSetup(samples, HAMMER, SPEED, hammer_mass_uncertainty=1e-4))
    hits: list[JudgedHit] = []
    for record in range(1, count + 1):
        each = np.array(gains) * (1.0 + record * np.array(growth))
        traces = replace(impact, seed=record).measure() * each[:, np.newaxis]
        traces[1] *= odd if record == 3 else 1.0
        hits += feed(session, traces, record)
    return session.estimate_sample("struck"), hits


def feed(session: Session, traces: np.ndarray, record: int) -> list[JudgedHit]:
    channels = [ChannelBlock(trace, 1.0, 0.0, 0.0) for trace in traces]
    return session.feed(Block(0, RATE, *channels, HitLabel("struck", record, record), last=True))


def find(warnings: tuple[Note, ...], words: str) -> list[str]:
    return [str(note) for note in warnings if words in note.explanation]


def test_without_a_law_momenta_restitution_and_mass_are_given_all_the_same():
    found, hits = estimate(CRUSHED)
    checks = found.checks
    assert not found.contact_law.is_known
    assert checks.hold == "free"
    impulse = 1.8 * SPEED / (1.0 / HAMMER + 1.0 / SAMPLE)
    for quantity, true in (
        (checks.momentum_ratio, 1.0),
        (checks.impulse, impulse),
        (checks.stated_restitution, 0.8),
        (checks.separation_restitution, 0.8),
        (checks.traced_mass, SAMPLE),
    ):
        assert quantity.value == pytest.approx(true, rel=3e-3)
        assert abs(quantity.value - true) < quantity.expanded
    assert hits[0].sample_mass == pytest.approx(SAMPLE, rel=5e-3)
    assert not find(found.warnings, "balance")
    assert not find(found.warnings, "by the traces")


@pytest.mark.parametrize("off", [0, 1])
def test_what_is_not_known_of_a_zero_is_in_what_its_trace_gives(off):
    """A zero that is off by z moves a change of velocity by z times the contact's duration."""
    impact = replace(CRUSHED, seed=1)
    setup = RigSetup(SampleSet((Sample("struck", SAMPLE),), "struck"), HAMMER, SPEED)
    session = Session(setup)
    for record in (1, 2, 3):
        feed(session, replace(impact, seed=record).measure(), record)
    zeros = np.where(np.arange(2) == off, 5.0, 0.0)
    mean = replace(session.compute_mean("struck"), zero_uncertainty=zeros)
    checks = check_momenta(mean, setup, RigInputs(setup).find("struck"), "struck")
    changes = 1.8 * SPEED / (1.0 / HAMMER + 1.0 / SAMPLE) / np.array((HAMMER, SAMPLE))
    share = 5.0 * DURATION / changes[off]
    for quantity, is_moved in (
        (checks.impulse, off == 0),
        (checks.momentum_ratio, True),
        (checks.traced_mass, True),
        (checks.separation_restitution, True),
    ):
        lines = {line.source: line.contribution for line in quantity.budget}
        assert (ZERO_AFTER in lines) is is_moved
        if is_moved and quantity is not checks.separation_restitution:
            # What is integrated is a little longer than the contact.
            assert share < lines[ZERO_AFTER] / quantity.value < 2.0 * share


@pytest.mark.parametrize("gains", [(0.96, 1.0), (1.0, 1.04)])
def test_a_gain_that_is_four_per_cent_off_is_named_without_a_law(gains):
    found, _ = estimate(CRUSHED, gains)
    (told,) = find(found.warnings, "they do not balance: a gain, a mass")
    found = float(told.partition("m2Δv2/m1Δv1 is ")[2].split()[0])
    assert found == pytest.approx(gains[1] / gains[0], abs=0.003)


def test_momenta_of_one_hit_that_do_not_balance_claim_no_interval():
    found, _ = estimate(CRUSHED, (1.0, 1.04), count=1)
    (told,) = find(found.warnings, "they do not balance: a gain, a mass")
    assert told.endswith(", one hit)")


@pytest.mark.parametrize("stated", [18.5e-3, 211e-3])
def test_another_sample_is_asked_for_at_each_hit_and_of_the_series(stated):
    found, hits = estimate(Impact(resonance=0.0), mass=stated)
    (told,) = find(found.warnings, "another sample was struck")
    assert f"moves as 105 g would, accelerometer included, where {stated * 1e3:.3g} g" in told
    for hit in hits:
        assert hit.accepted
        (finding,) = (item for item in hit.findings if item.reason is Reason.OTHER_SAMPLE)
        assert "another sample was struck" in finding.explanation


def test_a_hit_whose_gain_is_another_is_named():
    found, _ = estimate(CRUSHED, odd=0.97)
    (told,) = find(found.warnings, "balance otherwise")
    assert told.startswith("hits: the momenta of hit 3.1 balance")


@pytest.mark.parametrize(
    ("growth", "told"), [((0.0, 0.01), ["+"]), ((0.01, 0.0), ["-"]), ((0.01, 0.01), [])]
)
def test_a_momentum_ratio_that_changes_is_that_of_sample_over_hammer(growth, told):
    found, _ = estimate(CRUSHED, growth=growth)
    said = find(found.warnings, "momentum ratio changes by")
    assert [text.partition("momentum ratio changes by ")[2][0] for text in said] == told


def test_a_record_that_ends_too_early_says_so():
    session = Session(SETUP)
    for record in (1, 2):
        session.feed(CRUSHED.make_block(HitLabel("struck", record, record)))
    mean = session.compute_mean("struck")
    short = replace(mean, traces=mean.traces[:, : mean.origin + 200])
    checks = check_momenta(short, SETUP, RigInputs(SETUP).find("struck"), "struck")
    assert not checks.impulse.is_known
    assert "the record does not hold all of the pulse" in checks.notes[0].explanation


K, C = "stiffness", "damping_coefficient"
HELD = Laboratory(spring=(4e3, 0.01), record=4e-3, hits=5)
MOUNT = Laboratory(mount=(12e3, 0.02), record=4e-3, hits=5, losses=((1.5, 0.2),))


@pytest.mark.parametrize("spring", [(4e3, 0.02), (2.5e3, 0.3)])
def test_a_sample_on_a_spring_is_weighed_by_newtons_law(spring):
    checks = run_series(replace(HELD, spring=spring, noise=1e-4))[0].checks
    assert checks.hold == "spring"
    assert abs(checks.persistence) < 0.05
    assert checks.traced_mass.value == pytest.approx(HELD.sample, rel=0.02)
    assert not checks.momentum_ratio.is_known
    assert not checks.stated_restitution.is_known
    assert "a spring brings it to rest" in str(checks.notes[-1])


def test_what_rings_about_rest_is_a_spring_and_has_k_and_c():
    found, truth, _ = run_series(HELD)
    decay = found.free_decay
    assert decay.hold == "spring"
    (k, _), (c, _) = (
        truth.figures[f"free_decay.{name}"] for name in ("stiffness", "damping_coefficient")
    )
    assert abs(decay.stiffness.value - k) < decay.stiffness.expanded
    assert abs(decay.damping_coefficient.value - c) < decay.damping_coefficient.expanded


def test_what_rings_about_the_velocity_of_a_free_sample_has_no_k_and_no_c():
    found, _, said = run_series(MOUNT)
    decay = found.free_decay
    assert decay.hold == "free"
    assert decay.frequency == pytest.approx(12e3, rel=0.01)
    assert decay.damping_ratio.value == pytest.approx(0.02, rel=0.05)
    assert not decay.stiffness.is_known
    assert not decay.damping_coefficient.is_known
    assert not found.paper.damping_coefficient.is_known
    assert "as a mount or an inner mode does" in join_findings(said)
    assert found.checks.traced_mass.value == pytest.approx(MOUNT.sample, rel=0.02)


def test_waves_that_go_to_and_fro_in_a_free_bar_are_no_decrement():
    session = Session(SETUP)
    for record in range(1, 6):
        traces = replace(CRUSHED, seed=record, duration=1e-4).measure()
        # A free bar: its end moves on in steps, one for each arrival of the wave.
        echoes = [0.8**number * np.roll(traces[1], 500 * number) for number in range(8)]
        share = sum(0.8**number for number in range(8))
        traces[1] = np.sum(echoes, axis=0) / share
        feed(session, traces, record)
    found = session.estimate_sample("struck")
    assert not found.paper.damping_ratio.is_known
    assert not found.paper.damping_coefficient.is_known
    assert not found.free_decay.stiffness.is_known
