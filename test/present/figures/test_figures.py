"""Figures of the paper, of a sample and of the impact speed show what the results hold."""

import base64
import math
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.estimates.contact_law import ContactLaw
from impact_rig.core.estimates.paper_method import HammerEstimate
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.estimates.speed_exponents import estimate_speed_exponents
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.present.campaign_figures import (
    SHOWN,
    draw_responses,
    draw_speed,
    draw_widths,
    make_contact_pictures,
    make_figure_rows,
    make_model_pictures,
)
from impact_rig.present.sample_figures import (
    draw_channel,
    draw_law_loop,
    leave_out_printed,
    list_lines,
    make_sample_picture,
)
from impact_rig.results.campaign import Results
from impact_rig.results.tables import tabulate_contact_times, tabulate_speed_exponents
from impact_rig.results.traces import DRIVEN, PRINTED, ModelTraces, compute_law_curves

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
    drawn = base64.b64decode(pictures[2].panels[0].url.partition(",")[2]).decode()
    # The paper's order, whatever that of the samples is.
    places = [drawn.index(name) for name in ("brass small", "steel medium", "aluminium")]
    assert places == sorted(places)


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
        [1e6 * item.paper.contact_time.value for item in results.samples]
    )
    table_2 = [144.8, 196.8, 212, 170, 203.2, 219.2, 188, 226.4, 239.2, 189, 228, 244]
    assert lines["expected"][:, 1] == pytest.approx(table_2)


@pytest.mark.parametrize("channel", [0, 1])
def test_figure_5_lays_the_solid_model_over_the_dashed_measurement(struck, channel):
    for axes in draw_responses(struck.samples, channel).axes:
        model, measured = axes.lines
        assert (model.get_linestyle(), measured.get_linestyle()) == ("-", "--")
        assert model.get_ydata().max() == pytest.approx(1.0, abs=0.01)
        assert measured.get_ydata().max() == pytest.approx(1.0, abs=0.01)


@pytest.fixture(scope="module")
def traces(struck):
    """Return the traces of the first sample, with two models."""
    traces = struck.samples[0]
    known = ModelTraces(PRINTED, 0.9 * traces.mean, (0.012, 0.034))
    driven = next(model for model in traces.models if model.model == DRIVEN)
    return replace(traces, models=(driven, known))


@pytest.fixture(scope="module")
def hits(struck, traces):
    return [hit.aligned for hit in struck.hits if hit.result.sample == traces.name]


@pytest.fixture(scope="module")
def curves(contacts):
    law = contacts.results.samples[0].contact_law
    return compute_law_curves(law, contacts.samples[0], contacts.results.setup)


HITS, MEAN = 0, 1  # the first lines of a channel


@pytest.mark.parametrize("channel", [0, 1])
def test_a_channel_shows_hits_mean_models_and_what_they_leave(traces, hits, channel):
    upper, lower = draw_channel(traces, hits, None, channel).axes
    lines = [line.get_xydata() for line in upper.lines[: 2 + len(traces.models)]]
    mean, printed = lines[MEAN], lines[-1]
    assert np.ptp(mean[:, 1]) == pytest.approx(np.ptp(traces.mean[channel]), rel=1e-3)
    assert len(lines[HITS]) == len(hits) * (len(mean) + 1)  # a gap behind each
    # The printed model is 0.9 of the mean.
    assert printed[:, 1] == pytest.approx(0.9 * mean[:, 1])
    assert lower.lines[-1].get_ydata() == pytest.approx(0.1 * mean[:, 1])
    assert len(lower.lines) == len(traces.models)
    assert upper.get_title(loc="left").endswith(" and 0.012 %" if channel == 0 else " and 0.034 %")
    half = 0.5e6 * traces.contact_time
    for axes in (upper, lower):
        (band,) = axes.patches
        assert (band.get_x(), band.get_width()) == pytest.approx((-half, 2.0 * half))


def test_every_line_of_the_figures_has_its_look_and_name_in_their_legend(traces, hits, curves):
    known = {line.get_label(): line for line in list_lines([traces], has_law=True)}
    assert list(known) == [
        "hits", "mean hit", "force-driven model", "model as printed", "contact law",
        "force from both traces",
    ]  # fmt: skip
    channel = draw_channel(traces, hits, curves, 0).axes[0].lines[:5]
    drawn = [*channel, *draw_law_loop(curves).axes[0].lines]
    assert set(map(read_look, drawn)) == set(map(read_look, known.values()))


def read_look(line):
    return line.get_color(), line.get_linestyle(), line.get_linewidth()


