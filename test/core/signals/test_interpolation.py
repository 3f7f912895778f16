"""Values between the points of a trace."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline, make_interp_spline

from impact_rig.core.errors import ParameterError
from impact_rig.core.signals.interpolation import interpolate_between

POINTS = np.arange(400.0)


@given(fraction=st.floats(0.0, 1.0), seed=st.integers(0, 1000))
def test_are_those_of_another_cubic_spline_away_from_the_ends(fraction: float, seed: int) -> None:
    traces = np.random.default_rng(seed).standard_normal((2, POINTS.size))
    spline: BSpline = make_interp_spline(POINTS, traces, k=3, axis=1)
    # What is assumed of the ends dies out by 0.27 a point.
    np.testing.assert_allclose(
        interpolate_between(traces, fraction)[:, 25:-25],
        spline(POINTS[:-1] + fraction)[:, 25:-25],
        rtol=0,
        atol=1e-12,
    )


@given(fraction=st.floats(0.0, 1.0), value=st.floats(-1e6, 1e6))
def test_of_a_steady_trace_are_its_value_up_to_the_ends(fraction: float, value: float) -> None:
    found = interpolate_between(np.full(30, value), fraction)
    np.testing.assert_allclose(found, np.full(29, value), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("fraction", "part"), [(0.0, slice(None, -1)), (1.0, slice(1, None))])
def test_at_the_points_are_the_points(fraction: float, part: slice) -> None:
    trace = np.random.default_rng(1).standard_normal(100)
    np.testing.assert_allclose(interpolate_between(trace, fraction), trace[part], atol=1e-14)


@pytest.mark.parametrize("fraction", [-0.1, 1.1, np.nan])
def test_further_away_are_refused(fraction: float) -> None:
    with pytest.raises(ParameterError, match="part of a point is"):
        interpolate_between(np.zeros(10), fraction)
