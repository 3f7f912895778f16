"""The virtual rig hit by hit: repeatable, and faulty on request."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impact_rig.core.errors import ParameterError
from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.hits.reasons import Reason
from impact_rig.core.model.pulses import HERTZ, PULSE_SHAPES, PulseShape
from impact_rig.core.session import Session
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual import rig as virtual_rig
from impact_rig.devices.virtual.choices import Fault, Plant
from impact_rig.devices.virtual.faults import FaultPlan
from impact_rig.devices.virtual.rig import VirtualHit, VirtualRig, VirtualRigSettings

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
    """Stream a hit into a session of its own; exactly one record must come out."""
    session = Session(PAPER_SETUP)
    blocks = hit.split(BLOCK_SIZE, stamp=1_000_000)
    (judged,) = (item for block in blocks for item in session.feed(block))
    return judged


class TestHit:
    """One hit."""

    @given(label=labels, seed=st.integers(0, 2**32))
    @settings(max_examples=50)
    def test_depends_on_seed_and_label_alone(self, label: HitLabel, seed: int) -> None:
        one = strike(label, seed=seed)
        rig = VirtualRig(PAPER_SETUP, VirtualRigSettings(seed=seed))
        rig.strike(HitLabel(NAMES[0]))
        other = rig.strike(replace(label, record=label.record + 1))
        assert one.model == other.model
        np.testing.assert_array_equal(one.hammer.output, other.hammer.output)
        np.testing.assert_array_equal(one.specimen.output, other.specimen.output)

    @pytest.mark.parametrize("field", ["impact", "attempt"])
    def test_is_another_one_each_time(self, field: str) -> None:
        label = HitLabel("steel small")
        other = replace(label, **{field: 2})
        assert strike(label).model != strike(other).model
        assert np.any(strike(label).hammer.output != strike(other).hammer.output)

    def test_is_another_one_with_each_seed(self) -> None:
        label = HitLabel("steel small")
        assert strike(label, seed=1).model != strike(label, seed=2).model

    def test_scatters_as_it_is_told(self) -> None:
        hits = [strike(HitLabel("steel small", impact=i)).model for i in range(1, 401)]
        times = np.array([model.contact_time for model in hits]) / 170.0e-6
        forces = np.array([model.peak_force for model in hits])
        # 400 hits tell a mean within 3 sigma / 20, and a deviation within 3 / sqrt(800).
        assert times.mean() == pytest.approx(1.0, abs=3 * 3e-3 / 20)
        assert times.std() == pytest.approx(3e-3, rel=3 / math.sqrt(800))
        assert forces.std() / forces.mean() == pytest.approx(2e-2, rel=3 / math.sqrt(800))

    def test_is_measured_as_it_was_made(self) -> None:
        for name in NAMES:
            hit = strike(HitLabel(name))
            # Two steps of noise: 0.1 % in a single hit's width.
            assert judge(hit).contact_time == pytest.approx(hit.model.contact_time, rel=4e-3)

    @given(label=labels)
    @settings(max_examples=50)
    def test_stays_the_same_when_faults_are_drawn_beside_it(self, label: HitLabel) -> None:
        plain = strike(label)
        plan = FaultPlan(1.0, (Fault.LOST_BLOCK, Fault.MISSED_TRIGGER))
        faulty = strike(label, faults=plan)
        np.testing.assert_array_equal(faulty.hammer.output, plain.hammer.output)
        assert faulty.model == plain.model

    def test_uses_the_digitizers_range(self) -> None:
        for name in NAMES:
            hit = strike(HitLabel(name))
            for channel in (hit.hammer, hit.specimen):
                used = np.abs(channel.output).max() * abs(channel.scale) / channel.full_scale
                assert 0.05 < used < 0.95


class TestStream:
    """A hit as blocks."""

    @given(size=st.integers(1, 6000))
    @settings(max_examples=30)
    def test_joins_to_the_record(self, size: int) -> None:
        hit = strike(HitLabel("steel small"))
        blocks = hit.split(size, stamp=1_000)
        assert [block.last for block in blocks] == [False] * (len(blocks) - 1) + [True]
        assert [block.first_sample for block in blocks] == list(range(0, 5000, size))
        assert [block.stamp - 1_000 for block in blocks] == [
            block.first_sample * 400 for block in blocks
        ]
        for name in ("hammer", "specimen"):
            joined = np.concatenate([getattr(block, name).output for block in blocks])
            np.testing.assert_array_equal(joined, getattr(hit, name).output)

    def test_of_a_missed_trigger_is_one_empty_block(self) -> None:
        hit = strike(HitLabel("steel small"), faults=FaultPlan(1.0, (Fault.MISSED_TRIGGER,)))
        (block,) = hit.split(BLOCK_SIZE, stamp=5)
        assert not block.triggered
        assert block.last
        assert block.hammer.output.size == block.specimen.output.size == 0

    @pytest.mark.parametrize("size", [100, 1000, 2500, 4999])
    def test_lacks_a_lost_block(self, size: int) -> None:
        label = HitLabel("steel small")
        whole = strike(label).split(size, stamp=0)
        lossy = strike(label, faults=FaultPlan(1.0, (Fault.LOST_BLOCK,))).split(size, stamp=0)
        assert len(lossy) == len(whole) - 1
        assert lossy[-1].last

    def test_needs_blocks_of_one_point_at_least(self) -> None:
        with pytest.raises(ParameterError, match="block size is 0 points: it must be 1 or more"):
            strike(HitLabel("steel small")).split(0, stamp=0)


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
    @settings(max_examples=50)
    def test_a_hit_without_one_is_accepted(self, label: HitLabel, seed: int) -> None:
        assert judge(strike(label, seed=seed)).rejections == ()

    @pytest.mark.parametrize("fault", Fault)
    @given(label=labels, seed=st.integers(0, 1000))
    @settings(max_examples=50)
    def test_each_is_named_by_its_reason_and_no_other(
        self, fault: Fault, label: HitLabel, seed: int
    ) -> None:
        judged = judge(strike(label, seed=seed, faults=FaultPlan(1.0, (fault,))))
        assert {item.reason for item in judged.rejections} == {REASONS[fault]}

    @pytest.mark.parametrize("shape", PULSE_SHAPES, ids=lambda shape: shape.name)
    @pytest.mark.parametrize("plant", [Plant.PUBLISHED, Plant.DYNAMICS])
    def test_the_faintest_and_nearest_double_hit_is_named_for_every_pulse(
        self, monkeypatch: pytest.MonkeyPatch, plant: Plant, shape: PulseShape
    ) -> None:
        monkeypatch.setattr(virtual_rig, "DOUBLE_HEIGHT_RANGE", (0.05, 0.05))
        monkeypatch.setattr(virtual_rig, "DOUBLE_DELAY_RANGE", (1.2, 1.2))
        plan = FaultPlan(1.0, (Fault.DOUBLE_HIT,))
        for name in PAPER_SETUP.samples.names:
            hit = strike(HitLabel(name), plant=plant, pulse_shape=shape, faults=plan)
            assert {item.reason for item in judge(hit).rejections} == {Reason.DOUBLE_HIT}
            good = strike(HitLabel(name), plant=plant, pulse_shape=shape)
            assert judge(good).accepted

    @given(
        label=labels,
        seed=st.integers(0, 1000),
        faults=st.sets(st.sampled_from(Fault), min_size=2),
    )
    def test_several_at_once_are_never_accepted_nor_taken_for_another(
        self, label: HitLabel, seed: int, faults: set[Fault]
    ) -> None:
        hit = strike(label, seed=seed, faults=FaultPlan(1.0, tuple(faults)))
        found = {item.reason for item in judge(hit).rejections}
        assert found
        expected = {REASONS[fault] for fault in faults}
        if {Fault.DEAD_CHANNEL, Fault.LOST_BLOCK} <= faults:
            # What would show that the hammer's channel is dead is lost.
            expected.add(Reason.NO_PULSE)
        assert found <= expected

    def test_drift_does_not_change_the_contact_time(self) -> None:
        quiet = VirtualRigSettings()
        drifting = replace(quiet, digitizer=replace(quiet.digitizer, drift=0.01))
        label = HitLabel("steel small")
        plain, drifted = (
            judge(VirtualRig(PAPER_SETUP, item).strike(label)) for item in (quiet, drifting)
        )
        assert drifted.accepted
        # 1 % of full scale over the record is 0.1 % over the pulse, of half its height.
        assert drifted.contact_time == pytest.approx(plain.contact_time, rel=5e-3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seed": -1}, "seed is -1: it must be 0 or more"),
        ({"contact_time_scatter": 0.5}, "contact time scatter is 0.5"),
        ({"amplitude_scatter": -0.1}, "amplitude scatter is -0.1"),
        ({"asymmetry": 0.8}, "asymmetry is 0.8: it must lie between -0.5 and 0.5"),
        ({"hammer_damping": -1.0}, "hammer damping coefficient is -1.0 N s/m"),
    ],
)
def test_what_cannot_be_meant_is_refused(changes: dict[str, float], message: str) -> None:
    with pytest.raises(ParameterError) as error:
        VirtualRigSettings(**changes)
    assert message in str(error.value)


def test_an_unknown_sample_cannot_be_struck() -> None:
    with pytest.raises(
        ParameterError, match="unknown sample 'gold': the set has 'aluminium small'"
    ):
        strike(HitLabel("gold"))


def test_a_pulse_shape_that_the_plant_cannot_have_is_refused() -> None:
    with pytest.raises(ParameterError, match="'Hertz' is not for the plant dynamics_printed"):
        VirtualRigSettings(plant=Plant.DYNAMICS_PRINTED, pulse_shape=HERTZ)
