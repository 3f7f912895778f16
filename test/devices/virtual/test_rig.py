"""The virtual rig hit by hit: repeatable, and faulty on request."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.findings import Reason
from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.core.hit.judging import JudgedHit
from impact_rig.core.session import Session
from impact_rig.devices.virtual.choices import Fault
from impact_rig.devices.virtual.draws import draw_truth
from impact_rig.devices.virtual.rig import (
    DigitizerSettings,
    FaultPlan,
    ScheduledFault,
    VirtualHit,
    VirtualRig,
    VirtualRigSettings,
    compute_scale,
    couple,
    digitize,
)


def make_random() -> np.random.Generator:
    return np.random.default_rng(1)


@given(bits=st.integers(4, 24), full_scale=st.floats(1, 1e5), seed=st.integers(0, 99))
def test_quantisation_is_off_by_half_a_step_at_most(bits, full_scale, seed):
    settings = DigitizerSettings(bits=bits, noise=0.0, offset=0.0, coupling_frequency=0.0)
    step = compute_scale(full_scale, bits)
    largest = full_scale - step
    signal = np.random.default_rng(seed).uniform(-full_scale, largest, 500)
    counts = digitize(signal, full_scale, settings, make_random())
    assert counts.dtype == np.int32
    assert np.abs(counts * step - signal).max() <= step / 2 * (1 + 1e-9)


def test_what_does_not_fit_stands_at_the_rails():
    settings = DigitizerSettings(bits=12, noise=0.0, offset=0.0, coupling_frequency=0.0)
    counts = digitize(np.array([-1e9, -101.0, 101.0, 1e9]), 100.0, settings, make_random())
    np.testing.assert_array_equal(counts, [-2048, -2048, 2047, 2047])


def test_noise_and_offset_are_parts_of_full_scale():
    settings = DigitizerSettings(bits=24, noise=1e-3, offset=2e-3, coupling_frequency=0.0)
    counts = digitize(np.zeros(20_000), 2000.0, settings, make_random())
    signal = counts * compute_scale(2000.0, 24)
    # 20 000 points of noise 2: a mean within 0.05.
    assert signal.mean() == pytest.approx(4.0, abs=0.05)
    assert signal.std() == pytest.approx(2.0, rel=0.03)


def test_coupling_answers_a_step_as_an_rc_stage_does():
    time = np.arange(5000) / 2.5e6
    answer = couple(np.ones(5000), 500.0, 2.5e6)
    # The bilinear design is half a point early: 0.06 % at this corner.
    np.testing.assert_allclose(answer, np.exp(-2 * np.pi * 500.0 * time), rtol=0, atol=1e-3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sampling_rate": 0.0}, "sampling rate is 0.0 Hz"),
        ({"record_duration": 1e-6}, "which is 2 points at 2.5e+06 Hz: a record needs 100"),
        ({"pre_trigger": 1.0}, "pre-trigger is 1.0: it must lie between 0 and 0.002"),
        ({"bits": 2}, "bits is 2: it must lie between 4 and 31"),
        ({"noise": float("nan")}, "noise is nan"),
    ],
)
def test_impossible_settings_are_refused(changes, message):
    with pytest.raises(ParameterError) as error:
        DigitizerSettings(**changes)
    assert message in str(error.value)


LABEL = HitLabel("steel small", record=1, impact=3, attempt=1)


def test_each_fault_comes_with_its_probability():
    random = make_random()
    drawn = [FaultPlan(0.1).draw(LABEL, random) for _ in range(4000)]
    for fault in Fault:
        share = sum(fault in faults for faults in drawn) / 4000
        # Three standard deviations of 4000 draws.
        assert share == pytest.approx(0.1, abs=3 * np.sqrt(0.1 * 0.9 / 4000))


@pytest.mark.parametrize(
    ("sample", "impact", "attempt", "comes"),
    [
        ("", 3, 1, True),
        ("steel small", 3, 1, True),
        ("brass large", 3, 1, False),
        ("", 4, 1, False),
        ("", 3, 2, False),
    ],
)
def test_an_ordered_fault_comes_once(sample, impact, attempt, comes):
    plan = FaultPlan(scheduled=(ScheduledFault(Fault.WEAK_HIT, impact, sample),))
    label = HitLabel("steel small", record=9, impact=3, attempt=attempt)
    assert plan.draw(label, make_random()) == ((Fault.WEAK_HIT,) if comes else ())


BLOCK_SIZE = 1000
NAMES = PAPER_SETUP.samples.names
labels = st.builds(
    HitLabel,
    sample=st.sampled_from(NAMES),
    record=st.integers(1, 999),
    impact=st.integers(1, 99),
    attempt=st.integers(1, 9),
)


def strike(label: HitLabel, **changes: object) -> VirtualHit:
    return VirtualRig(PAPER_SETUP, VirtualRigSettings(**changes)).strike(label)


def judge(hit: VirtualHit) -> JudgedHit:
    """Stream a hit into a new session; exactly one record must come out."""
    session = Session(PAPER_SETUP)
    blocks = hit.split(BLOCK_SIZE, stamp=1_000_000)
    (judged,) = (item for block in blocks for item in session.feed(block))
    return judged


class TestHit:
    """One hit."""

    @given(label=labels, seed=st.integers(0, 2**32))
    @settings(max_examples=12)
    def test_depends_on_seed_and_label_alone(self, label, seed):
        one = strike(label, seed=seed)
        rig = VirtualRig(PAPER_SETUP, VirtualRigSettings(seed=seed))
        rig.strike(HitLabel(NAMES[0]))
        other = rig.strike(replace(label, record=label.record + 1))
        assert one.model == other.model
        np.testing.assert_array_equal(one.hammer.output, other.hammer.output)
        np.testing.assert_array_equal(one.specimen.output, other.specimen.output)

    def test_scatters_as_it_is_told(self):
        hits = [strike(HitLabel("steel small", impact=i)).model for i in range(1, 401)]
        times = np.array([model.contact_time for model in hits]) / 170.0e-6
        forces = np.array([model.peak_force for model in hits])
        # 400 hits tell a mean within 3 sigma / 20, and a deviation within 3 / sqrt(800).
        assert times.mean() == pytest.approx(1.0, abs=3 * 3e-3 / 20)
        assert times.std() == pytest.approx(3e-3, rel=3 / math.sqrt(800))
        assert forces.std() / forces.mean() == pytest.approx(2e-2, rel=3 / math.sqrt(800))

    @given(label=labels)
    @settings(max_examples=12)
    def test_stays_the_same_when_faults_are_drawn_beside_it(self, label):
        plain = strike(label)
        plan = FaultPlan(1.0, (Fault.LOST_BLOCK, Fault.MISSED_TRIGGER))
        faulty = strike(label, faults=plan)
        np.testing.assert_array_equal(faulty.hammer.output, plain.hammer.output)
        assert faulty.model == plain.model


REASONS = {
    Fault.DOUBLE_HIT: Reason.DOUBLE_HIT,
    Fault.OVERLOAD: Reason.OVERLOAD,
    Fault.WEAK_HIT: Reason.WEAK,
    Fault.MISSED_TRIGGER: Reason.NO_TRIGGER,
    Fault.DEAD_CHANNEL: Reason.DEAD_CHANNEL,
    Fault.LOST_BLOCK: Reason.GAP,
}


class TestFaults:
    """Whatever goes wrong is named."""

    @given(label=labels, seed=st.integers(0, 1000))
    @settings(max_examples=12)
    def test_a_hit_without_one_is_accepted(self, label, seed):
        assert judge(strike(label, seed=seed)).rejections == ()

    @pytest.mark.parametrize("fault", Fault)
    @given(label=labels, seed=st.integers(0, 1000))
    @settings(max_examples=12)
    def test_each_is_named_by_its_reason_and_no_other(self, fault, label, seed):
        judged = judge(strike(label, seed=seed, faults=FaultPlan(1.0, (fault,))))
        assert {item.reason for item in judged.rejections} == {REASONS[fault]}

    @given(
        label=labels, seed=st.integers(0, 1000), faults=st.sets(st.sampled_from(Fault), min_size=2)
    )
    def test_several_at_once_are_never_accepted_nor_taken_for_another(self, label, seed, faults):
        hit = strike(label, seed=seed, faults=FaultPlan(1.0, tuple(faults)))
        found = {item.reason for item in judge(hit).rejections}
        assert found
        expected = {REASONS[fault] for fault in faults}
        if {Fault.DEAD_CHANNEL, Fault.LOST_BLOCK} <= faults:
            # What would show that the hammer's channel is dead is lost.
            expected.add(Reason.NO_PULSE)
        assert found <= expected


def test_a_campaign_gives_the_papers_tables_back():
    """Tables 2 to 4 and Fig. 6, within what is asked for."""
    rig, session = VirtualRig(PAPER_SETUP, VirtualRigSettings(seed=1)), Session(PAPER_SETUP)
    for name in NAMES:
        for impact in range(1, 11):
            for block in rig.strike(HitLabel(name, impact, impact)).split(BLOCK_SIZE, stamp=0):
                assert all(judged.accepted for judged in session.feed(block))
    results = session.estimate_all()
    assert [item.name for item in results.samples] == list(NAMES)
    for found, cell in zip(results.samples, PAPER_SETUP.samples.samples, strict=True):
        assert found.paper.contact_time.is_known
        assert found.paper.contact_time.value == pytest.approx(
            cell.reference_contact_time, rel=5e-3
        )
        assert found.paper.stiffness.value == pytest.approx(cell.reference_stiffness, rel=15e-3)
        assert found.paper.damping_coefficient.value == pytest.approx(
            cell.reference_damping_coefficient, rel=5e-2
        )
        assert found.errors.mse_hammer_percent < 0.25
        assert found.errors.mse_sample_percent < 0.05
        # Read as a versed-sine, for it is one.
        assert found.paper.width_ratio == pytest.approx(1.59, abs=0.01)
    assert results.hammer.stiffness.value == pytest.approx(22.54e6, rel=15e-3)
    assert results.hammer.damping_coefficient.value == pytest.approx(1909.0, rel=5e-2)


def test_masses_gains_and_clock_are_drawn_once_for_a_seed_by_their_uncertainties():
    drawn = [draw_truth(PAPER_SETUP, seed) for seed in range(2000)]
    for found, standard in (
        ([item.setup.hammer_mass for item in drawn], PAPER_SETUP.hammer_mass_uncertainty),
        ([item.clock for item in drawn], PAPER_SETUP.clock_uncertainty),
        # Nothing states the gains of the paper: they are as they are assumed.
        ([item.gains[1] for item in drawn], 0.03),
    ):
        # 2000 draws know their scatter to 1.6 %: four of those.
        assert np.std(found) == pytest.approx(standard, rel=0.064)
    label = HitLabel("steel small", 1, 1)
    plain, moved, again = (
        VirtualRig(PAPER_SETUP, VirtualRigSettings(seed=4, draws=draws)).strike(label)
        for draws in (False, True, True)
    )
    np.testing.assert_array_equal(moved.hammer.output, again.hammer.output)
    assert moved.sampling_rate == plain.sampling_rate
    truth = draw_truth(PAPER_SETUP, 4)
    assert moved.model.hammer.mass == truth.setup.hammer_mass != plain.model.hammer.mass
    # The published pulses are alike but for gain, clock and the force of other masses.
    peaks = [np.ptp(hit.hammer.output) / hit.model.peak_force * hit.model.hammer.mass
             for hit in (moved, plain)]  # fmt: skip
    assert peaks[0] / peaks[1] == pytest.approx(truth.gains[0], rel=2e-3)
