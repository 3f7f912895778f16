"""The paper's figures 3, 4 and 6, read back from the file."""

from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.quantity import Quantity
from impact_rig.present.rerun.paper_figures import WIDTH, choose_ticks, compute_axis_end
from impact_rig.results.figure_rows import make_figure_rows


def find_points(view, entity):
    """Return abscissas [s] and ordinates of an entity's points by name, in their order."""
    moments, values = view.find_traces(entity)
    points = {}
    for name, column in zip(view.find_static(entity, "SeriesPoints:names"), values.T, strict=True):
        shown = np.isfinite(column)
        points.setdefault(name, []).extend(zip(moments[shown], column[shown], strict=True))
    return points


def test_figure_3_has_each_hit_the_mean_and_the_papers_value(record, results):
    view = record(lambda log: log.log_results(results))

    hits, means = (find_points(view, f"/figures/3/{part}/1") for part in ("hits", "means"))
    for row in make_figure_rows(results):
        mass = row.relative_mass * 1e3
        expected = [(time, mass) for time in sorted(row.contact_times)]
        assert len(expected) == 2
        np.testing.assert_allclose(hits[row.name], expected, rtol=1e-5)
        np.testing.assert_allclose(means[row.name], [(row.contact_time, mass)], rtol=1e-5)
    points = find_points(view, "/figures/3/reference/1")
    assert min(time for time, _ in points["paper"]) == pytest.approx(144.8e-6)
    # The misprinted value of medium brass is not shown: 288 µs would be the last one.
    assert max(time for time, _ in points["paper"]) == pytest.approx(244e-6)


def test_figure_4_has_the_peaks_of_the_means_with_the_papers_markers(record, results):
    import rerun

    view = record(lambda log: log.log_results(results))

    for body, peak in (("hammer", "hammer_peak"), ("sample", "specimen_peak")):
        entity = f"/figures/4/{body}/1"
        points = find_points(view, entity)
        for row in make_figure_rows(results):
            (found,) = points[row.name]
            np.testing.assert_allclose(found, (row.contact_time, getattr(row, peak)), rtol=1e-5)
    markers = view.find_static("/figures/4/hammer/1", "SeriesPoints:markers")
    shapes = rerun.components.MarkerShape
    assert markers[:3] == [shapes.Square.value, shapes.Up.value, shapes.Asterisk.value]


def test_new_results_take_the_place_of_the_last_ones(record, results):
    slower = replace(results.samples[0], contact_time=Quantity(150e-6))
    others = replace(results, samples=(slower, *results.samples[1:]))

    view = record(
        lambda log: log.log_results(results),
        lambda log: log.log_results(results),
        lambda log: log.log_results(others),
    )

    # What is the same is not drawn again: the paper's values, each hit.
    assert view.find_hidden() == {
        "/figures/3/means/1",
        "/figures/4/hammer/1",
        "/figures/4/sample/1",
    }
    assert not [entity for entity in view.entities if entity.endswith("/3")]
    assert view.find_static("/results", "TextDocument:media_type") == ["text/markdown"]
    (text,) = view.find_static(r"/samples/steel\ small/summary", "TextDocument:text")
    assert text.startswith("# steel small")


def test_bars_are_as_long_as_their_errors_and_named(record, results):
    view = record(lambda log: log.log_results(results))

    strips = view.find_static("/figures/6/sample/bars", "LineStrips2D:strips")
    errors = np.array(sorted(row.mse_sample_percent for row in make_figure_rows(results)))
    lengths = sorted({strip[1][0] for strip in strips})
    np.testing.assert_allclose(lengths, WIDTH * errors / compute_axis_end(errors, 2.8))
    labels = view.find_static("/figures/6/sample/labels", "Points2D:labels")
    assert labels[:2] == ["aluminium small", "aluminium medium"]
    assert labels[-1] == "paper: at most 2.8 %"
    assert view.find_static("/figures/6/hammer/labels", "Points2D:labels")[-1].endswith(" 0.25 %")


@pytest.mark.parametrize(
    ("top", "ticks"),
    [
        (0.2625, [0.0, 0.05, 0.1, 0.15, 0.2, 0.25]),
        (2.94, [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]),
        (4.17, [0.0, 1.0, 2.0, 3.0, 4.0]),
        (6.0, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
    ],
)
def test_ticks_are_round(top, ticks):
    assert choose_ticks(top) == pytest.approx(ticks)


@pytest.mark.parametrize("values", [(), (1.0,), (4.0,)])
def test_the_axis_reaches_beyond_bound_and_values(values):
    assert compute_axis_end(values, 2.8) > max(2.8, *values, 0.0)
