"""Figs. 3 to 6 show what the results hold."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.present.figures.paper_figures import (
    draw_errors,
    draw_peaks,
    draw_responses,
    draw_widths,
    make_contact_pictures,
    make_model_pictures,
)
from impact_rig.results.figure_rows import make_figure_rows

NAN = math.nan


@pytest.fixture(scope="module")
def rows(results):
    """Return all samples of the paper, two hits each."""
    return make_figure_rows(results)


def read_lines(axes):
    """Return the points of what has a name in the legend or in the drawing, shape (n, 2)."""
    named = {line.get_label(): line.get_xydata() for line in axes.lines}
    for bars in axes.containers:
        named[bars.get_label()] = bars.lines[0].get_xydata()
    return named


def test_a_campaign_has_the_paper_s_figures_3_to_6(struck):
    pictures = make_contact_pictures(struck.results)
    pictures += make_model_pictures(struck.results, struck.samples)
    assert [picture.title[:7] for picture in pictures] == [
        "Fig. 3.", "Fig. 4.", "Fig. 5.", "Fig. 6.",
    ]  # fmt: skip
    assert [len(picture.panels) for picture in pictures] == [1, 2, 2, 2]


def test_results_alone_have_all_but_figure_5(struck):
    (picture,) = make_model_pictures(struck.results, ())
    assert picture.title.startswith("Fig. 6.")


@pytest.mark.parametrize(("field", "titles"), [("contact_time", []), ("mass", ["Fig. 4."])])
def test_what_is_not_known_is_not_drawn(results, field, titles):
    if field == "mass":
        changed = replace(results, setup=replace(results.setup, hammer_mass=NAN))
    else:
        unknown = replace(results.samples[0].contact_time, value=NAN)
        changed = replace(
            results, samples=tuple(replace(item, contact_time=unknown) for item in results.samples)
        )
    assert [picture.title[:7] for picture in make_contact_pictures(changed)] == titles


def test_figure_3_has_every_hit_the_means_and_the_paper_s_points_the_misprint_corrected(
    results, rows
):
    lines = read_lines(draw_widths(rows).axes[0])
    hits = [points for name, points in lines.items() if name.startswith("_hits")]
    assert sum(map(len, hits)) == len(results.hits)
    # m1 m2 / (m1 + m2) with the accelerometer's 3 g on every sample, in grams.
    masses = [1e3 * sample.mass + 3.0 for sample in results.setup.samples.samples]
    expected = [100.0 * mass / (100.0 + mass) for mass in masses]
    means = np.concatenate([lines[name] for name in ("aluminium", "steel", "bronze", "brass")])
    assert means[:, 0] == pytest.approx(expected)
    assert means[:, 1] == pytest.approx(
        [1e6 * item.contact_time.value for item in results.samples]
    )
    table_2 = [144.8, 196.8, 212, 170, 203.2, 219.2, 188, 226.4, 239.2, 189, 228, 244]
    assert lines["expected"][:, 1] == pytest.approx(table_2)


@pytest.mark.parametrize(
    ("body", "field"), [("hammer", "hammer_peak"), ("sample", "specimen_peak")]
)
def test_figure_4_shows_amplitudes_over_pulse_widths(rows, body, field):
    lines = read_lines(draw_peaks(rows, body).axes[0])
    points = np.concatenate([lines[name] for name in ("aluminium", "steel", "bronze", "brass")])
    assert points[:, 0] == pytest.approx([1e6 * row.estimate.contact_time.value for row in rows])
    assert points[:, 1] == pytest.approx([getattr(row.estimate, field) for row in rows])


@pytest.mark.parametrize("channel", [0, 1])
def test_figure_5_lays_the_solid_model_over_the_dashed_measurement(struck, channel):
    for axes in draw_responses(struck.samples, channel).axes:
        model, measured = axes.lines
        assert (model.get_linestyle(), measured.get_linestyle()) == ("-", "--")
        assert model.get_ydata().max() == pytest.approx(1.0, abs=0.01)
        assert measured.get_ydata().max() == pytest.approx(1.0, abs=0.01)


def test_figure_6_has_bars_as_long_as_their_values_and_the_paper_s_bound(rows):
    errors = (1.0, 2.0, 4.0)
    loud = [
        replace(row, estimate=replace(row.estimate, mse_sample_percent=value))
        for row, value in zip(rows[:3], errors, strict=True)
    ]
    (axes,) = draw_errors(loud, "sample").axes
    assert [bar.get_width() for bar in axes.patches] == list(errors)
    assert axes.lines[0].get_xdata() == [2.8, 2.8]
    assert [text.get_text() for text in axes.get_yticklabels()] == [
        row.estimate.name for row in loud
    ]
