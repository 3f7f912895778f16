"""Accepted hits, filtered as the estimator does it, whichever comes first: hit or verdict."""

from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.session import Session
from impact_rig.core.setup.paper import CONTROL_SAMPLE, PAPER_SETUP
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.choices import Fault
from impact_rig.devices.virtual.faults import FaultPlan, ScheduledFault
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.nodes.visualizing.overlay import WAITING_HITS, HitOverlay, is_shown

FAULTS = FaultPlan(scheduled=(ScheduledFault(Fault.WEAK_HIT, 2),))
RIG = VirtualRig(PAPER_SETUP, VirtualRigSettings(faults=FAULTS))


def strike(record=1):
    """Return the blocks of one hit; the second record is a weak one."""
    label = HitLabel(CONTROL_SAMPLE, record=record, impact=record)
    return label, RIG.strike(label).split(1000, 0)


@pytest.fixture
def overlay():
    return HitOverlay(PAPER_SETUP.analysis)


def feed(overlay, blocks):
    return [hit for block in blocks for hit in overlay.feed(block)]


def test_a_hit_waits_for_its_verdict(overlay):
    label, blocks = strike()
    assert feed(overlay, blocks) == []

    hit = overlay.accept(label)
    assert hit.label == label
    assert overlay.accept(label) is None, "shown once"


def test_a_verdict_waits_for_its_hit(overlay):
    label, blocks = strike()
    assert overlay.accept(label) is None

    (hit,) = feed(overlay, blocks)
    assert hit.label == label


def test_it_is_the_trace_that_the_mean_of_one_hit_is(overlay):
    label, blocks = strike()
    feed(overlay, blocks)
    hit = overlay.accept(label)
    session = Session(PAPER_SETUP)
    for block in blocks:
        session.feed(block)
    mean = session.find_mean(CONTROL_SAMPLE)

    # Means are made of hits in single precision.
    np.testing.assert_array_equal(hit.traces.astype(np.float32), mean.traces)
    assert hit.start_time == -mean.origin / mean.sampling_rate


def test_a_hit_that_nobody_accepts_is_not_shown(overlay):
    label, blocks = strike(record=2)
    feed(overlay, blocks)
    assert overlay.accept(label) is None


def test_what_waits_for_ever_is_forgotten(overlay):
    first, blocks = strike(record=3)
    feed(overlay, blocks)
    for record in range(4, 4 + WAITING_HITS):
        feed(overlay, strike(record)[1])
    assert overlay.accept(first) is None
    assert overlay.accept(HitLabel(CONTROL_SAMPLE, record=4, impact=4)) is not None


def test_of_a_long_series_ever_fewer_hits_are_shown(overlay):
    shown = 0
    (block,) = RIG.strike(HitLabel(CONTROL_SAMPLE)).split(10_000, 0)
    for record in range(1, 1101):
        named = HitLabel(CONTROL_SAMPLE, record=record, impact=record)
        overlay.accept(named)
        shown += len(overlay.feed(replace(block, label=named)))
    assert shown == 99 + 90 + 2
    # Another sample begins with every one.
    other = HitLabel("steel small", record=2000)
    overlay.accept(other)
    assert len(overlay.feed(replace(block, label=other))) == 1


def test_of_ten_thousand_hits_280_are_shown():
    assert sum(map(is_shown, range(1, 10_001))) == 99 + 90 + 90 + 1
    assert all(map(is_shown, range(1, 100)))


def test_a_low_pass_that_the_sampling_is_too_slow_for_is_told(overlay):
    _, blocks = strike()
    slow = [replace(block, sampling_rate=50e3) for block in blocks]
    assert feed(overlay, slow) == []
    assert "hits are not laid over each other" in overlay.fault
    assert "cutoff" in overlay.fault
