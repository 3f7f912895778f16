"""One sample: its hits, their mean and the models; the law of its contact."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from impact_rig.core.sample import SampleEstimate
from impact_rig.present.picture import (
    WIDTH,
    Picture,
    drawing_style,
    fill_panel,
    make_picture,
    reuse_panel,
)
from impact_rig.results.numbers import (
    MICRO,
    SAMPLE_MEASURANDS,
    format_count,
    format_error,
    format_quantity,
)
from impact_rig.results.palette import BLUE, GREEN, PURPLE, VERMILION, format_hex
from impact_rig.results.traces import (
    DRIVEN,
    PRINTED,
    AlignedHit,
    LawCurves,
    SampleTraces,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HAMMER = 0
MakePanel = Callable[..., Any]
"""Makes a panel with axes of these heights, as `reuse_panel` does."""
TITLES = ("a) hammer", "b) sample")
MODEL_NAMES = {
    DRIVEN: "force-driven model",
    PRINTED: "model as printed",
}
LOOKS: dict[str, dict[str, Any]] = {
    DRIVEN: {"color": format_hex(VERMILION), "linestyle": (0, (5, 1.5))},
    PRINTED: {"color": format_hex(PURPLE), "linestyle": (0, (5, 1.5, 1, 1.5))},
}
LAW_LOOKS: dict[str, dict[str, Any]] = {
    "law": {"color": format_hex(BLUE)},
    "versed-sine": {"color": format_hex(VERMILION), "linestyle": (0, (5, 1.5))},
}
TALL, LOW = 2.6, 1.2
"""Heights of traces, and of the residuals below them [inch]."""
MEASURED_LOOK: dict[str, Any] = {"color": "black", "linewidth": 2.6, "alpha": 0.35}


def make_sample_picture(
    sample: SampleEstimate, traces: SampleTraces, hits: Sequence[AlignedHit]
) -> Picture:
    """Draw the traces of one sample, hammer and sample apart, residuals below.

    Parameters
    ----------
    sample : SampleEstimate
        The numbers.
    traces : SampleTraces
        Mean hit and models.
    hits : sequence of AlignedHit
        Those of the mean.
    """
    numbers = [
        f"{item.sample_symbol} {item.format(item.read(sample))} {item.unit}"
        for item in SAMPLE_MEASURANDS
        if item.read(sample).is_known
    ]
    return make_picture(
        f"{sample.name}: {', '.join(numbers)}",
        "Thin lines: the hits; bold: their mean; shaded: the contact, τp long; w50: the width at"
        " half amplitude; U1, U2: the peaks of the log decrement. Time counts from the middle of"
        " the hammer pulse. Below: measured less model, each model in its colour and dashes.",
        [partial(draw_channel, traces, hits, channel) for channel in range(len(traces.mean))],
    )


def draw_sample(
    traces: SampleTraces, hits: Sequence[AlignedHit], curves: LawCurves | None
) -> "Figure":
    """Draw what the two pictures show of one sample into a figure of pyplot, and return it.

    Above hammer and sample with their models and residuals, below the law of the contact.
    """
    from matplotlib import pyplot as plt

    rows = [[partial(draw_channel, traces, hits, channel) for channel in range(len(traces.mean))]]
    if curves is not None:
        rows.append([partial(draw_law_pulse, curves), partial(draw_law_loop, curves)])
    columns = max(map(len, rows))
    heights = [TALL + LOW * bool(traces.models), TALL + LOW][: len(rows)]
    # Before the style, whose end would undo what the first figure sets up: notebooks show it.
    figure = plt.figure(figsize=(columns * WIDTH, sum(heights)))
    with drawing_style():
        parts = figure.subfigures(len(rows), columns, squeeze=False, height_ratios=heights)
        for row, panels in zip(parts, rows, strict=True):
            for part, draw in zip(row, panels, strict=False):
                draw(make_panel=partial(fill_panel, part))
    return figure


def draw_channel(
    traces: SampleTraces,
    hits: Sequence[AlignedHit],
    channel: int,
    make_panel: MakePanel = reuse_panel,
) -> "Figure":
    """Draw traces above and residuals below, on one time axis."""
    panel: Figure = make_panel(TALL, *[LOW] * bool(traces.models))
    upper, lower = panel.axes[0], panel.axes[-1]
    start = -1.2 * traces.contact_time
    stop = np.nanmax([4.0 * traces.contact_time, 1.2 * traces.second_peak_time])

    def plot(axes: "Axes", time: np.ndarray, values: np.ndarray, **look: Any) -> None:
        shown = (time >= start) & (time <= stop)
        axes.plot(MICRO * time[shown], values[shown], **look)

    for place, hit in enumerate(hits):
        label = "" if place else format_count(len(hits), "hit")
        look = {"color": "black", "linewidth": 0.7, "alpha": 0.3, "label": label}
        plot(upper, hit.time, hit.traces[channel], **look)
    plot(upper, traces.time, traces.mean[channel], color="black", linewidth=1.6, label="mean")
    for model in traces.models:
        look = LOOKS[model.model]
        error = format_error(model.mse_percent[channel])
        label = f"{MODEL_NAMES[model.model]}, MSE {error} %"
        plot(upper, traces.time, model.traces[channel], **look, label=label)
        plot(lower, traces.time, traces.compute_residual(model)[channel], **look)
    half = 0.5 * MICRO * traces.contact_time
    for axes in panel.axes:
        axes.axvspan(-half, half, color=format_hex(GREEN), alpha=0.13, linewidth=0.0)
    _mark_points(upper, traces, channel)
    upper.set(title=TITLES[channel], ylabel="acceleration [m/s²]")
    if traces.models:
        lower.set_ylabel("residual [m/s²]")
    lower.set_xlabel("time from the middle of the hammer pulse [µs]")
    panel.legend(loc="lower center", ncols=2)
    return panel


def _mark_points(axes: "Axes", traces: SampleTraces, channel: int) -> None:
    """Mark the width of the hammer pulse, and U1 and U2 of the sample."""
    points = traces.peak_points
    if channel == HAMMER:
        width = f"w50 {traces.half_amplitude_width * MICRO:.1f} µs"
        names = ("", width)
        ends = zip(names, traces.half_amplitude_points, strict=False)
        points = tuple((name, time, level) for name, (time, level) in ends)
    for name, time, level in points:
        axes.plot([MICRO * time], [level], "o", color="black", markerfacecolor="none")
        axes.annotate(name, (MICRO * time, level), (5.0, 3.0), textcoords="offset points")


def make_law_picture(sample: SampleEstimate, curves: LawCurves) -> Picture:
    """Draw pulse, residuals and force-indentation loop of one contact."""
    law = sample.contact_law
    exponent, restitution = format_quantity(law.exponent, 3), format_quantity(law.restitution, 3)
    return make_picture(
        f"{sample.name}: contact law, n = {exponent}, e = {restitution}",
        "Law and versed-sine are filtered like the measured pulse; the versed-sine has its height"
        " and lasts τp. The measured loop follows from both traces and the law's impact speed; its"
        " area is the energy lost.",
        [partial(draw_law_pulse, curves), partial(draw_law_loop, curves)],
    )


def draw_law_pulse(curves: LawCurves, make_panel: MakePanel = reuse_panel) -> "Figure":
    """Draw force over time, and below the residuals of law and versed-sine."""
    panel: Figure = make_panel(TALL, LOW)
    forces, residuals = panel.axes
    time = curves.time * MICRO
    forces.plot(time, curves.measured, **MEASURED_LOOK, label="mean")
    for name, force in (("law", curves.law), ("versed-sine", curves.versed_sine)):
        forces.plot(time, force, **LAW_LOOKS[name], label=name)
        residuals.plot(time, curves.measured - force, **LAW_LOOKS[name])
    forces.set(title="a) pulse", ylabel="force [N]")
    residuals.set(xlabel="time from the middle of the hammer pulse [µs]", ylabel="residual [N]")
    panel.legend(loc="lower center", ncols=3)
    return panel


def draw_law_loop(curves: LawCurves, make_panel: MakePanel = reuse_panel) -> "Figure":
    """Draw force over indentation."""
    panel: Figure = make_panel(TALL + LOW)
    (axes,) = panel.axes
    if curves.indentation.size:
        indentation = curves.indentation * MICRO
        axes.plot(indentation, curves.loop_force, **MEASURED_LOOK, label="from both traces")
    axes.plot(curves.law_indentation * MICRO, curves.law_force, **LAW_LOOKS["law"], label="law")
    axes.set(title="b) force over indentation", xlabel="indentation [µm]", ylabel="force [N]")
    panel.legend(loc="lower center", ncols=2)
    return panel
