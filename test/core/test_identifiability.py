"""What the data leave open is named; what they determine is not."""

import numpy as np
import pytest

from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.identification import check_independence, find_undetermined

NAMES = ("tau_p", "k2", "c2")
SCALES = np.array([2e-4, 45e6, 1200.0])


def make_covariance(relative: np.ndarray) -> np.ndarray:
    return relative * np.outer(SCALES, SCALES)


def test_a_single_parameter_is_named_with_its_figure():
    covariance = make_covariance(np.diag([0.01, 0.1, 1.8]) ** 2)
    assert find_undetermined(NAMES, covariance, SCALES) == (
        "c2: not determined by these traces (c2 ±1.8e+02 %)",
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_combination_is_named_as_one(sign):
    # k2 and c2 rise together freely, while their difference is known.
    free, known = np.array([0.0, 1.0, sign]), np.array([0.0, 1.0, -sign])
    relative = 4.0 * np.outer(free, free) + 1e-4 * np.outer(known, known)
    relative[0, 0] = 1e-4
    assert find_undetermined(NAMES, make_covariance(relative), SCALES) == (
        "k2 and c2: determined only in combination (k2 ±2e+02 %, c2 ±2e+02 %)",
    )


def make_derivatives(seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((50, 3)) * [1e3, 1e-6, 1.0]


def test_derivatives_that_depend_on_each_other_are_named():
    derivatives = make_derivatives()
    derivatives[:, 2] = 3e9 * derivatives[:, 1]
    with pytest.raises(NotDeterminedError, match="k2 and c2: not determined"):
        check_independence(NAMES, derivatives)


def test_a_parameter_without_effect_is_named():
    derivatives = make_derivatives()
    derivatives[:, 1] = 0.0
    with pytest.raises(NotDeterminedError, match="k2: not determined, since the traces do not"):
        check_independence(NAMES, derivatives)


def test_derivatives_that_are_no_numbers_are_refused():
    derivatives = make_derivatives()
    derivatives[3, 0] = np.inf
    with pytest.raises(NotDeterminedError, match="no finite numbers"):
        check_independence(NAMES, derivatives)
