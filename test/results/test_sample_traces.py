"""Traces laid over each other: where the estimates say that something is, there it is."""

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.hits import JudgedHit
from impact_rig.core.quantity import UNKNOWN
from impact_rig.core.records import HitLabel
from impact_rig.core.session import Session
from impact_rig.core.setup import PAPER_SETUP
from impact_rig.devices.virtual.rig import Plant, VirtualRig, VirtualRigSettings
from impact_rig.results.sample_traces import (
    DRIVEN,
    IDENTIFIED,
    PRINTED,
    SampleTraces,
    align_hit,
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


def gather(plant: Plant, *, with_models: bool) -> SampleTraces:
    session, _ = strike(plant)
    found = session.estimate_all() if with_models else session.estimate_all_without_models()
    estimate = found.samples[-1]
    mean = session.compute_mean(STRUCK)
    assert estimate.name == STRUCK
    return sample_traces_from_estimate(estimate, mean)


@pytest.fixture(scope="module")
def published() -> SampleTraces:
    return gather(Plant.PUBLISHED, with_models=False)


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


def test_the_fitted_model_is_there_once_it_is_fitted():
    traces = gather(Plant.DYNAMICS, with_models=True)
    fitted, driven = traces.find_model(IDENTIFIED), traces.find_model(DRIVEN)
    # On the plant that follows the equations nothing but noise is left.
    assert fitted.mse_sample_percent < driven.mse_sample_percent / 10.0


def test_a_hit_lies_in_its_sample_s_time():
    _, (hit, *_) = strike(Plant.PUBLISHED)
    aligned = align_hit(hit)
    assert aligned.label == hit.label
    hammer = np.abs(aligned.traces[0])
    inside = aligned.time[hammer >= hammer.max() / 2.0]
    assert (inside[0] + inside[-1]) / 2.0 == pytest.approx(0.0, abs=1.0 / aligned.sampling_rate)
    assert hammer.max() == pytest.approx(hit.hammer_peak, rel=1e-3)


def test_what_has_no_contact_has_no_traces():
    session, _ = strike(Plant.PUBLISHED)
    estimate, mean = session.estimate_sample(CONTROL), session.compute_mean(CONTROL)
    assert sample_traces_from_estimate(replace(estimate, contact_time=UNKNOWN), mean) is None
    assert math.isfinite(estimate.first_peak_time)
