import math
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.reporting.figures.figure_3 import draw_figure_3
from impact_rig.results.figure_rows import make_figure_rows


@pytest.fixture(scope="module")
def rows(whole):
    return make_figure_rows(whole)


@pytest.fixture(scope="module")
def figure(rows):
    return draw_figure_3(rows)


def test_every_hit_is_a_tick_in_both_panels(whole, figure, read):
    widths, differences = read(figure)
    for panel, part in ((widths, "hits"), (differences, "differences")):
        parts = panel.list_parts(f"{part}-")
        assert len(parts) == 12
        assert sum(len(panel.read_points(part)) for part in parts) == len(whole.hits)


def test_means_stand_where_the_axes_say(whole, figure, read):
    panel = read(figure)[0]
    points = np.concatenate([panel.read_points(f"mean-{place}") for place in range(12)])
    # m1 m2 / (m1 + m2) with the accelerometer's 3 g on every sample, in grams.
    masses = [1e3 * sample.mass_kg + 3.0 for sample in whole.setup.samples]
    expected = [100.0 * mass / (100.0 + mass) for mass in masses]
    assert panel.measure(points[:, 0], "middle") == pytest.approx(expected, abs=0.05)
    times = np.array([1e6 * sample.contact_time_s for sample in whole.samples])
    drawn = panel.measure(points[:, 1], "end")
    assert drawn - drawn[0] == pytest.approx(times - times[0], abs=0.1)


def test_the_paper_s_points_stand_beside_the_misprint_corrected(whole, figure, read):
    panel = read(figure)[0]
    drawn = panel.measure(
        np.concatenate([panel.read_points(f"reference-{place}")[:, 1] for place in range(12)]),
        "end",
    )
    table_2 = [144.8, 196.8, 212, 170, 203.2, 219.2, 188, 226.4, 239.2, 189, 228, 244]
    assert drawn - drawn[0] == pytest.approx(np.array(table_2) - 144.8, abs=0.1)
    assert "prints 288.10 µs for brass medium, a misprint" in figure.caption


def test_a_hit_differs_from_its_mean_by_what_the_second_panel_shows(rows, figure, read):
    panel = read(figure)[1]
    for place in (0, 11):
        drawn = panel.measure(panel.read_points(f"differences-{place}")[:, 0], "middle")
        row = rows[place]
        expected = [1e6 * (time - row.contact_time) for time in row.contact_times]
        assert drawn == pytest.approx(expected, abs=0.02)


def test_samples_are_named_from_top_to_bottom(whole, figure, read):
    texts = read(figure)[1].read_texts()
    names = [sample.name for sample in whole.samples]
    assert [text for text in texts if text in names] == names


def test_the_alternative_text_has_the_numbers(figure):
    assert "24 hits on 12 samples" in figure.alternative
    assert "at 19.6 g (aluminium small)" in figure.alternative
    assert "at 75.2 g (brass large)" in figure.alternative
    assert "Largest difference from the paper's value: 0." in figure.alternative


def test_without_masses_there_is_no_figure_but_a_reason(rows):
    figure = draw_figure_3([replace(row, relative_mass=math.nan) for row in rows])
    assert not figure.is_drawn
    assert "needs the masses" in figure.caption


def test_without_pulse_widths_there_is_no_figure_but_a_reason(rows):
    figure = draw_figure_3([replace(row, contact_time=math.nan) for row in rows])
    assert not figure.is_drawn
    assert "No sample has a pulse width" in figure.caption
    assert not draw_figure_3([]).is_drawn


def test_a_lone_hit_without_reference_is_drawn_and_what_has_no_mass_is_named(rows, read):
    lone = replace(
        rows[0],
        contact_times=rows[0].contact_times[:1],
        contact_time_expanded=math.nan,
        reference=replace(rows[0].reference, contact_time=math.nan, published=None),
    )
    figure = draw_figure_3([lone, replace(rows[1], relative_mass=math.nan)])
    panel = read(figure)[0]
    assert len(panel.read_points("hits-0")) == 1
    assert panel.find("reference-0") is None
    assert "1 hit on 1 sample " in figure.alternative
    assert figure.caption.endswith("for want of a mass or a pulse width: aluminium medium.")


def test_a_reference_far_away_does_not_squeeze_the_hits(rows, read):
    near = draw_figure_3(rows[:1])
    far = draw_figure_3(
        [replace(rows[0], reference=replace(rows[0].reference, contact_time=3e-4))]
    )
    spread = [np.ptp(read(figure)[1].read_points("differences-0")[:, 0]) for figure in (near, far)]
    assert spread[1] == pytest.approx(spread[0])
    assert "An arrow" in far.caption
    assert "An arrow" not in near.caption
