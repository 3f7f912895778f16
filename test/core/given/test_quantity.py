"""Uncertain numbers against the GUM's own examples, closed forms and Monte Carlo."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from impact_rig.core.estimates.equations import (
    UncertainNumber,
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
    estimate_sample_stiffness,
)
from impact_rig.core.estimates.uncertainty import (
    Known,
    RigInputs,
    compute_quantity,
    derive,
    make_ensemble,
    make_input,
    make_rig_numbers,
    propagate_decay,
)
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.setup import PAPER_SETUP

VOLTAGE = [5.007, 4.994, 5.005, 4.990, 4.999]
CURRENT = [19.663e-3, 19.639e-3, 19.640e-3, 19.685e-3, 19.678e-3]
"""GUM table H.2, two of its three quantities [V, A]."""


def report(number: UncertainNumber) -> Quantity:
    return compute_quantity(float(number.x), number)


def make_repeated(source: str, value: float, standard: float, freedom: float) -> UncertainNumber:
    return make_ensemble(source, [value], np.array([[standard**2]]), freedom)[0]


def test_simultaneous_measurements_are_correlated_as_in_gum_h2():
    data = np.array([VOLTAGE, CURRENT])
    scatter = np.cov(data) / 5
    voltage, current = make_ensemble("readings", data.mean(axis=1), scatter, 4)
    # Published: u(V) = 0.0032, u(I) = 0.0095 mA; |Z| = 254.260 ohm, u = 0.236 ohm, 4 degrees of
    # freedom, as approach 2 of the same data gives them directly.
    assert voltage.u == pytest.approx(0.0032, abs=5e-5)
    assert current.u == pytest.approx(0.0095e-3, abs=5e-8)
    impedance = voltage / current
    found = report(impedance)
    assert impedance.x == pytest.approx(254.260, abs=1e-3)
    assert found.standard == pytest.approx(0.236, abs=5e-4)
    assert found.degrees_of_freedom == pytest.approx(4.0)
    assert len(found.budget) == 1
    assert found.budget[0].kind == "A"


def test_effective_degrees_of_freedom_are_those_of_gum_g4():
    # y = b x1 x2 x3 with 10, 5 and 15 observations: v = 19.0, t(95 %) = 2.09, u = 1.03 %.
    product = (
        make_repeated("x1", 1.0, 0.25e-2, 9)
        * make_repeated("x2", 1.0, 0.57e-2, 4)
        * make_repeated("x3", 1.0, 0.82e-2, 14)
    )
    found = report(product)
    assert found.standard == pytest.approx(1.03e-2, abs=5e-5)
    assert found.degrees_of_freedom == pytest.approx(19.0, abs=0.05)
    assert found.expanded / found.standard == pytest.approx(2.09, abs=5e-3)


def test_one_object_is_one_input_and_another_of_the_same_source_is_not():
    mass = make_input("mass", 0.1, 1e-3)
    assert (mass - mass).u == 0.0
    other = mass - make_input("mass", 0.1, 1e-3)
    assert other.u == pytest.approx(math.sqrt(2) * 1e-3)
    # Two inputs of one source make one line.
    (line,) = report(other).budget
    assert line.contribution == pytest.approx(math.sqrt(2) * 1e-3)
    assert (line.source, line.kind, line.share) == ("mass", "B", 1.0)


@given(st.lists(st.floats(1e-6, 1e6), min_size=1, max_size=8))
def test_shares_add_up_and_come_in_order(uncertainties):
    total = sum(
        make_input(f"input {index}", 1.0, value) for index, value in enumerate(uncertainties)
    )
    found = report(total)  # type: ignore[arg-type]
    shares = [line.share for line in found.budget]
    assert math.fsum(shares) == pytest.approx(1.0)
    assert shares == sorted(shares, reverse=True)
    assert found.standard == pytest.approx(math.sqrt(sum(u * u for u in uncertainties)))


@given(st.lists(st.floats(-5, 5), min_size=6, max_size=6), st.floats(1e-9, 1e9))
def test_an_ensemble_has_the_covariance_that_it_was_given(numbers, unit):
    # A mixing matrix of any rank, and units that differ by up to 10^9.
    mixing = np.reshape(numbers, (3, 2)) * np.array([[unit], [1.0], [1.0]])
    covariance = mixing @ mixing.T
    ensemble = make_ensemble("fit", [1.0, 2.0, 3.0], covariance, 7)
    weights = np.array([1.0 / unit, -2.0, 0.5])
    combined = sum(float(w) * number for w, number in zip(weights, ensemble, strict=True))
    expected = float(np.sum((weights @ mixing) ** 2))
    size = float(np.sum((np.abs(weights) @ np.abs(mixing)) ** 2))
    # Eigenvalues of rounding size, 10^-14 of the largest, are left out.
    assert_allclose(combined.u**2, expected, rtol=1e-6, atol=1e-12 * size)  # type: ignore[union-attr]


def test_what_is_not_determined_says_why():
    huge = make_input("huge", 1e200, 1e200) * 1e200
    found = report(huge)
    assert math.isnan(found.standard)
    assert "not determined" in str(found.notes[0])


def test_what_two_samples_share_is_one_input():
    inputs = RigInputs(PAPER_SETUP)
    one, other = inputs.find("steel medium"), inputs.find("aluminium small")
    # The accelerometer's mass cancels, those of both samples stay.
    assert (one.moving_mass - other.moving_mass).u == pytest.approx(math.sqrt(2) * 0.0029e-3)
    assert (one.hammer_mass - other.hammer_mass).u == 0.0
    assert (one.moving_mass - inputs.find("steel medium").moving_mass).u == 0.0
    apart = make_rig_numbers(PAPER_SETUP, "steel medium")
    assert (one.hammer_mass - apart.hammer_mass).u == pytest.approx(math.sqrt(2) * 0.29e-3)


RIG = make_rig_numbers(PAPER_SETUP, "steel medium")
DECAY, FREQUENCY = 3456.0, 15900.0


def propagate(hits: np.ndarray) -> dict[str, Quantity]:
    estimates = hits.mean(axis=0).tolist()
    return propagate_decay("hits", hits, RIG, estimates=estimates, averaged=len(hits))


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


def stiffen(spread: float, hammer: Known, tau: float = 200e-6) -> Known:
    """Return k2 of a contact time within `spread` [-] and exact masses of 100 g."""
    mass = derive(estimate_equivalent_mass, *[Known(make_input("mass", 0.1, 0.0))] * 2)
    time = Known(make_input("tau", tau, spread * tau))
    return derive(
        estimate_sample_stiffness, derive(estimate_equivalent_stiffness, mass, time), hammer
    )


def test_what_goes_as_a_power_has_the_ends_that_its_input_gives():
    time = Known(make_input("tau", 200e-6, 29e-6))
    mass = Known(make_input("mass", 0.05, 0.0))
    found = derive(estimate_equivalent_stiffness, mass, time).state()
    ends = [0.05 * (math.pi / (200e-6 + step * 1.959964 * 29e-6)) ** 2 for step in (1, -1)]
    assert [found.lower, found.upper] == pytest.approx(ends, rel=1e-6)
    assert not found.is_even
    # Within 10 % both sides are alike.
    narrow = replace(time, number=make_input("tau", 200e-6, 2e-6))
    found = derive(estimate_equivalent_stiffness, mass, narrow).state()
    assert found.is_even
    assert (found.lower, found.upper) == (
        found.value - found.expanded, found.value + found.expanded,
    )  # fmt: skip


def test_the_ends_of_several_inputs_are_those_of_a_monte_carlo():
    k1, trials = 40e6, 400_000
    found = stiffen(0.06, Known(make_input("k1", k1, 0.05 * k1))).state()
    generator = np.random.default_rng(9)
    taus = 200e-6 * (1.0 + 0.06 * generator.standard_normal(trials))
    hammers = k1 * (1.0 + 0.05 * generator.standard_normal(trials))
    values = 1.0 / (1.0 / (0.05 * (math.pi / taus) ** 2) - 1.0 / hammers)
    low, high = np.quantile(values, [0.025, 0.975])
    width = high - low
    assert found.lower == pytest.approx(low, abs=0.02 * width)
    assert found.upper == pytest.approx(high, abs=0.02 * width)
    # An even one is off by more.
    assert abs(found.value - found.expanded - low) > 0.05 * width


def test_where_the_formula_has_no_value_the_interval_is_open():
    # k_eq = 12.3 MN/m ± 24 % may reach k1: then no k2 solves (6b).
    found = stiffen(0.06, Known(make_input("k1", 15e6, 0.0))).state()
    assert found.lower < found.value
    assert math.isnan(found.upper)
    assert found.compute_half_width(1e9) == math.inf
    assert found.compute_half_width(0.0) == found.value - found.lower


def test_hits_that_agree_to_the_last_bit_have_no_scatter():
    twins = np.full((2, 2), [[DECAY, FREQUENCY]])
    found = list_results(propagate(twins))
    assert found[0].standard < 1e-15  # zeta: clock and masses cancel but for rounding
    assert all(line.source != "hits" for item in found for line in item.budget)
