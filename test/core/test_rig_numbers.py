"""From fitted parameters to results: against closed forms and against Monte Carlo."""

import math

import numpy as np
import pytest

from impact_rig.core.quantity import Quantity
from impact_rig.core.setup import PAPER_SETUP
from impact_rig.core.uncertainty import (
    Formula,
    find_decaying_body,
    find_identified_body,
    make_rig_numbers,
    propagate_fit,
)

RIG = make_rig_numbers(PAPER_SETUP, "steel medium")
DECAY, FREQUENCY = 3456.0, 15900.0


def propagate(
    hits: np.ndarray, formula: Formula = find_decaying_body, rig=RIG
) -> dict[str, Quantity]:
    estimates = hits.mean(axis=0).tolist()
    return propagate_fit(
        "hits", hits, formula, rig, estimates=estimates, averaged=len(hits), owner=""
    )


def list_results(found: dict[str, Quantity]) -> list[Quantity]:
    return [found[name] for name in ("damping_ratio", "damping_coefficient", "stiffness")]


def draw_hits(count: int) -> np.ndarray:
    errors = np.random.default_rng(5).standard_normal((count, 2)) @ [[40.0, 60.0], [0.0, 80.0]]
    return np.array([DECAY, FREQUENCY]) + errors


def test_a_free_decay_gives_what_monte_carlo_gives():
    hits = draw_hits(200)
    found = list_results(propagate(hits))
    generator = np.random.default_rng(6)
    trials = 400_000
    mean = generator.multivariate_normal(
        hits.mean(axis=0), np.cov(hits, rowvar=False) / 200, trials
    )
    clock = 1.0 + PAPER_SETUP.clock_uncertainty * generator.standard_normal(trials)
    mass = (
        0.16691
        + 0.0029e-3 * generator.standard_normal(trials)
        + 3e-3
        + 0.29e-3 * generator.standard_normal(trials)
    )
    a, w = mean.T / clock
    drawn = (a / np.hypot(a, w), 2 * mass * a, mass * (a**2 + w**2))
    for uncertainty, values in zip(found, drawn, strict=True):
        # 400 000 trials know a standard deviation to 0.11 %; four of those.
        assert uncertainty.standard == pytest.approx(values.std(), rel=5e-3)
        # 199 degrees of freedom: k = 1.972.
        half = np.diff(np.quantile(values, [0.025, 0.975]))[0] / 2
        assert uncertainty.expanded == pytest.approx(half, rel=2e-2)


def test_identified_parameters_go_with_mass_and_clock():
    hits = np.array([203.2e-6, 45.29e6, 1170.0]) * (
        1.0 + np.random.default_rng(8).standard_normal((10, 3)) * [1e-3, 3e-3, 5e-3]
    )
    found = propagate(hits, find_identified_body)
    tau, k, c = hits.mean(axis=0)
    mass = math.hypot(0.29e-3, 0.0029e-3) / 0.16991
    scatter = np.std(hits, axis=0, ddof=1) / math.sqrt(10)
    assert found["contact_time"].standard == pytest.approx(math.hypot(scatter[0], 5.8e-5 * tau))
    assert found["stiffness"].standard == pytest.approx(
        math.hypot(scatter[1], mass * k, 2 * 5.8e-5 * k)
    )
    assert found["damping_coefficient"].standard == pytest.approx(
        math.hypot(scatter[2], mass * c, 5.8e-5 * c)
    )
    # zeta = c / (2 sqrt(k m)): neither mass nor clock is left.
    assert [line.source for line in found["damping_ratio"].budget] == ["hits"]
    ratios = hits[:, 2] / (2.0 * np.sqrt(hits[:, 1] * 0.16991))
    assert found["damping_ratio"].standard == pytest.approx(
        np.std(ratios, ddof=1) / math.sqrt(10), rel=0.01
    )


def test_hits_that_agree_to_the_last_bit_have_no_scatter():
    twins = np.full((2, 2), [[DECAY, FREQUENCY]])
    found = list_results(propagate(twins))
    assert found[0].standard < 1e-15  # zeta: clock and masses cancel but for rounding
    assert all(line.source != "hits" for item in found for line in item.budget)
