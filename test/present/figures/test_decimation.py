import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from impact_rig.present.figures.decimation import compute_fading_time, cut_trace, decimate_trace

traces = hnp.arrays(
    float, st.integers(1, 400), elements=st.floats(-1e6, 1e6) | st.just(float("nan"))
)


@given(traces, st.integers(1, 40))
def test_what_is_drawn_are_points_of_the_trace_in_their_order(values, columns):
    time = np.arange(values.size) / 2.5e6
    thin_time, thin = decimate_trace(time, values, columns)
    places = np.rint(thin_time * 2.5e6).astype(int)
    assert (np.diff(places) > 0).all()
    np.testing.assert_array_equal(thin, values[places])
    assert thin.size <= 3 * columns + 2


@given(traces, st.integers(1, 40))
def test_ends_and_extremes_stay_where_they_are_and_a_gap_stays_a_gap(values, columns):
    time = np.arange(values.size, dtype=float)
    thin_time, thin = decimate_trace(time, values, columns)
    assert thin_time[0] == time[0]
    assert thin_time[-1] == time[-1]
    assert np.isnan(thin).any() == np.isnan(values).any()
    if not np.isnan(values).all():
        assert np.nanmax(thin) == np.nanmax(values)
        assert np.nanmin(thin) == np.nanmin(values)
        assert thin_time[np.nanargmax(thin)] == time[np.nanargmax(values)]


def test_every_column_keeps_its_own_peak():
    values = np.zeros(1000)
    values[[15, 455, 999]] = 5.0, -7.0, 3.0
    time, thin = decimate_trace(np.arange(1000.0), values, 50)
    assert [(t, v) for t, v in zip(time, thin, strict=True) if v] == [
        (15.0, 5.0),
        (455.0, -7.0),
        (999.0, 3.0),
    ]


def test_a_short_trace_is_drawn_as_it_is():
    time, values = np.arange(5.0), np.array([1.0, 2.0, 1.0, 0.0, 3.0])
    assert decimate_trace(time, values, 1)[1] is values


def test_only_what_lies_in_the_picture_is_drawn():
    time, values = cut_trace(np.arange(6.0), np.arange(6.0) ** 2, 1.0, 3.0)
    assert time.tolist() == [1.0, 2.0, 3.0]
    assert values.tolist() == [1.0, 4.0, 9.0]


def test_a_decay_has_faded_when_its_exponential_says_so():
    time = np.linspace(0.0, 10.0, 10_001)
    slow, fast = np.exp(-time), -5.0 * np.exp(-3.0 * time)
    assert compute_fading_time(time, np.stack([slow, fast]), 0.01) == pytest.approx(
        np.log(100.0), abs=1e-3
    )


def test_nothing_and_nan_have_faded_at_once():
    time = np.array([-1.0, 0.0, 1.0])
    assert compute_fading_time(time, np.zeros((2, 3)), 0.01) == -1.0
    assert compute_fading_time(time, np.full((1, 3), np.nan), 0.01) == -1.0
