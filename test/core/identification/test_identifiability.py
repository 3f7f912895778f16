"""What the data leave open is named; what they determine is not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.identification.identifiability import (
    check_independence,
    describe_misfit,
    explain_covariance,
    find_undetermined,
)

NAMES = ("tau_p", "k2", "c2")
SCALES = np.array([2e-4, 45e6, 1200.0])


def make_covariance(relative: np.ndarray) -> np.ndarray:
    return relative * np.outer(SCALES, SCALES)


def test_small_uncertainties_need_no_words() -> None:
    assert find_undetermined(NAMES, make_covariance(np.diag([0.01, 0.1, 0.2]) ** 2), SCALES) == ()


def test_a_single_parameter_is_named_with_its_figure() -> None:
    covariance = make_covariance(np.diag([0.01, 0.1, 1.8]) ** 2)
    assert find_undetermined(NAMES, covariance, SCALES) == (
        "c2: not determined by these traces (c2 ±1.8e+02 %)",
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_combination_is_named_as_one(sign: float) -> None:
    # k2 and c2 rise together freely, while their difference is known.
    free, known = np.array([0.0, 1.0, sign]), np.array([0.0, 1.0, -sign])
    relative = 4.0 * np.outer(free, free) + 1e-4 * np.outer(known, known)
    relative[0, 0] = 1e-4
    assert find_undetermined(NAMES, make_covariance(relative), SCALES) == (
        "k2 and c2: determined only in combination (k2 ±2e+02 %, c2 ±2e+02 %)",
    )


@given(unit=st.floats(1e-6, 1e6))
def test_units_do_not_matter(unit: float) -> None:
    covariance = make_covariance(np.diag([0.01, 2.0, 0.2]) ** 2)
    factors = np.array([1.0, unit, 1.0])
    expected = find_undetermined(NAMES, covariance, SCALES)
    found = find_undetermined(NAMES, covariance * np.outer(factors, factors), SCALES * factors)
    assert found == expected
    assert len(found) == 1


def make_derivatives(seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((50, 3)) * [1e3, 1e-6, 1.0]


def test_independent_derivatives_pass_whatever_their_units() -> None:
    check_independence(NAMES, make_derivatives())


def test_derivatives_that_depend_on_each_other_are_named() -> None:
    derivatives = make_derivatives()
    derivatives[:, 2] = 3e9 * derivatives[:, 1]
    with pytest.raises(NotDeterminedError, match="k2 and c2: not determined"):
        check_independence(NAMES, derivatives)


def test_a_parameter_without_effect_is_named() -> None:
    derivatives = make_derivatives()
    derivatives[:, 1] = 0.0
    with pytest.raises(NotDeterminedError, match="k2: not determined, since the traces do not"):
        check_independence(NAMES, derivatives)


def test_derivatives_that_are_no_numbers_are_refused() -> None:
    derivatives = make_derivatives()
    derivatives[3, 0] = np.inf
    with pytest.raises(NotDeterminedError, match="no finite numbers"):
        check_independence(NAMES, derivatives)


def test_a_misfit_is_said_of_the_trace_it_is_in() -> None:
    assert describe_misfit("the driven model", np.array([0.01, 0.02])) == ()
    (sentence,) = describe_misfit("the driven model", np.array([0.01, 0.134]))
    assert sentence == (
        "everything: the driven model does not describe the sample's trace, of whose peak it"
        " leaves 13 %"
    )


def test_noise_alone_enlarges_nothing_worth_a_word() -> None:
    left = np.array([0.001, 0.002])
    assert explain_covariance("the driven model", left, np.array([1.0, 1.2])) == ()
    (sentence,) = explain_covariance("the driven model", left, np.array([5.0, 1.2]))
    assert sentence.startswith("the driven model leaves 0.1 % of the hammer's peak, 5 times its")
