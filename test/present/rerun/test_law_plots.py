"""The contact law of a sample as it is logged: pulse and what is left of it."""

import numpy as np
import pytest

from impact_rig.core.contact_law import NO_LAW
from impact_rig.results.law_curves import compute_law_curves


@pytest.fixture(scope="module")
def found(contacts):
    """Return a sample's traces, its law, the set-up."""
    return contacts.samples[1], contacts.results.samples[1].contact_law, contacts.results.setup


def test_pulse_and_residual_are_those_of_the_report(record, found):
    curves = compute_law_curves(*(found[i] for i in (1, 0, 2)))

    view = record(lambda log: log.log_law(*found))

    time, forces = view.find_traces(view.quote("samples", "steel medium", "law", "1"))
    measured = np.interp(time, curves.time, curves.measured)
    np.testing.assert_allclose(forces[:, 0], measured, atol=1e-3)
    assert forces[:, 0].max() == pytest.approx(curves.measured.max())
    _, left = view.find_traces(view.quote("samples", "steel medium", "law residual", "1"))
    assert np.abs(left).max(axis=0) == pytest.approx(
        [
            np.abs(curves.measured - curves.law).max(),
            np.abs(curves.measured - curves.versed_sine).max(),
        ],
        rel=1e-3,
    )
    _, law, _ = view.find_static(
        view.quote("samples", "steel medium", "law", "1"), "SeriesLines:names"
    )
    exponent = float(law.removeprefix("law, n = ").split()[0])
    assert exponent == pytest.approx(found[1].exponent.value, abs=1e-3)


def test_a_sample_whose_law_is_known_no_more_shows_none(record, found):
    traces, _, setup = found

    view = record(lambda log: log.log_law(*found), lambda log: log.log_law(traces, NO_LAW, setup))

    assert len(view.find_hidden()) == 2
