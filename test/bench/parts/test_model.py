"""The part `model`: the peer is an independent solution, and everything asked for is measured."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from impact_rig.bench.integration import integrate_impact
from impact_rig.bench.part import Bench
from impact_rig.bench.parts import model
from impact_rig.core.model.impact import Body, ImpactModel, ModelVariant


def test_the_integrator_solves_a_free_oscillator() -> None:
    # Without a force, and long after a very short contact, the hammer is left alone.
    hammer = Body(0.1, 2e7, 300.0)
    impact = ImpactModel(hammer, Body(0.2, 4e7, 500.0), 1e-9, 0.1, 0.0)
    times = np.arange(1, 200) / 2.5e6
    found = integrate_impact(impact, times, ModelVariant.PRINTED)[0]
    matrix = np.array([[0.0, 1.0], [-2e7 / 0.1, -300.0 / 0.1]])
    expected = [(matrix @ expm(matrix * t) @ [0.0, 0.1])[1] for t in times]
    assert found == pytest.approx(np.array(expected), rel=1e-4)


@pytest.mark.parametrize("variant", ModelVariant)
def test_closed_form_and_integrator_agree(variant: ModelVariant) -> None:
    for impact in model.make_models(3, seed=1):
        # Between its steps the integrator interpolates worse than it steps.
        assert 0.0 < model.find_difference(impact, variant) < 1e-7


def test_no_two_models_of_a_batch_are_alike() -> None:
    assert len(set(model.make_models(100, seed=1))) == 100


def test_both_variants_are_measured_against_every_peer(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(model, "BATCH", 5)
    monkeypatch.setattr(model, "CALLS", 2)
    figures = model.measure(bench)
    assert [figure.name.split(",")[0] for figure in figures] == ["driven"] * 6 + ["printed"] * 6
    asked = [str(figure.goal or "") for figure in figures[:6]]
    assert asked == ["at least 150", "", "at most 1e-09", "at most 3", "", "at least 2"]
    assert all(math.isfinite(value) for figure in figures for value in figure.values)
