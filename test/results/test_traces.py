"""Traces of a record, of a sample and of a contact law, where the estimates say that they are."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import trapezoid

from impact_rig.core.estimates.contact_law import NO_LAW
from impact_rig.core.given.records import Block, ChannelBlock, HitLabel
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.core.hit.judging import JudgedHit
from impact_rig.core.session import Session
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.contact import make_nominal_contact
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.results.traces import (
    DRIVEN,
    PRINTED,
    SampleTraces,
    TraceAssembler,
    align_hit,
    compute_law_curves,
    sample_traces_from_estimate,
)

CONTROL, STRUCK = "aluminium large", "steel small"


def strike(
    plant: Plant, names: Iterable[str] = (CONTROL, STRUCK)
) -> tuple[Session, list[JudgedHit]]:
    rig, session = VirtualRig(PAPER_SETUP, VirtualRigSettings(plant=plant)), Session(PAPER_SETUP)
    labels = [HitLabel(name, 1, impact) for name in names for impact in (1, 2, 3)]
    hits = [
        hit
        for label in labels
        for block in rig.strike(label).split(5000, 0)
        for hit in session.feed(block)
    ]
    return session, hits


def gather(plant: Plant) -> SampleTraces:
    session, _ = strike(plant)
    found = session.estimate_all()
    estimate = found.samples[-1]
    mean = session.compute_mean(STRUCK)
    assert estimate.name == STRUCK
    return sample_traces_from_estimate(estimate, mean)


@pytest.fixture(scope="module")
def published() -> SampleTraces:
    return gather(Plant.PUBLISHED)


def test_the_hammer_s_half_amplitude_points_stand_around_the_middle(published):
    hammer = np.abs(published.mean[0])
    half = published.half_amplitude_width / 2.0
    levels = np.interp([-half, half], published.time, hammer) / hammer.max()
    # The mean of pulses laid middle on middle is symmetric but for noise and one sampling step.
    assert levels == pytest.approx([0.5, 0.5], abs=0.01)


def test_both_peaks_of_the_decrement_are_maxima_of_the_sample(published):
    sample, time = published.mean[1], published.time
    sign = np.sign(sample[np.argmax(np.abs(sample))])
    first, second = (
        int(np.argmin(np.abs(time - moment)))
        for moment in (published.first_peak_time, published.second_peak_time)
    )
    upright = sign * sample
    assert upright[first] == upright.max()
    around = upright[second - 20 : second + 21]
    assert upright[second] == around.max()
    assert time[first] < published.contact_time / 2.0 < time[second]


def test_models_are_drawn_in_the_scale_of_the_measurement(published):
    assert [model.model for model in published.models] == [DRIVEN, PRINTED]
    for model in published.models:
        assert model.traces.shape == published.mean.shape
        np.testing.assert_allclose(
            np.abs(model.traces).max(axis=1), np.abs(published.mean).max(axis=1), rtol=0.02
        )


def test_a_hit_lies_in_its_sample_s_time():
    _, (hit, *_) = strike(Plant.PUBLISHED)
    aligned = align_hit(hit.label, hit.filtered)
    assert aligned.label == hit.label
    hammer = np.abs(aligned.traces[0])
    inside = aligned.time[hammer >= hammer.max() / 2.0]
    assert (inside[0] + inside[-1]) / 2.0 == pytest.approx(0.0, abs=1.0 / aligned.sampling_rate)
    assert hammer.max() == pytest.approx(hit.hammer_peak, rel=1e-3)


RATE = 2.5e6


def make_channel(counts):
    return ChannelBlock(np.asarray(counts, dtype=np.int32), 0.5, 2.0, 1000.0)


def make_block(first, counts, *, record=1, last=False, triggered=True):
    counts = np.asarray(counts)
    return Block(
        label=HitLabel("steel small", record=record),
        first_sample=first,
        sampling_rate=RATE,
        hammer=make_channel(counts),
        specimen=make_channel(-counts),
        triggered=triggered,
        last=last,
    )


def feed(*blocks):
    assembler = TraceAssembler()
    return [joined for block in blocks if (joined := assembler.feed(block)) is not None]


def test_a_record_comes_calibrated_with_its_last_block():
    (joined,) = feed(make_block(0, [10, 20]), make_block(2, [30], last=True))

    assert joined.label == HitLabel("steel small", record=1)
    assert joined.values.dtype == np.float32
    np.testing.assert_array_equal(joined.values, [[7, -3], [12, -8], [17, -13]])
    np.testing.assert_allclose(joined.time, np.arange(3) / RATE, rtol=1e-12)


def test_a_gap_breaks_the_line():
    (joined,) = feed(make_block(0, [1, 2]), make_block(4, [3], last=True))

    np.testing.assert_allclose(joined.time * RATE, [0, 1, 2, 4], rtol=1e-12)
    assert np.isnan(joined.values[2]).all()
    assert np.isfinite(joined.values[[0, 1, 3]]).all()


def test_a_record_without_its_end_is_dropped_when_the_next_begins():
    (joined,) = feed(make_block(0, [1, 2]), make_block(0, [3], record=2, last=True))

    assert joined.label.record == 2
    assert joined.values.shape == (1, 2)


def test_a_sample_that_was_not_measured_is_not_a_number():
    block = make_block(0, [10, 20], last=True)
    (joined,) = feed(replace(block, specimen=replace(block.specimen, output=np.empty(0))))

    np.testing.assert_array_equal(joined.values, [[7, np.nan], [12, np.nan]])


SAMPLE = "steel medium"
RESTITUTION = 0.7


@pytest.fixture(scope="module")
def struck():
    """Return a sample's estimate and traces after five hits under a contact law."""
    settings = VirtualRigSettings(
        plant=Plant.CONTACT, amplitude_scatter=0.0, restitution=RESTITUTION
    )
    rig, session = VirtualRig(PAPER_SETUP, settings), Session(PAPER_SETUP)
    for impact in range(1, 6):
        for block in rig.strike(HitLabel(SAMPLE, impact, impact)).split(5000, 0):
            session.feed(block)
    estimate, mean = session.estimate_sample(SAMPLE), session.compute_mean(SAMPLE)
    return estimate, sample_traces_from_estimate(estimate, mean)


