import math
import re
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.errors import ParameterError
from impact_rig.reporting.figures.campaign import draw_campaign_figures
from impact_rig.reporting.figures.figure_4 import draw_figure_4
from impact_rig.reporting.figures.figure_5 import draw_figure_5
from impact_rig.reporting.figures.figure_6 import draw_figure_6
from impact_rig.results.figure_rows import make_figure_rows
from impact_rig.results.sample_traces import DRIVEN


@pytest.fixture(scope="module")
def rows(struck):
    return make_figure_rows(struck.results)


@pytest.fixture(scope="module")
def figures(struck):
    return draw_campaign_figures(struck.results, struck.samples)


def test_a_campaign_has_the_paper_s_figures_3_to_6(figures):
    assert [figure.title[:7] for figure in figures] == ["Fig. 3.", "Fig. 4.", "Fig. 5.", "Fig. 6."]
    assert all(figure.is_drawn and figure.alternative and figure.caption for figure in figures)
    assert len({figure.name for figure in figures}) == 4


def test_no_id_of_a_campaign_s_figures_is_there_twice(figures):
    ids = re.findall(r'id="([^"]+)"', "".join(figure.svg for figure in figures))
    assert len(ids) > 100
    assert len(set(ids)) == len(ids)


def test_results_alone_have_all_but_figure_5_which_says_why(struck):
    figures = draw_campaign_figures(struck.results, (), prefix="run 2")
    assert [figure.is_drawn for figure in figures] == [True, True, False, True]
    assert "There are no traces" in figures[2].caption
    assert all(figure.name.startswith("run-2--figure") for figure in figures)


def test_a_sample_that_is_not_in_the_setup_is_an_error(struck):
    stranger = replace(struck.results.samples[0], name="stranger")
    with pytest.raises(ParameterError, match="unknown sample 'stranger'"):
        draw_campaign_figures(replace(struck.results, samples=(stranger,)), ())


@pytest.mark.parametrize(("panel", "attribute"), [(0, "hammer_peak"), (1, "specimen_peak")])
def test_figure_4_shows_amplitudes_over_pulse_widths(rows, figures, read, panel, attribute):
    drawing = read(figures[1])[panel]
    points = np.concatenate([drawing.read_points(f"mean-{place}") for place in range(3)])
    times = [1e6 * row.contact_time for row in rows]
    assert drawing.measure(points[:, 0], "middle") == pytest.approx(times, abs=0.1)
    peaks = np.array([getattr(row, attribute) for row in rows])
    drawn = drawing.measure(points[:, 1], "end")
    assert drawn - drawn[0] == pytest.approx(peaks - peaks[0], abs=0.002 * peaks.max())
    assert f"{peaks.max():.0f} m/s²" in figures[1].alternative


def test_figure_4_leaves_out_what_was_not_measured(rows, read):
    silent = [replace(row, specimen_peak=math.nan) for row in rows]
    assert len(read(draw_figure_4(silent))) == 1
    figure = draw_figure_4([replace(row, hammer_peak=math.nan) for row in silent])
    assert "No sample has a pulse width and an amplitude" in figure.caption


def test_figure_5_shows_the_paper_s_cases_from_top_to_bottom(figures, read):
    for panel in read(figures[2]):
        names = [text for text in panel.read_texts() if text.split()[0] in {"brass", "steel"}]
        assert names == ["brass small", "steel medium"]
        tops = [panel.read_points(f"measured-{place}")[:, 1].min() for place in range(3)]
        assert tops == sorted(tops)


def test_figure_5_normalises_model_and_measurement_to_one_peak(figures, read):
    for panel in read(figures[2]):
        for place in range(3):
            model, measured = (
                panel.read_points(f"{kind}-{place}")[:, 1].min() for kind in ("model", "measured")
            )
            assert model == pytest.approx(measured, abs=0.5)


def test_figure_5_draws_the_model_solid_and_the_measurement_dashed(figures, read):
    for panel in read(figures[2]):
        assert "dasharray" not in panel.read_styles("model-0")
        assert "dasharray" in panel.read_styles("measured-0")


def test_figure_5_says_the_error_of_every_case(struck, figures):
    for sample in struck.samples:
        mse = sample.find_model(DRIVEN).mse_sample_percent
        text = figures[2].alternative.partition(f"{sample.name}: hammer ")[2]
        assert text.partition("sample ")[2].startswith(f"{mse:.3g} %")


def test_figure_5_without_any_model_says_so(struck):
    bare = [replace(sample, models=()) for sample in struck.samples]
    assert "No sample has a model" in draw_figure_5(bare).caption


def test_figure_5_takes_a_trace_of_nan(struck):
    sample = struck.samples[0]
    figure = draw_figure_5([replace(sample, mean=np.full_like(sample.mean, np.nan))])
    assert figure.is_drawn


def test_figure_6_has_bars_as_long_as_their_values_and_the_paper_s_bound(rows, read):
    loud = [
        replace(row, mse_hammer_percent=hammer, mse_sample_percent=specimen)
        for row, hammer, specimen in zip(rows, (0.05, 0.1, 0.2), (1.0, 2.0, 4.0), strict=True)
    ]
    figure = draw_figure_6(loud)
    for panel, bound, values in zip(
        read(figure), (0.25, 2.8), ((0.05, 0.1, 0.2), (1.0, 2.0, 4.0)), strict=True
    ):
        bars = [panel.read_points(f"bar-{place}")[:, 0] for place in range(3)]
        assert panel.measure(np.array([bar.min() for bar in bars]), "middle") == pytest.approx(
            0.0, abs=0.005 * bound
        )
        assert panel.measure(np.array([bar.max() for bar in bars]), "middle") == pytest.approx(
            values, abs=0.005 * bound
        )
        line = panel.measure(panel.read_points("bound-1")[:, 0], "middle")
        assert line == pytest.approx(bound, abs=0.005 * bound)
    assert "largest 4 % (brass small); 1 of 3 above the paper's 2.8 %." in figure.alternative


def test_figure_6_shows_errors_far_below_the_bound_as_points_on_decades(figures, read):
    panel = read(figures[3])[0]
    ticks = panel.read_ticks("middle")
    slope = np.diff(ticks[:, 1]) / np.diff(np.log10(ticks[:, 0]))
    assert slope == pytest.approx(slope[0], rel=1e-3)
    assert len(panel.read_points("bar-0")) == 1


def test_figure_6_without_model_says_so(rows):
    bare = [replace(row, mse_hammer_percent=math.nan, mse_sample_percent=math.nan) for row in rows]
    assert "could be compared with the model" in draw_figure_6(bare).caption


def test_forty_samples_with_long_names_have_forty_lines_that_keep_apart(rows, read):
    many = [
        replace(rows[0], name=f"a cylinder of brass, number {place}", material=f"alloy {place}")
        for place in range(40)
    ]
    panel = read(draw_figure_6(many))[1]
    names = [(text, y) for text, y in panel.list_texts() if text.startswith("a cylinder o")]
    assert len({text for text, _ in names}) == 40
    assert np.diff([y for _, y in names]).min() > 10.0
