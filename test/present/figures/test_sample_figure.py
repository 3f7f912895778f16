import math
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.present.figures.sample_figure import draw_sample_figure
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
    return draw_sample_figure(*sample, [hit.aligned for hit in struck.hits])


def test_the_words_have_the_sample_s_numbers_and_the_errors_of_every_model(sample, figure):
    numbers = sample[0]
    shown = float(figure.title.removeprefix(f"{numbers.name}: τp ").split()[0])
    assert shown == pytest.approx(numbers.contact_time.value * 1e6, abs=0.01)
    assert [part.split()[0] for part in figure.title.split(": ")[1].split(", ")] == [
        "τp", "k2", "c2",
    ]  # fmt: skip
    assert figure.title.count("±") == 3
    assert "3 hits and their mean" in figure.alternative
    assert f"{numbers.hammer_peak:.0f} m/s² at the hammer" in figure.alternative
    assert "identified model: hammer 0.012 %, sample 0.034 %" in figure.alternative


@pytest.mark.parametrize("channel", [0, 1])
def test_a_channel_shows_the_sample_s_own_hits_its_models_and_the_mean_as_high_as_it_is(
    sample, figure, read, channel
):
    panel = read(figure)[channel]
    models = [model.model for model in sample[1].models]
    assert panel.list_parts("hit-") == ["hit-0", "hit-1", "hit-2"]
    assert panel.list_parts("model-") == [f"model-{name}" for name in models]
    assert panel.list_parts("residual-") == [f"residual-{name}" for name in models]
    drawn = panel.measure(panel.read_points("mean-1")[:, 1], "end", above=TRACES_END)
    assert np.ptp(drawn) == pytest.approx(np.ptp(sample[1].mean[channel]), rel=1e-3)


def test_contact_and_half_amplitude_stand_where_they_were_read(sample, figure, read):
    traces, panel = sample[1], read(figure)[0]
    edges = [panel.measure(np.array(points), "middle") for points in panel.read_bands()]
    assert len(edges) == 2  # behind traces and residuals
    half = 0.5e6 * traces.contact_time
    for edge in edges:
        assert sorted(edge) == pytest.approx([-half, half], abs=0.5)
    points = panel.read_points("width-1")
    width = np.ptp(panel.measure(points[:, 0], "middle"))
    assert width == pytest.approx(1e6 * traces.half_amplitude_width, abs=0.3)
    heights = panel.read_points("mean-1")[:, 1]
    assert points[:, 1] == pytest.approx(0.5 * (heights[0] + heights.min()), abs=0.5)


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
    peak = getattr(sample[0], f"{attribute}_peak")
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


def test_what_was_not_measured_or_modelled_is_not_drawn(sample, read):
    results, traces = sample
    bare = replace(traces, models=())
    figure = draw_sample_figure(results, bare, ())
    for panel in read(figure):
        assert panel.list_parts("residual-") == panel.list_parts("hit-") == []
    assert "No model could be laid over this sample." in figure.caption
    unknown = {"first_peak_time": math.nan, "second_peak_time": math.nan}
    alone = draw_sample_figure(results, replace(bare, mean=traces.mean[:1], **unknown), ())
    assert len(read(alone)) == 1
    assert "U1" not in alone.caption
    nothing = replace(bare, mean=np.full_like(traces.mean, math.nan))
    assert len(read(draw_sample_figure(results, nothing, ()))) == 2


def test_ten_hits_of_twelve_samples_stay_below_three_megabytes(struck, sample):
    results, traces = sample
    own = [hit.aligned for hit in struck.hits if hit.result.sample == traces.name]
    figure = draw_sample_figure(results, traces, (own * 4)[:10])
    assert len(figure.svg.encode()) < 3e6 / 12
