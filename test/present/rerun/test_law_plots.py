"""The contact law of a sample as it is logged: pulse, what is left of it, loop."""

import numpy as np
import pytest

from impact_rig.core.estimation.contact_law import NO_LAW
from impact_rig.present.rerun.paper_figures import HEIGHT, WIDTH
from impact_rig.results.law_curves import compute_law_curves


@pytest.fixture(scope="module")
def found(struck):
    """Return a sample's traces, its law, the set-up."""
    return struck.samples[1], struck.results.samples[1].contact_law, struck.results.setup


def test_pulse_residual_and_loop_are_those_of_the_report(record, found):
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
    assert law.startswith(f"law, n = {found[1].exponent.value:.2f}")
    loop = view.quote("samples", "steel medium", "loop")
    (drawn,) = view.find_static(f"{loop}/modelled", "LineStrips2D:strips")
    x, y = np.array(drawn).T
    # Axes reach 5 % over the largest of both loops, and the ordinate points down.
    deepest = max(curves.indentation.max(), curves.law_indentation.max())
    assert x.max() / WIDTH == pytest.approx(curves.law_indentation.max() / deepest / 1.05)
    assert y[0] == pytest.approx(HEIGHT)
    assert {"0 µm", "20 N"} <= set(view.find_static(f"{loop}/names", "Points2D:labels"))


def test_a_sample_whose_law_is_known_no_more_shows_none(record, found):
    traces, _, setup = found

    view = record(lambda log: log.log_law(*found), lambda log: log.log_law(traces, NO_LAW, setup))

    assert len(view.find_hidden()) == 2
    loop = view.quote("samples", "steel medium", "loop")
    assert view.find_static(f"{loop}/measured", "LineStrips2D:strips") == []
