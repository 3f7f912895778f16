"""The newest points are found by their places, with every gap."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.devices.streaming import SampleStore, find_crossing


def make_counts(place: int, count: int) -> np.ndarray:
    """Return points of which each is its own place."""
    return np.repeat(np.arange(place, place + count, dtype=np.int32)[:, np.newaxis], 2, axis=1)


@given(
    st.lists(st.tuples(st.integers(0, 3), st.integers(0, 20)), max_size=30),
    st.integers(0, 300),
    st.integers(0, 100),
)
def test_what_is_found_is_what_came_at_its_place(steps, start, length):
    store, there = SampleStore(10_000), []
    for gap, count in steps:
        store.skip(gap)
        there += range(store.end, store.end + count)
        store.append(make_counts(store.end, count))
    runs = store.read_runs(start, start + length)
    places = [int(value) for run in runs for value in run.counts[:, 1]]
    assert places == [place for place in there if start <= place < start + length]
    assert all(run.counts[0, 0] == run.place for run in runs)
    assert all(before.end < after.place for before, after in pairwise(runs))


def test_no_more_is_kept_than_wanted():
    store = SampleStore(100)
    for _ in range(50):
        store.append(make_counts(store.end, 30))
    assert store.end == 1500
    assert 1370 <= store.start <= 1400
    (run,) = store.read_runs(0, 1500)
    assert (run.place, run.end) == (store.start, 1500)


@pytest.mark.parametrize(
    ("counts", "place"),
    [
        ([0, 0, 5, 9, 0], 2),
        ([0, -5, 0], 1),
        ([9, 9, 9, 0, 9], 4),
        ([9, 0, 4, -4], 4),
        ([9], 1),
        ([], 0),
        ([0, -(2**31)], 1),
    ],
)
def test_a_level_is_crossed_from_below_in_size(counts, place):
    assert find_crossing(np.array(counts, np.int32), 5.0) == place
