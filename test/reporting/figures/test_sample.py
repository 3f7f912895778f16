import math
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.reporting.figures.sample import draw_sample_figure
from impact_rig.results.sample_traces import DRIVEN, IDENTIFIED, PRINTED, ModelTraces

TRACES_END = 165.0
"""Where the axes of the traces end [pt from the top]: the residuals are below."""


@pytest.fixture(scope="module")
def sample(struck):
    """Return the numbers and the traces of the first sample, with three models."""
    traces = struck.samples[0]
    fitted = ModelTraces(IDENTIFIED, 0.9 * traces.mean, 0.012, 0.034)
    kept = tuple(model for model in traces.models if model.model in {DRIVEN, PRINTED})
    return struck.results.samples[0], replace(traces, models=(*kept, fitted))


@pytest.fixture(scope="module")
def figure(struck, sample):
    return draw_sample_figure(*sample, struck.hits)


def test_the_title_has_the_sample_s_numbers_with_their_uncertainties(sample, figure):
    results = sample[0]
    assert figure.title.startswith(f"{results.name}: τp ")
    for value, expanded, unit in (
        (1e6 * results.contact_time_s, 1e6 * results.contact_time_expanded_s, "µs"),
        (1e-6 * results.stiffness_n_per_m, 1e-6 * results.stiffness_expanded_n_per_m, "MN/m"),
        (
            results.damping_coefficient_n_s_per_m,
            results.damping_coefficient_expanded_n_s_per_m,
            "N s/m",
        ),
    ):
        shown = figure.title.partition(f" {unit}")[0].rpartition(", ")[2].removeprefix("c2 ")
        number, _, width = shown.rpartition(": ")[2].removeprefix("τp ").partition(" ± ")
        assert float(number.removeprefix("k2 ")) == pytest.approx(value, abs=0.5 * expanded)
        assert float(width) == pytest.approx(expanded, rel=0.06)


def test_both_channels_show_the_sample_s_own_hits_mean_and_models(figure, read):
    panels = read(figure)
    assert len(panels) == 2
    for panel in panels:
        assert panel.list_parts("hit-") == ["hit-0", "hit-1", "hit-2"]
        assert panel.list_parts("mean-") == ["mean-1"]
        assert set(panel.list_parts("model-")) == {
            f"model-{name}" for name in (DRIVEN, PRINTED, IDENTIFIED)
        }
        assert len(panel.list_parts("residual-")) == 3


@pytest.mark.parametrize("channel", [0, 1])
def test_the_mean_s_peaks_are_as_high_as_they_are(sample, figure, read, channel):
    panel = read(figure)[channel]
    drawn = panel.measure(panel.read_points("mean-1")[:, 1], "end", above=TRACES_END)
    mean = sample[1].mean[channel]
    assert np.ptp(drawn) == pytest.approx(np.ptp(mean), rel=1e-3)


def test_the_contact_is_shaded_as_long_as_it_lasts(sample, figure, read):
    traces = sample[1]
    panel = read(figure)[0]
    edges = [panel.measure(np.array(points), "middle") for points in panel.read_bands()]
    assert len(edges) == 2  # behind traces and residuals
    half = 0.5e6 * traces.contact_time
    for edge in edges:
        assert sorted(edge) == pytest.approx([-half, half], abs=0.5)


def test_half_amplitude_points_are_w50_apart_at_half_the_peak(sample, figure, read):
    traces = sample[1]
    panel = read(figure)[0]
    points = panel.read_points("width-1")
    width = np.ptp(panel.measure(points[:, 0], "middle"))
    assert width == pytest.approx(1e6 * traces.half_amplitude_width, abs=0.3)
    heights = panel.read_points("mean-1")[:, 1]
    base, peak = heights[0], heights.min()
    assert points[:, 1] == pytest.approx(0.5 * (base + peak), abs=0.5)


@pytest.mark.parametrize(("part", "attribute"), [("u1", "first"), ("u2", "second")])
def test_u1_and_u2_stand_on_the_sample_s_mean_at_their_times(
    sample, figure, read, part, attribute
):
    panel = read(figure)[1]
    point = panel.read_points(f"peak-{part}")[0]
    time = 1e6 * getattr(sample[1], f"{attribute}_peak_time")
    assert panel.measure(point[:1], "middle") == pytest.approx(time, abs=0.5)
    line = panel.read_points("mean-1")
    assert np.interp(point[0], *line.T) == pytest.approx(point[1], abs=0.5)
    peak = getattr(sample[0], f"{attribute}_peak_m_per_s2")
    heights = panel.measure(np.array([line[0, 1], point[1]]), "end", above=TRACES_END)
    assert abs(np.diff(heights)[0]) == pytest.approx(peak, rel=0.01)


def test_a_residual_is_measured_less_model(sample, figure, read):
    panel = read(figure)[0]
    below = panel.read_ticks("end")
    below = below[below[:, 1] > TRACES_END]
    slope = np.diff(below, axis=0)[0]
    line = panel.read_points(f"residual-{IDENTIFIED}")[:, 1]
    # The model is 0.9 of the mean.
    assert np.ptp(line) * abs(slope[0] / slope[1]) == pytest.approx(
        0.1 * np.ptp(sample[1].mean[0]), rel=0.02
    )


def test_the_alternative_text_has_the_numbers_and_the_errors_of_every_model(sample, figure):
    results = sample[0]
    assert "3 hits and their mean" in figure.alternative
    assert f"{results.hammer_peak_m_per_s2:.0f} m/s² at the hammer" in figure.alternative
    assert "identified model: hammer 0.012 %, sample 0.034 %" in figure.alternative


def test_without_model_there_are_no_residuals_and_the_caption_says_so(struck, sample, read):
    results, traces = sample
    figure = draw_sample_figure(results, replace(traces, models=()), ())
    for panel in read(figure):
        assert panel.list_parts("residual-") == panel.list_parts("hit-") == []
    assert "No model could be laid over this sample." in figure.caption


def test_a_sample_without_accelerometer_of_its_own_shows_the_hammer(sample, read):
    results, traces = sample
    alone = replace(
        traces,
        mean=traces.mean[:1],
        models=(),
        first_peak_time=math.nan,
        second_peak_time=math.nan,
    )
    figure = draw_sample_figure(results, alone, ())
    assert len(read(figure)) == 1
    assert "U1" not in figure.caption


def test_a_trace_of_nan_breaks_nothing(sample, read):
    results, traces = sample
    empty = replace(traces, mean=np.full_like(traces.mean, np.nan), models=())
    assert len(read(draw_sample_figure(results, empty, ()))) == 2


def test_ten_hits_of_twelve_samples_stay_below_three_megabytes(struck, sample):
    results, traces = sample
    own = [hit for hit in struck.hits if hit.label.sample == traces.name]
    figure = draw_sample_figure(results, traces, (own * 4)[:10])
    assert len(figure.svg.encode()) < 3e6 / 12
