"""One sample: its hits, their mean and the models; the law of its contact."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

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
    format_count,
    format_error,
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
LAW_LOOK: dict[str, Any] = {"color": format_hex(BLUE), "linestyle": (0, (1, 1))}
TALL, LOW = 2.2, 0.8
"""Heights of traces, and of the residuals below them [inch]."""
MEASURED_LOOK: dict[str, Any] = {"color": "black", "linewidth": 2.6, "alpha": 0.35}


SAMPLE_CAPTION = (
    "In each figure, thin lines: the hits; bold: their mean; shaded: the contact, τp long; w50:"
    " the width at half amplitude; U1, U2: the peaks of the log decrement. Time counts from the"
    " middle of the hammer pulse. Below: measured less model, in its colour and dashes."
)
LOOP_CAPTION = (
    " Force over indentation follows from both traces and the law's impact speed; the loop's area"
    " is the energy lost."
)


def make_sample_picture(
    traces: SampleTraces,
    hits: Sequence[AlignedHit],
    curves: LawCurves | None,
    *,
    with_printed: bool,
) -> Picture:
    """Draw the traces of one sample, hammer and sample apart, and the loop of its law.

    Parameters
    ----------
    traces : SampleTraces
        Mean hit and models.
    hits : sequence of AlignedHit
        Those of the mean.
    curves : LawCurves or None
        Of the contact law; None: there is none.
    with_printed : bool
        Whether the model as printed is drawn even where the driven one is nearer to the sample.
    """
    if not with_printed:
        traces = _leave_out_printed(traces)
    panels = [
        partial(draw_channel, traces, hits, channel, curves=curves)
        for channel in range(len(traces.mean))
    ]
    if curves is not None and curves.indentation.size:
        panels.append(partial(draw_law_loop, curves))
    return make_picture(traces.name, "", panels)


def _leave_out_printed(traces: SampleTraces) -> SampleTraces:
    """Return traces without the model as printed, where the driven one is nearer to the sample."""
    driven, printed = traces.find_model(DRIVEN), traces.find_model(PRINTED)
    if driven is None or printed is None or printed.mse_percent[-1] < driven.mse_percent[-1]:
        return traces
    return replace(traces, models=tuple(item for item in traces.models if item is not printed))


def draw_sample(
    traces: SampleTraces, hits: Sequence[AlignedHit], curves: LawCurves | None
) -> "Figure":
    """Draw the traces of one sample into a figure of pyplot, and return it.

    Above hammer and sample with their models and residuals, below the loop of the contact.
    """
    from matplotlib import pyplot as plt

    draw = partial(draw_channel, traces, hits, curves=curves)
    rows = [[partial(draw, channel) for channel in range(len(traces.mean))]]
    if curves is not None:
        rows.append([partial(draw_law_loop, curves)])
    columns = max(map(len, rows))
    # Before the style, whose end would undo what the first figure sets up: notebooks show it.
    figure = plt.figure(figsize=(columns * WIDTH, len(rows) * (TALL + LOW)))
    with drawing_style():
        parts = figure.subfigures(len(rows), columns, squeeze=False)
        for row, panels in zip(parts, rows, strict=True):
            for part, draw in zip(row, panels, strict=False):
                draw(make_panel=partial(fill_panel, part))
    return figure


def draw_channel(
    traces: SampleTraces,
    hits: Sequence[AlignedHit],
    channel: int,
    make_panel: MakePanel = reuse_panel,
    curves: LawCurves | None = None,
) -> "Figure":
    """Draw traces above and residuals below, on one time axis; the law on the hammer's."""
    law = curves if channel == HAMMER else None
    has_models = bool(traces.models) or law is not None
    panel: Figure = make_panel(*((TALL, LOW) if has_models else (TALL + LOW,)))
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
    if law is not None:
        plot(upper, law.time, law.acceleration, **LAW_LOOK, label="contact law")
        measured = np.interp(law.time, traces.time, traces.mean[HAMMER])
        plot(lower, law.time, measured - law.acceleration, **LAW_LOOK)
    half = 0.5 * MICRO * traces.contact_time
    for axes in panel.axes:
        axes.axvspan(-half, half, color=format_hex(GREEN), alpha=0.13, linewidth=0.0)
    _mark_points(upper, traces, channel)
    upper.set(title=TITLES[channel], ylabel="a [m/s²]")
    if has_models:
        lower.set_ylabel("residual", fontsize="small")
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


def draw_law_loop(curves: LawCurves, make_panel: MakePanel = reuse_panel) -> "Figure":
    """Draw force over indentation."""
    panel: Figure = make_panel(TALL + LOW)
    (axes,) = panel.axes
    if curves.indentation.size:
        indentation = curves.indentation * MICRO
        axes.plot(indentation, curves.loop_force, **MEASURED_LOOK, label="from both traces")
    axes.plot(curves.law_indentation * MICRO, curves.law_force, **LAW_LOOK, label="law")
    axes.set(title="c) force over indentation", xlabel="indentation [µm]", ylabel="force [N]")
    panel.legend(loc="lower center", ncols=2)
    return panel
