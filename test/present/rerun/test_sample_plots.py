"""A sample's hits over each other, their mean, models, marks, and its contact law."""

from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.estimates.contact_law import NO_LAW
from impact_rig.core.given.findings import Note, Subject
from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.results.traces import (
    DRIVEN,
    PRINTED,
    AlignedHit,
    ModelTraces,
    SampleTraces,
    compute_law_curves,
)

RATE = 2.5e6
COUNT = 4001
START = -0.3e-3
TAU = 160e-6
TIME = START + np.arange(COUNT) / RATE
PARENT = r"/samples/steel\ small"


def make_pulse(peak):
    inside = np.abs(TIME) < TAU / 2
    return np.where(inside, peak * np.cos(np.pi * TIME / TAU) ** 2, 0.0)


def make_traces(name="steel small", models=(DRIVEN, PRINTED), **changes):
    mean = np.stack([make_pulse(-800.0), make_pulse(1600.0)])
    return SampleTraces(
        **{
            "name": name,
            "sampling_rate": RATE,
            "start_time": START,
            "mean": mean,
            "contact_time": TAU,
            "half_amplitude_width": TAU / 2,
            "first_peak_time": 0.0,
            "second_peak_time": 40e-6,
            "models": tuple(
                ModelTraces(model, (0.9 - 0.1 * i) * mean, (0.0001, 1.234))
                for i, model in enumerate(models)
            ),
            **changes,
        }
    )


def show_sample(traces):
    return lambda log: log.log_sample(traces, NO_LAW, PAPER_SETUP)


def make_aligned(record, start=START):
    label = HitLabel("steel small", record=record)
    return AlignedHit(label, RATE, start, np.stack([make_pulse(-800.0), make_pulse(1600.0)]))


def test_hits_are_laid_over_each_other_as_they_come(record):
    view = record(
        lambda log: log.log_aligned_hits([make_aligned(1)]),
        lambda log: log.log_aligned_hits([make_aligned(2, START - 2 / RATE)]),
    )

    first, values = view.find_traces(f"{PARENT}/hammer/hits/1")
    second, _ = view.find_traces(f"{PARENT}/hammer/hits/2")
    np.testing.assert_allclose(first, TIME, atol=1e-9)
    np.testing.assert_allclose(second, TIME - 2 / RATE, atol=1e-9)
    assert values.min() == -800.0
    assert view.find_hidden() == set()


def test_a_mean_is_drawn_with_the_driven_model_and_what_it_leaves(record):
    traces = make_traces(models=(PRINTED, DRIVEN))

    view = record(show_sample(traces))

    entity = f"{PARENT}/sample/models/1"
    assert view.find_static(entity, "SeriesLines:names") == [
        "sample, mean",
        "sample, model (MSE 1.2 %)",
        "sample, residual of the model",
    ]
    _, values = view.find_traces(entity)
    np.testing.assert_allclose(values.max(axis=0), [1600.0, 1280.0, 320.0], rtol=1e-6)
    np.testing.assert_allclose(values[:, 2], values[:, 0] - values[:, 1], atol=1e-3)


def test_the_contact_window_and_what_was_read_from_the_mean_are_marked(record):
    view = record(show_sample(make_traces()))

    moments, values = view.find_traces(f"{PARENT}/hammer/contact/1")
    np.testing.assert_allclose(moments, [-TAU / 2, -TAU / 2, TAU / 2, TAU / 2], atol=2e-9)
    # On the side of the pulse, which is negative here, and around it.
    np.testing.assert_allclose(values[:, 0], [0.0, -880.0, -880.0, 0.0])
    assert view.find_static(f"{PARENT}/hammer/contact/1", "SeriesLines:names") == [
        "contact, 160.00 µs"
    ]
    moments, values = view.find_traces(f"{PARENT}/hammer/points/1")
    np.testing.assert_allclose(moments, [-TAU / 4, TAU / 4])
    np.testing.assert_array_equal(values[:, 0], [-400.0, -400.0])
    entity = f"{PARENT}/sample/points/1"
    moments, values = view.find_traces(entity)
    np.testing.assert_allclose(moments, [0.0, 40e-6])
    np.testing.assert_allclose(values, [[1600.0, np.nan], [np.nan, 800.0]], rtol=1e-6)
    names = view.find_static(entity, "SeriesPoints:names")
    assert names == ["U1, 1600.0 m/s²", "U2, 800.0 m/s²"]


def test_a_new_mean_takes_the_place_of_the_last_one_of_the_same_sample_only(record):
    view = record(
        lambda log: log.log_aligned_hits([make_aligned(1)]),
        show_sample(make_traces("a/b *c*")),
        show_sample(make_traces("steel small")),
        show_sample(make_traces("steel small")),
    )

    assert view.find_hidden() == {
        *(f"{PARENT}/{body}/models/1" for body in ("hammer", "sample")),
        *(f"{PARENT}/{body}/contact/1" for body in ("hammer", "sample")),
        f"{PARENT}/hammer/points/1",
        f"{PARENT}/sample/points/1",
    }
    assert r"/samples/a\/b\ \*c\*/hammer/models/1" in view.entities


def test_why_a_law_is_not_given_is_said_until_one_is(record, found):
    traces, law, setup = found
    why = replace(NO_LAW, notes=(Note(Subject.CONTACT_LAW, "too short"),))

    without = record(*[lambda log: log.log_sample(traces, why, setup)] * 2)
    then = record(*(lambda log, it=it: log.log_sample(traces, it, setup) for it in (why, law)))

    place = r"/samples/steel\ medium/law/sentence/1"
    names = without.find_static(place, "SeriesLines:names")
    assert names == ["No contact law is given: too short."]
    assert place not in without.find_hidden()
    assert place in then.find_hidden()


@pytest.fixture(scope="module")
def found(contacts):
    """Return a sample's traces, its law, the set-up."""
    return contacts.samples[1], contacts.results.samples[1].contact_law, contacts.results.setup


def test_pulse_and_residual_are_those_of_the_report(record, found):
    curves = compute_law_curves(*(found[i] for i in (1, 0, 2)))

    view = record(lambda log: log.log_sample(*found))

    time, forces = view.find_traces(r"/samples/steel\ medium/law/1")
    measured = np.interp(time, curves.time, curves.measured)
    np.testing.assert_allclose(forces[:, 0], measured, atol=1e-3)
    assert forces[:, 0].max() == pytest.approx(curves.measured.max())
    _, left = view.find_traces(r"/samples/steel\ medium/law\ residual/1")
    assert np.abs(left).max(axis=0) == pytest.approx(
        [
            np.abs(curves.measured - curves.law).max(),
            np.abs(curves.measured - curves.versed_sine).max(),
        ],
        rel=1e-3,
    )
    _, law, _ = view.find_static(r"/samples/steel\ medium/law/1", "SeriesLines:names")
    exponent = float(law.removeprefix("law, n = ").split()[0])
    assert exponent == pytest.approx(found[1].exponent.value, abs=1e-3)
