"""Many hits: only what is needed of them stays, and the numbers are what they would be."""

import gc
import weakref

import numpy as np

from impact_rig.core.session import Session
from impact_rig.core.uncertainty import REMEMBERED_INPUTS, make_ensemble, make_input

from .blocks import SETUP, strike, strike_series


def test_traces_stay_in_single_precision_only():
    session, traces = Session(SETUP), []
    for record in range(1, 10):
        (hit,) = strike(session, SETUP.samples.names[record % 3], record)
        assert hit.filtered is not None
        # Views of the same array would keep it alive, too.
        traces.append(weakref.ref(hit.filtered.traces))
        del hit
    gc.collect()
    assert not [1 for trace in traces[:-1] if trace() is not None]


def test_every_hit_counts_although_every_other_shows_the_scatter():
    # Of 128 hits all show the scatter, of 130 every other.
    heights = [900.0 + 5.0 * (record % 9) for record in range(130)]
    session = Session(SETUP)
    strike_series(session, heights[:128])
    expected = session.estimate_sample("alike")
    strike_series(session, heights[128:], first=129)
    found = session.estimate_sample("alike")
    said = "scatter of the traces: that of 65 of 130 hits, evenly over the series"
    assert said in found.notes
    assert not any("evenly" in note for note in expected.notes)
    assert (expected.impacts_accepted, found.impacts_accepted) == (128, 130)
    # Of 65 hits the scatter is known to a tenth; as that of a mean of 65 it would be larger by
    # half.
    for uncertainties in (
        [item.contact_time.standard for item in (found, expected)],
        [item.damping_ratio.standard for item in (found, expected)],
    ):
        assert 0.8 < uncertainties[0] / uncertainties[1] < 1.2


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