def test_marks_stand_where_they_were_read(traces):
    marks = []
    for channel in (0, 1):
        texts = draw_channel(traces, (), None, channel).axes[0].texts
        marks.append({text.get_text(): text.xy for text in texts})
    width = next(point for name, point in marks[0].items() if name.startswith("w50"))
    assert width == pytest.approx(
        (0.5e6 * traces.half_amplitude_width, 0.5 * traces.mean[0].max()), rel=1e-3
    )
    for name, time in (("U1", traces.first_peak_time), ("U2", traces.second_peak_time)):
        height = np.interp(time, traces.time, traces.mean[1])
        assert marks[1][name] == pytest.approx((1e6 * time, height))


def test_the_law_lies_on_the_hammer_s_pulse_and_has_its_loop(contacts, curves):
    traces = contacts.samples[0]
    upper, lower = draw_channel(traces, (), curves, 0).axes
    mean, law = upper.lines[0].get_xydata(), upper.lines[-3].get_xydata()
    left = np.interp(law[:, 0], mean[:, 0], mean[:, 1]) - law[:, 1]
    assert lower.lines[-1].get_ydata() == pytest.approx(left)
    assert np.abs(left).max() < 0.02 * np.abs(mean[:, 1]).max()
    (loop,) = draw_law_loop(curves).axes
    measured, expected = (line.get_xdata() for line in loop.lines)
    assert measured.max() == pytest.approx(expected.max(), rel=0.3)
    assert len(make_sample_picture(traces, (), curves).panels) == 3
    assert len(make_sample_picture(traces, (), None).panels) == 2


@pytest.mark.parametrize(("printed", "is_shown"), [(0.9, True), (1.1, False)])
def test_the_model_as_printed_is_left_out_where_the_driven_one_is_nearer(
    traces, printed, is_shown
):
    errors = {DRIVEN: 1.0, PRINTED: printed}
    models = [replace(item, mse_percent=(0.1, errors[item.model])) for item in traces.models]
    shown = leave_out_printed(replace(traces, models=tuple(models)))
    assert (shown.find_model(PRINTED) is not None) is is_shown
    assert shown.find_model(DRIVEN) is not None


ANGLES = tuple(map(math.radians, (4.0, 8.0, 16.0)))
BODIES = ("steel small", "brass large")


def make_law(speed, place):
    """Return a Hertz contact without loss."""
    return ContactLaw(
        impact_speed=Quantity(speed, 1e-3, 2e-3),
        duration=Quantity((150e-6 + 50e-6 * place) * speed**-0.2, 1e-7, 2e-7),
        peak_force=Quantity(100.0 * (1.0 + place) * speed**1.2, 0.1, 0.2),
        restitution=Quantity(0.9, 1e-3, 2e-3),
    )


@pytest.fixture(scope="module")
def series():
    setup = PAPER_SETUP.at_angles(ANGLES)
    samples = tuple(
        SampleEstimate(
            name, 1, 0, contact_law=make_law(setup.for_series(name).impact_speed, place)
        )
        for place, body in enumerate(BODIES)
        for name in setup.samples.find_series([body])
    )
    exponents = estimate_speed_exponents(setup, samples)
    return Results(setup, HammerEstimate(), samples, (), exponents)


@pytest.mark.parametrize(("shown", "exponent"), list(zip(SHOWN, (-0.2, 1.2, 0.0), strict=True)))
def test_each_sample_has_a_point_for_each_speed_and_a_straight_line(series, shown, exponent):
    panel = draw_speed(series, *shown)
    for bars in panel.axes[0].containers:
        points = np.log(bars.lines[0].get_xydata())
        assert len(points) == len(ANGLES)
        slopes = np.diff(points[:, 1]) / np.diff(points[:, 0])
        assert slopes == pytest.approx(exponent, abs=1e-6)
    texts = [text.get_text() for text in panel.legends[0].get_texts()]
    assert texts[0].startswith(f"steel small: p = {exponent:.3f}")


def test_the_table_has_a_row_for_each_sample_and_one_for_all(series):
    (table,) = tabulate_speed_exponents(series.speed_exponents)
    counts = [row[:2] for row in table.rows]
    assert counts == [("steel small", "3"), ("brass large", "3"), ("all", "6")]
    exponents = [float(cell.split()[0]) for cell in table.rows[2][2:]]
    assert exponents == pytest.approx([-0.2, 1.2, 0.0], abs=1e-3)
    assert tabulate_speed_exponents(()) == []


def test_what_the_rig_s_one_speed_lets_expect_is_not_held_against_other_angles(series):
    table = tabulate_contact_times(series)
    assert "Reference [µs]" not in [column.header for column in table.columns]
    assert "Δ/U" not in [column.header for column in table.columns]
