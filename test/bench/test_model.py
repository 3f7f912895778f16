"""The parts `model` and `hit`: their peers are independent, and all that is asked is measured."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from bench import model
from impact_rig.core.estimation.law_fit import fit_law
from impact_rig.core.model.impact import Body, ImpactModel, ModelVariant
from impact_rig.core.session import Session
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.signals.filtering import low_pass
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings


def test_the_integrator_solves_a_free_oscillator():
    # Without a force, and long after a very short contact, the hammer is left alone.
    hammer = Body(0.1, 2e7, 300.0)
    impact = ImpactModel(hammer, Body(0.2, 4e7, 500.0), 1e-9, 0.1, 0.0)
    times = np.arange(1, 200) / 2.5e6
    found = model.integrate_impact(impact, times, ModelVariant.PRINTED)[0]
    matrix = np.array([[0.0, 1.0], [-2e7 / 0.1, -300.0 / 0.1]])
    expected = [(matrix @ expm(matrix * t) @ [0.0, 0.1])[1] for t in times]
    assert found == pytest.approx(np.array(expected), rel=1e-4)


@pytest.mark.parametrize("variant", ModelVariant)
def test_closed_form_and_integrator_agree(variant):
    for impact in model.make_models(3, seed=1):
        # Between its steps the integrator interpolates worse than it steps.
        assert 0.0 < model.compute_difference(impact, variant) < 1e-7


def test_both_variants_are_measured_against_every_peer(bench, monkeypatch):
    monkeypatch.setattr(model, "BATCH", 5)
    monkeypatch.setattr(model, "COUNT", 1000)
    monkeypatch.setattr(model, "CALLS", 2)
    figures = list(model.measure_model(bench))
    assert [figure.name.split(",")[0] for figure in figures] == ["driven"] * 6 + ["printed"] * 6
    asked = [str(figure.goal or "") for figure in figures[:6]]
    assert asked == ["at least 150", "", "at most 1e-09", "at most 3", "", "at least 2"]
    assert all(math.isfinite(value) for figure in figures for value in figure.values)


def test_the_peer_filters_as_the_analysis_does():
    (blocks,) = model.strike_hits(1)
    traces = model.read_traces(blocks)
    (found,) = model.filter_all([traces], model.design_sections())
    expected = low_pass(traces, model.CUTOFF, model.SAMPLING_RATE)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_the_time_of_a_hit_and_its_ratio_are_measured(bench):
    ratio, time, law, gain = model.measure_hit(bench)
    assert str(ratio.goal) == "at most 2"
    assert (str(time.goal), time.unit) == ("at most 1", "ms")
    assert len(ratio.values) == len(time.values) == bench.extent.repeats
    assert 0.1 < ratio.median < 100.0
    assert (str(law.goal), law.unit) == ("at most 5", "ms")
    assert str(gain.goal) == "at least 40"
    assert gain.median > 10.0


def test_the_general_fit_of_a_contact_law_has_the_same_minimum():
    rig = VirtualRig(PAPER_SETUP, VirtualRigSettings(plant=Plant.CONTACT))
    session = Session(PAPER_SETUP)
    for block in rig.strike(HitLabel("steel medium")).split(5000, 0):
        session.feed(block)
    mean = session.compute_mean("steel medium")
    assert mean is not None
    window = model.cut_law_window(mean)
    ours = fit_law(window).parameters
    assert model.fit_by_integration(window) == pytest.approx(ours, abs=1e-3)
