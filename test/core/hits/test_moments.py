"""Values that are not kept: their scatter is what it would be if they were."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.hits.moments import Moments

TIMES = st.lists(st.floats(150e-6, 250e-6), max_size=30)


def gather(values: list[float]) -> Moments:
    moments = Moments()
    for value in values:
        moments = moments.add(value)
    return moments


@given(gone=TIMES, kept=TIMES)
def test_those_gone_and_those_kept_scatter_as_all_together(
    gone: list[float], kept: list[float]
) -> None:
    found = gather(gone).find_deviation(np.array(kept))
    if len(gone) + len(kept) > 1:
        # Deviations are differences of numbers of 1e-4: each is known to 1e-20.
        assert found == pytest.approx(np.std(gone + kept, ddof=1), rel=1e-9, abs=1e-18)
    else:
        assert np.isnan(found)


def test_where_none_is_gone_not_a_bit_differs_from_numpy() -> None:
    kept = 2e-4 * (1.0 + 0.003 * np.random.default_rng(1).standard_normal(120))
    assert Moments().find_deviation(kept) == np.std(kept, ddof=1)


def test_many_values_far_from_zero_lose_no_digits() -> None:
    values = 1e6 + np.random.default_rng(2).standard_normal(10_000)
    assert gather(values.tolist()).find_deviation(np.zeros(0)) == pytest.approx(
        np.std(values, ddof=1), rel=1e-9
    )
