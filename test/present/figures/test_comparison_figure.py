from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.quantity import Quantity
from impact_rig.present.figures.comparison_figure import draw_comparison_figure


@pytest.fixture(scope="module")
def other(struck):
    """Return the same campaign with every contact time one percent longer."""
    samples = tuple(
        replace(
            sample,
            contact_time=replace(sample.contact_time, value=1.01 * sample.contact_time.value),
        )
        for sample in struck.results.samples
    )
    return replace(struck.results, samples=samples)


@pytest.fixture(scope="module")
def figures(struck, other):
    return draw_comparison_figure([("before", struck.results), ("after", other)])


def test_there_is_a_figure_for_each_quantity(figures):
    assert [figure.title for figure in figures] == [
        "Contact time by run",
        "Stiffness by run",
        "Damping coefficient by run",
    ]
    assert all(figure.is_drawn for figure in figures)


def test_values_and_bars_stand_where_the_axis_says(struck, figures, read):
    panel = read(figures[0])[0]
    for place, sample in enumerate(struck.results.samples):
        values = [panel.read_points(f"value-{place}-{run}")[0, 0] for run in (0, 1)]
        expected = 1e6 * sample.contact_time.value * np.array([1.0, 1.01])
        assert panel.measure(np.array(values), "middle") == pytest.approx(expected, abs=0.1)
        bar = panel.measure(panel.read_points(f"bar-{place}-1")[:, 0], "middle")
        assert np.ptp(bar) == pytest.approx(2e6 * sample.contact_time.expanded, abs=0.1)


def test_differences_from_the_first_run_are_in_percent_of_it(struck, figures, read):
    panel = read(figures[0])[1]
    for place, sample in enumerate(struck.results.samples):
        for run, expected in enumerate((0.0, 1.0)):
            point = panel.read_points(f"difference-{place}-{run}")[:, 0]
            assert panel.measure(point, "middle") == pytest.approx(expected, abs=0.01)
        bar = panel.measure(panel.read_points(f"bar-{place}-1")[:, 0], "middle")
        relative = sample.contact_time.expanded / sample.contact_time.value
        assert np.ptp(bar) == pytest.approx(200.0 * relative, abs=0.01)


def test_the_alternative_text_names_the_largest_difference(figures):
    assert "τp of 3 samples in 2 runs. Largest difference from before: +1.00 %," in (
        figures[0].alternative
    )


def test_a_quantity_that_no_run_has_is_not_drawn_and_the_caption_says_why(struck):
    bare = tuple(
        replace(sample, stiffness=Quantity(float("nan"))) for sample in struck.results.samples
    )
    figures = draw_comparison_figure([("bare", replace(struck.results, samples=bare))])
    assert [figure.is_drawn for figure in figures] == [True, False, True]
    assert figures[1].caption == "No run has k2 of any sample."


def test_one_sample_that_is_quite_another_does_not_hide_the_others(struck, other, read):
    strange = replace(
        other.samples[0], contact_time=Quantity(3.0 * struck.results.samples[0].contact_time.value)
    )
    changed = replace(other, samples=(strange, *other.samples[1:]))
    panel = read(draw_comparison_figure([("first", struck.results), ("second", changed)])[0])[1]
    one, zero = (panel.read_points(f"difference-1-{run}")[0, 0] for run in (1, 0))
    assert one - zero > 20.0  # points of the drawing for one percent, beside 200 %
