"""The level after the impact: its cause, its size, and what is left when it is corrected."""

from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.hits import JudgedHit
from impact_rig.core.records import HitLabel
from impact_rig.core.session import Session
from impact_rig.core.verdict import Reason

from .struck import SETUP, Impact, judge, repeat

SOUND = Impact(resonance=1e6)


def find_causes(hits: list[JudgedHit]) -> set[tuple[Reason, ...]]:
    assert all(hit.accepted for hit in hits)
    return {tuple(item.reason for item in hit.findings) for hit in hits}


@pytest.mark.parametrize(
    ("fault", "cause"),
    [
        ({"zero_shift": 0.02}, Reason.ZERO_SHIFT),
        ({"zero_shift": 0.03}, Reason.ZERO_SHIFT),
        ({"zero_shift": -0.03}, Reason.ZERO_SHIFT),
        ({"zero_shift": 0.03, "recovery": 1e-3}, Reason.ZERO_SHIFT),
        ({"corner": 50.0}, Reason.DROOP),
        ({"corner": 200.0}, Reason.DROOP),
        ({"drift": 0.02}, Reason.DRIFT),
    ],
    ids=str,
)
def test_what_shifts_the_zero_is_named_and_taken_off(fault, cause):
    session, hits = judge(repeat(replace(SOUND, **fault)))
    assert find_causes(hits) == {(cause, cause)}
    estimate = session.estimate_sample("struck")
    law = estimate.contact_law
    assert law.duration.value == pytest.approx(212e-6, rel=0.002)
    assert law.momentum_ratio.value == pytest.approx(1.0, abs=0.005)
    told = [text for text in estimate.warnings if text.startswith(cause.value)]
    assert told[0].startswith(f"{cause.value} corrected in 5 of 5 hits, in the last: zero of the")


def test_the_size_and_the_corner_are_told():
    (hit,) = judge(repeat(replace(SOUND, corner=50.0), 1))[1]
    assert float(hit.findings[0].explanation.split()[-5]) == pytest.approx(50.0, abs=1.0)
    (hit,) = judge(repeat(replace(SOUND, zero_shift=0.03), 1))[1]
    assert "a step of 3 % of the peak" in hit.findings[0].explanation


@pytest.mark.parametrize("corner", [30.0, 100.0, 200.0, 400.0])
@pytest.mark.parametrize("restitution", [1.0, 0.7])
def test_one_corner_has_one_name_on_all_hits_and_both_channels(corner, restitution):
    fault = replace(SOUND, corner=corner, restitution=restitution, resonance=70e3)
    assert find_causes(judge(repeat(fault, 10))[1]) == {(Reason.DROOP, Reason.DROOP)}


@pytest.mark.parametrize("channel", ["hammer", "specimen"])
@pytest.mark.parametrize("fault", [{"zero_shift": 0.03}, {"corner": 200.0}], ids=str)
def test_what_one_channel_alone_has_accuses_no_gain(channel, fault):
    session = Session(SETUP)
    for record in range(1, 6):
        label = HitLabel("struck", record, record)
        sound, bad = (replace(SOUND, seed=record, **change) for change in ({}, fault))
        other = getattr(bad.make_block(label), channel)
        session.feed(replace(sound.make_block(label), **{channel: other}))
    estimate = session.estimate_sample("struck")
    assert estimate.impacts_accepted == 5
    ratio = estimate.contact_law.momentum_ratio
    assert abs(ratio.value - 1.0) < ratio.expanded
    assert not [text for text in estimate.warnings if "balance" in text]


def test_a_tail_that_rings_is_ringing():
    time = np.arange(5000) / 2.5e6 - 200e-6
    wave = 0.1 * np.exp(-1e3 * time) * np.sin(2.0 * np.pi * 8e3 * time) * (time > 0.0)
    block = SOUND.make_block(HitLabel("struck", 1, 1))
    ringing = block.hammer.output + np.rint(wave * block.hammer.output.max()).astype(np.int32)
    (hit,) = Session(SETUP).feed(replace(block, hammer=replace(block.hammer, output=ringing)))
    told = [item for item in hit.findings if item.reason is Reason.RINGING]
    assert "at 8 kHz" in told[0].explanation
    assert Reason.UNSTEADY_ZERO not in {item.reason for item in (*hit.rejections, *hit.findings)}


def test_where_in_the_shock_the_step_came_is_in_the_budgets():
    estimate = judge(repeat(replace(SOUND, zero_shift=0.03)))[0].estimate_sample("struck")
    for quantity in (estimate.contact_law.duration, estimate.contact_time):
        assert "zero after the impact" in {line.source for line in quantity.budget}
    sound = judge(repeat(SOUND))[0].estimate_sample("struck")
    assert "zero after the impact" not in {line.source for line in sound.contact_time.budget}


def test_of_the_hammer_alone_some_hits_may_be_corrected():
    session = Session(SETUP)
    for record, shift in ((1, 0.0), (2, 0.03)):
        block = replace(SOUND, zero_shift=shift, seed=record).make_block(
            HitLabel("struck", record, record)
        )
        nothing = replace(block.specimen, output=block.specimen.output[:0])
        (hit,) = session.feed(replace(block, specimen=nothing))
        assert hit.accepted
    assert session.estimate_sample("struck").contact_time.is_known


def test_a_step_too_large_to_be_sure_of_rejects_the_hit():
    (hit,) = judge(repeat(replace(SOUND, zero_shift=0.2), 1))[1]
    assert Reason.ZERO_SHIFT in {item.reason for item in hit.rejections}
