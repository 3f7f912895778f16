"""Uncertain numbers against the GUM's own examples, and what they must never do."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from impact_rig.core.equations import UncertainNumber
from impact_rig.core.errors import ParameterError
from impact_rig.core.quantity import Quantity
from impact_rig.core.uncertainty import compute_quantity, make_ensemble, make_input

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


def test_the_same_statement_is_the_same_input_and_another_owners_is_not():
    again = make_input("mass", 0.1, 1e-3) - make_input("mass", 0.1, 1e-3)
    assert again.u == 0.0
    other = make_input("mass", 0.1, 1e-3) - make_input("mass", 0.1, 1e-3, "another")
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


@pytest.mark.parametrize("bad", [math.nan, math.inf, -1.0])
def test_what_is_no_uncertainty_is_refused(bad):
    with pytest.raises(ParameterError, match="standard uncertainty of mass"):
        make_input("mass", 0.1, bad)


@pytest.mark.parametrize("bad", [np.full((2, 2), np.nan), np.eye(3), np.ones(2)])
def test_what_is_no_covariance_is_refused(bad):
    with pytest.raises(ParameterError, match=r"covariance of fit is .* finite 2 x 2 matrix"):
        make_ensemble("fit", [1.0, 2.0], bad, 5)


def test_what_is_not_determined_says_why():
    huge = make_input("huge", 1e200, 1e200) * 1e200
    found = report(huge)
    assert math.isnan(found.standard)
    assert "not determined" in found.notes[0]
