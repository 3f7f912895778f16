"""The figures of a sample show its hits, its mean, the models and what was read from them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.present.figures.sample_figures import (
    draw_channel,
    draw_law_loop,
    draw_law_pulse,
    make_law_picture,
    make_sample_picture,
)
from impact_rig.results.law_curves import compute_law_curves
from impact_rig.results.sample_traces import DRIVEN, IDENTIFIED, PRINTED, ModelTraces


@pytest.fixture(scope="module")
def traces(struck):
    """Return the traces of the first sample, with three models."""
    traces = struck.samples[0]
    fitted = ModelTraces(IDENTIFIED, 0.9 * traces.mean, 0.012, 0.034)
    kept = tuple(model for model in traces.models if model.model in {DRIVEN, PRINTED})
    return replace(traces, models=(*kept, fitted))


@pytest.fixture(scope="module")
def hits(struck, traces):
    return [hit.aligned for hit in struck.hits if hit.result.sample == traces.name]


@pytest.fixture(scope="module")
def curves(contacts):
    law = contacts.results.samples[0].contact_law
    return compute_law_curves(law, contacts.samples[0], contacts.results.setup)


def find(axes, start):
    """Return the points of the line whose name begins like this."""
    return next(
        line.get_xydata() for line in axes.lines if str(line.get_label()).startswith(start)
    )


def test_the_title_has_the_sample_s_numbers(struck, traces, hits):
    sample = struck.results.samples[0]
    picture = make_sample_picture(sample, traces, hits)
    shown = float(picture.title.removeprefix(f"{sample.name}: τp ").split()[0])
    assert shown == pytest.approx(sample.contact_time.value * 1e6, abs=0.01)
    assert picture.title.count("±") == 3
    assert len(picture.panels) == 2


@pytest.mark.parametrize("channel", [0, 1])
def test_a_channel_shows_hits_mean_models_and_what_they_leave(traces, hits, channel):
    upper, lower = draw_channel(traces, hits, channel).axes
    mean = find(upper, "mean")
    assert np.ptp(mean[:, 1]) == pytest.approx(np.ptp(traces.mean[channel]), rel=1e-3)
    assert find(upper, "3 hits").shape == mean.shape
    assert find(upper, "identified model, MSE 0.0")[:, 1] == pytest.approx(0.9 * mean[:, 1])
    # The identified model, drawn last, is 0.9 of the mean.
    assert lower.lines[-1].get_ydata() == pytest.approx(0.1 * mean[:, 1])
    assert len(lower.lines) == len(traces.models)
    half = 0.5e6 * traces.contact_time
    for axes in (upper, lower):
        (band,) = axes.patches
        assert (band.get_x(), band.get_width()) == pytest.approx((-half, 2.0 * half))


def test_marks_stand_where_they_were_read(traces):
    marks = [
        {text.get_text(): text.xy for text in draw_channel(traces, (), channel).axes[0].texts}
        for channel in (0, 1)
    ]
    width = next(point for name, point in marks[0].items() if name.startswith("w50"))
    assert width == pytest.approx(
        (0.5e6 * traces.half_amplitude_width, 0.5 * traces.mean[0].max()), rel=1e-3
    )
    for name, time in (("U1", traces.first_peak_time), ("U2", traces.second_peak_time)):
        height = np.interp(time, traces.time, traces.mean[1])
        assert marks[1][name] == pytest.approx((1e6 * time, height))


def test_what_was_not_measured_or_modelled_is_not_drawn(traces):
    unknown = {"first_peak_time": math.nan, "second_peak_time": math.nan}
    bare = replace(traces, models=(), half_amplitude_width=math.nan, **unknown)
    for channel in (0, 1):
        (axes,) = draw_channel(bare, (), channel).axes
        assert len(axes.lines) == 1
        assert not axes.texts


def test_the_law_s_picture_has_pulse_residuals_and_loop(contacts, curves):
    sample = contacts.results.samples[0]
    picture = make_law_picture(sample, curves)
    exponent = float(picture.title.split("n = ")[1].split()[0])
    assert exponent == pytest.approx(sample.contact_law.exponent.value, abs=1e-3)
    forces, residuals = draw_law_pulse(curves).axes
    left = find(forces, "mean")[:, 1] - find(forces, "law")[:, 1]
    assert residuals.lines[0].get_ydata() == pytest.approx(left)
    (loop,) = draw_law_loop(curves).axes
    assert find(loop, "from both")[:, 0].max() == pytest.approx(
        find(loop, "law")[:, 0].max(), rel=0.3
    )
