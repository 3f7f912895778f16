"""Many hits: memory and work stay what they are, and the numbers what they would be."""

import gc
import sys
import tracemalloc
import weakref

import numpy as np
import pytest

from impact_rig.core.session import Session
from impact_rig.core.uncertainty.results import REMEMBERED_INPUTS, make_ensemble, make_input

from .sessions import SETUP, Strike, strike_series


def test_traces_are_kept_of_so_many_hits_and_no_more(
    strike: Strike, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("impact_rig.core.session.KEPT_TRACES", 30)
    session, traces = Session(SETUP), []
    for record in range(1, 52):
        sample = SETUP.samples.names[record % 3]
        (hit,) = strike(session, sample, record)
        assert hit.filtered is not None
        # Views of the same array would keep it alive, too.
        traces.append(weakref.ref(hit.filtered.traces))
        del hit
        means = [mean for name in session.names if (mean := session.find_mean(name))]
        assert sum(mean.count for mean in means) == record
        assert sum(len(mean.hits) for mean in means) == min(record, 30)
    gc.collect()
    assert not [1 for trace in traces[:-1] if trace() is not None]
    # The three samples share what there is.
    assert [len(mean.hits) for mean in means] == [10, 10, 10]


def test_memory_does_not_grow_with_the_hits(
    strike: Strike, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("impact_rig.core.session.KEPT_TRACES", 10)
    session = Session(SETUP)
    strike_series(strike, session, [900.0] * 20)
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        strike_series(strike, session, [900.0, 150.0] * 40, first=21)
        gc.collect()
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # Filtered traces of one hit take 40 kB. The 10 that are kept may be others than before,
    # which were not counted.
    assert after - before < 10 * 20_000 + 80 * 1000


def test_every_hit_counts_although_few_show_the_scatter(
    strike: Strike, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("impact_rig.core.session.LEAST_TRACES", 5)
    whole, sparing = Session(SETUP), Session(SETUP)
    heights = [900.0 + 5.0 * (record % 9) for record in range(60)]
    strike_series(strike, whole, heights)
    monkeypatch.setattr("impact_rig.core.session.KEPT_TRACES", 20)
    strike_series(strike, sparing, heights)
    expected, found = (session.estimate_sample("alike") for session in (whole, sparing))
    assert found.impacts_accepted == expected.impacts_accepted == 60
    assert found.contact is not None
    assert expected.contact is not None
    assert found.contact_time_spread == pytest.approx(expected.contact_time_spread, rel=1e-9)
    assert found.contact.contact_time == pytest.approx(expected.contact.contact_time, rel=1e-9)
    # Of 20 hits the scatter is known to a sixth; as that of a mean of 20 it would be 1.7
    # times as large.
    for uncertainties in (
        [item.contact.contact_time_uncertainty.standard for item in (found, expected)],
        [item.body.damping_ratio_uncertainty.standard for item in (found, expected)],
    ):
        assert 0.8 < uncertainties[0] / uncertainties[1] < 1.25


def test_results_do_not_depend_on_how_long_ago_the_hammer_was_estimated(strike: Strike) -> None:
    asked, quiet = Session(SETUP), Session(SETUP)
    for session in (asked, quiet):
        strike_series(strike, session, [900.0, 890.0, 910.0])
        if session is asked:
            session.estimate_hammer()
        strike_series(strike, session, [900.0, 905.0], "heavy", first=4)
    # What so many hits bring: more uncertain inputs than are told apart by name and value.
    for number in range(REMEMBERED_INPUTS):
        make_input("another", float(number), 1.0)
        make_ensemble("another", (0.0,), np.array([[1.0 + number]]), 5.0)
    assert repr(asked.estimate_all()) == repr(quiet.estimate_all())


def test_what_is_settled_depends_on_the_hits_alone(
    strike: Strike, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("impact_rig.core.session.KEPT_TRACES", 12)
    monkeypatch.setattr("impact_rig.core.session.LEAST_TRACES", 4)
    live, file = Session(SETUP), Session(SETUP)
    for record in range(1, 31):
        name = SETUP.samples.names[record % 7 % 3]
        for session in (live, file):
            strike(session, name, record, height=450.0 if record == 9 else 900.0)
        live.estimate_sample(name)
    assert repr(live.estimate_all()) == repr(file.estimate_all())


def test_samples_measured_before_give_way_to_the_next(
    strike: Strike, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("impact_rig.core.session.KEPT_TRACES", 20)
    monkeypatch.setattr("impact_rig.core.session.LEAST_TRACES", 8)
    session = Session(SETUP)
    kept, hits = [], []
    for number, name in enumerate(("alike", "heavy", "third")):
        strike_series(strike, session, [900.0] * 20, name, first=1 + 20 * number)
        session.estimate_sample(name)
        hits += [weakref.ref(hit) for hit in session.find_mean(name).hits]
        means = [session.find_mean(name) for name in ("alike", "heavy", "third")]
        kept.append([len(mean.hits) for mean in means if mean])
    # Never fewer than the least, even if that is more together.
    assert kept == [[20], [10, 10], [8, 8, 8]]
    # Nothing holds on to those that gave way.
    del means
    gc.collect()
    assert len([hit for hit in hits if hit() is not None]) == 24


def test_the_work_for_a_hit_does_not_grow(strike: Strike, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("impact_rig.core.session.KEPT_TRACES", 10)
    session, calls = Session(SETUP), 0

    def count(_frame: object, event: str, _argument: object) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    work = []
    for record in range(1, 71):
        calls = 0
        sys.setprofile(count)
        try:
            strike(session, "alike", record)
            session.estimate_sample("alike")
        finally:
            sys.setprofile(None)
        work.append(calls)
    # Fits take a step more or less.
    assert np.median(work[-15:]) < 1.1 * np.median(work[15:30])