def test_the_law_lies_on_the_pulse_and_the_versed_sine_beside_it(struck):
    estimate, traces = struck
    curves = compute_law_curves(estimate.contact_law, traces, PAPER_SETUP)
    peak = curves.measured.max()
    law, versed = (
        np.abs(curves.measured - model).max() / peak for model in (curves.law, curves.versed_sine)
    )
    assert law < 3e-3
    assert versed > 1e-2
    assert curves.time[0] == pytest.approx(-curves.time[-1], abs=1e-6)


def test_both_loops_hold_the_energy_lost(struck):
    estimate, traces = struck
    contact = make_nominal_contact(PAPER_SETUP, SAMPLE, 1.5, RESTITUTION)
    lost = contact.equivalent_mass * contact.impact_speed**2 * (1.0 - contact.restitution**2) / 2.0
    curves = compute_law_curves(estimate.contact_law, traces, PAPER_SETUP)
    assert trapezoid(curves.law_force, curves.law_indentation) == pytest.approx(lost, rel=0.03)
    assert trapezoid(curves.loop_force, curves.indentation) == pytest.approx(lost, rel=0.05)
    assert curves.indentation.max() == pytest.approx(curves.law_indentation.max(), rel=5e-3)


def test_one_trace_has_no_loop_and_no_law_no_curves(struck):
    estimate, traces = struck
    alone = replace(traces, mean=traces.mean[:1])
    assert compute_law_curves(estimate.contact_law, alone, PAPER_SETUP).indentation.size == 0
    assert compute_law_curves(NO_LAW, traces, PAPER_SETUP) is None
