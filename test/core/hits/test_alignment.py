"""Traces shifted by a part of a point."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.hits.hit import align_traces

POINTS = np.arange(1000)


def make_traces(middle: float) -> np.ndarray:
    return np.stack(
        [
            np.exp(-(((POINTS - middle) / 50.0) ** 2)),
            np.sin((POINTS - middle) / 30.0),
        ]
    )


@given(middle=st.floats(300, 700))
def test_the_middle_falls_onto_a_point(middle: float) -> None:
    traces, origin = align_traces(make_traces(middle), middle)
    assert origin == int(middle)
    expected = make_traces(float(origin))[:, : traces.shape[1]]
    # Cubic splines follow waves of 190 points within 1e-6, ends apart.
    np.testing.assert_allclose(traces[:, 20:-20], expected[:, 20:-20], rtol=0, atol=1e-6)


@pytest.mark.parametrize(("middle", "count"), [(400.0, 1000), (400.25, 999)])
def test_a_shift_costs_one_point(middle: float, count: int) -> None:
    traces, origin = align_traces(make_traces(middle), middle)
    assert (traces.shape, origin) == ((2, count), 400)


def test_without_a_shift_nothing_changes() -> None:
    traces = make_traces(400.3)
    aligned, _ = align_traces(traces, 400.0)
    np.testing.assert_array_equal(aligned, traces)
