"""Many hits: memory and work stay what they are, and the numbers what they would be."""

import gc
import sys
import weakref

import numpy as np
import pytest

from impact_rig.core.session import Session
from impact_rig.core.uncertainty.results import REMEMBERED_INPUTS, make_ensemble, make_input

from .blocks import SETUP, strike, strike_series


@pytest.fixture
def few_shown(monkeypatch: pytest.MonkeyPatch) -> int:
    """Let ten hits be a long series."""
    monkeypatch.setattr("impact_rig.core.hits.series.SCATTER_HITS", 10)
    return 10


def test_traces_are_not_kept_in_memory(few_shown):
    session, traces = Session(SETUP), []
    for record in range(1, 34):
        (hit,) = strike(session, SETUP.samples.names[record % 3], record)
        assert hit.filtered is not None
        # Views of the same array would keep it alive, too.
        traces.append(weakref.ref(hit.filtered.traces))
        del hit
        means = [mean for name in session.names if (mean := session.compute_mean(name))]
        assert sum(mean.count for mean in means) == record
        assert max(len(mean.hits) for mean in means) <= few_shown
    gc.collect()
    assert not [1 for trace in traces[:-1] if trace() is not None]


def test_every_hit_counts_although_few_show_the_scatter(monkeypatch):
    whole, sparing = Session(SETUP), Session(SETUP)
    heights = [900.0 + 5.0 * (record % 9) for record in range(60)]
    for session in (whole, sparing):
        strike_series(session, heights)
    expected = whole.estimate_sample("alike")
    monkeypatch.setattr("impact_rig.core.hits.series.SCATTER_HITS", 20)
    found = sparing.estimate_sample("alike")
    assert set(found.notes) - set(expected.notes) == {
        "scatter of the traces: that of 15 of 60 hits, evenly over the series"
    }
    assert found.impacts_accepted == expected.impacts_accepted == 60
    assert found.contact_time_spread == expected.contact_time_spread
    assert found.contact_time.value == expected.contact_time.value
    # Of 15 hits the scatter is known to a fifth; as that of a mean of 15 it would be twice as
    # large.
    for uncertainties in (
        [item.contact_time.standard for item in (found, expected)],
        [item.damping_ratio.standard for item in (found, expected)],
    ):
        assert 0.8 < uncertainties[0] / uncertainties[1] < 1.25


def test_results_do_not_depend_on_how_long_ago_the_hammer_was_estimated():
    asked, quiet = Session(SETUP), Session(SETUP)
    for session in (asked, quiet):
        strike_series(session, [900.0, 890.0, 910.0])
        if session is asked:
            session.estimate_hammer()
        strike_series(session, [900.0, 905.0], "heavy", first=4)
    # What so many hits bring: more uncertain inputs than are told apart by name and value.
    for number in range(REMEMBERED_INPUTS):
        make_input("another", float(number), 1.0)
        make_ensemble("another", (0.0,), np.array([[1.0 + number]]), 5.0)
    assert repr(asked.estimate_all()) == repr(quiet.estimate_all())


def test_the_work_for_a_hit_does_not_grow(few_shown):
    session, calls = Session(SETUP), 0

    def count(_frame: object, event: str, _argument: object) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    work = []
    for record in range(1, 47):
        calls = 0
        sys.setprofile(count)
        try:
            strike(session, "alike", record)
            session.estimate_sample("alike")
        finally:
            sys.setprofile(None)
        work.append(calls)
    # Fits take a step more or less.
    assert np.median(work[-15:]) < 1.1 * np.median(work[14:29])
