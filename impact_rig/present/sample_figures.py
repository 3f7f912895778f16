"""One sample: its hits, their mean and the models; the law of its contact."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from impact_rig.core.given.records import FloatArray
from impact_rig.present.picture import (
    TOP,
    WIDTH,
    Picture,
    drawing_style,
    fill_panel,
    make_picture,
    reuse_panel,
)
from impact_rig.results.numbers import MICRO, format_error
from impact_rig.results.palette import BLUE, GREEN, PURPLE, VERMILION, format_hex
from impact_rig.results.traces import DRIVEN, PRINTED, AlignedHit, LawCurves, SampleTraces

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

HAMMER = 0
MakePanel = Callable[..., Any]
"""Makes a panel with axes of these heights, as `reuse_panel` does."""
TITLES = ("a) hammer", "b) sample")
LONGEST = 8.0
"""Largest time of a figure [contact times], our choice: the pulse is a tenth of its width then."""
MODEL_NAMES = {DRIVEN: "force-driven model", PRINTED: "model as printed"}
LOOKS: dict[str, dict[str, Any]] = {
    DRIVEN: {"color": format_hex(VERMILION), "linestyle": (0, (5, 1.5))},
    PRINTED: {"color": format_hex(PURPLE), "linestyle": (0, (5, 1.5, 1, 1.5))},
}
LAW_LOOK: dict[str, Any] = {"color": format_hex(BLUE), "linestyle": (0, (1, 1))}
HIT_LOOK: dict[str, Any] = {"color": "0.6", "linewidth": 0.7}
MEAN_LOOK: dict[str, Any] = {"color": "black", "linewidth": 1.6}
LOOP_LOOK: dict[str, Any] = {"color": "0.65", "linewidth": 2.6}
TALL, LOW, BOTTOM = 1.1, 0.45, 0.5
"""Heights of traces, of the residuals below them, and below both without a legend [inch]."""
KEY = 0.4
"""Height of the legend of all figures [inch]."""


def _explain(samples: Sequence[SampleTraces], *, has_law: bool) -> str:
    """Return how to read the figures of samples, as far as they show it."""
    has_model = any(traces.models for traces in samples)
    has_peaks = any(traces.peak_points for traces in samples)
    loop = (
        " Force over indentation follows from both traces and the law's impact speed; the loop's"
        " area is the energy lost."
    )
    return (
        "In each figure, shaded: the contact, τp long; w50: the width at half amplitude"
        + "; U1, U2: the peaks of the log decrement" * has_peaks
        + "; MSE: of the models in the order above, as in Fig. 6" * has_model
        + ". Time counts from the middle of the hammer pulse."
        + " Below: measured less model." * (has_model or has_law)
        + loop * has_law
    )


def make_key_picture(samples: Sequence[SampleTraces], *, has_law: bool) -> Picture:
    """Return the legend of all figures of samples, drawn once, with how to read them."""
    from matplotlib.figure import Figure

    panel = Figure(figsize=(WIDTH, KEY))
    panel.legend(handles=list_lines(samples, has_law=has_law), loc="center left", ncols=3)
    return make_picture("Lines of all figures", _explain(samples, has_law=has_law), [panel])


def list_lines(samples: Iterable[SampleTraces], *, has_law: bool) -> "list[Line2D]":
    """Return a line with a name for each look in the figures of these samples."""
    from matplotlib.lines import Line2D

    models = {model.model for traces in samples for model in traces.models}
    named = {"hits": HIT_LOOK, "mean hit": MEAN_LOOK}
    named |= {MODEL_NAMES[model]: look for model, look in LOOKS.items() if model in models}
    if has_law:
        named |= {"contact law": LAW_LOOK, "force from both traces": LOOP_LOOK}
    return [Line2D([], [], **look, label=name) for name, look in named.items()]


def make_sample_picture(
    traces: SampleTraces, hits: Sequence[AlignedHit], curves: LawCurves | None
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
    """
    return make_picture(traces.name, "", (draw() for draw in _list_panels(traces, hits, curves)))


def _list_panels(
    traces: SampleTraces, hits: Sequence[AlignedHit], curves: LawCurves | None
) -> "list[partial[Figure]]":
    """Return what draws each panel; it takes what makes one, as `reuse_panel`."""
    channels = range(len(traces.mean))
    panels = [partial(draw_channel, traces, hits, curves, channel) for channel in channels]
    if curves is not None and curves.indentation.size:
        panels.append(partial(draw_law_loop, curves))
    return panels


def leave_out_printed(traces: SampleTraces) -> SampleTraces:
    """Return traces without the model as printed, where the driven one is nearer to the sample."""
    driven, printed = traces.find_model(DRIVEN), traces.find_model(PRINTED)
    if driven is None or printed is None or printed.mse_percent[-1] < driven.mse_percent[-1]:
        return traces
    return replace(traces, models=tuple(item for item in traces.models if item is not printed))


def draw_sample(
    traces: SampleTraces, hits: Sequence[AlignedHit], curves: LawCurves | None
) -> "Figure":
    """Draw the traces of one sample into a figure of pyplot, and return it.

    Panels stand beside each other, over a legend of all.
    """
    from matplotlib import pyplot as plt

    panels = _list_panels(traces, hits, curves)
    height = TALL + LOW + TOP + BOTTOM
    # Before the style, whose end would undo what the first figure sets up: notebooks show it.
    figure = plt.figure(figsize=(len(panels) * WIDTH, height + KEY))
    with drawing_style():
        parts = figure.subfigures(2, len(panels), squeeze=False, height_ratios=(height, KEY))
        for part, draw in zip(parts[0], panels, strict=True):
            draw(make_panel=partial(fill_panel, part))
        lines = list_lines([traces], has_law=curves is not None)
        figure.legend(handles=lines, loc="lower center", ncols=len(lines))
    return figure


def draw_into(
    axes: "Axes", traces: SampleTraces, hits: Sequence[AlignedHit], curves: LawCurves | None
) -> "Figure":
    """Draw the hammer's traces into axes of a person's own; residuals are left out."""
    from matplotlib.figure import Figure

    spare = Figure().subplots()
    panel = SimpleNamespace(axes=[axes, spare])
    draw_channel(traces, hits, curves, HAMMER, lambda *_, **__: panel)
    axes.set_xlabel(spare.get_xlabel())
    return axes.get_figure(root=True)  # type: ignore[return-value]


def draw_channel(
    traces: SampleTraces,
    hits: Sequence[AlignedHit],
    curves: LawCurves | None,
    channel: int,
    make_panel: MakePanel = reuse_panel,
) -> "Figure":
    """Draw traces above and residuals below, on one time axis; the law on the hammer's."""
    law = curves if channel == HAMMER else None
    has_models = bool(traces.models) or law is not None
    panel: Figure = make_panel(*((TALL, LOW) if has_models else (TALL + LOW,)), bottom=BOTTOM)
    upper, lower = panel.axes[0], panel.axes[-1]
    start = -1.2 * traces.contact_time
    stop = _find_stop(traces)

    def cut(time: FloatArray, values: FloatArray) -> FloatArray:
        shown = (time >= start) & (time <= stop)
        return np.stack((MICRO * time[shown], values[shown]))

    def plot(axes: "Axes", time: FloatArray, values: FloatArray, **look: Any) -> None:
        axes.plot(*cut(time, values), **look)

    if hits:
        # One line with gaps, since each line takes time.
        gap = [[np.nan], [np.nan]]
        parts = [np.hstack((cut(hit.time, hit.traces[channel]), gap)) for hit in hits]
        upper.plot(*np.hstack(parts), **HIT_LOOK)
    plot(upper, traces.time, traces.mean[channel], **MEAN_LOOK)
    for model in traces.models:
        plot(upper, traces.time, model.traces[channel], **LOOKS[model.model])
        plot(lower, traces.time, traces.compute_residual(model)[channel], **LOOKS[model.model])
    if law is not None:
        plot(upper, law.time, law.acceleration, **LAW_LOOK)
        measured = np.interp(law.time, traces.time, traces.mean[HAMMER])
        plot(lower, law.time, measured - law.acceleration, **LAW_LOOK)
    half = 0.5 * MICRO * traces.contact_time
    for axes in panel.axes:
        axes.axvspan(-half, half, color=format_hex(GREEN), alpha=0.13, linewidth=0.0)
    _mark_points(upper, traces, channel)
    errors = [f"{format_error(model.mse_percent[channel])} %" for model in traces.models]
    title = TITLES[channel] + f", MSE {' and '.join(errors)}" * bool(errors)
    upper.set(title=title, ylabel="a [m/s²]")
    if has_models:
        lower.set_ylabel("residual", fontsize="small")
        lower.tick_params(axis="y", labelsize="small")
    lower.set_xlabel("time from the middle of the hammer pulse [µs]")
    return panel


def _find_stop(traces: SampleTraces) -> float:
    """Return where a figure ends [s]: behind the second peak, if the pulse stays in sight."""
    wanted = np.nanmax([4.0 * traces.contact_time, 1.2 * traces.second_peak_time])
    return min(float(wanted), LONGEST * traces.contact_time)


def _mark_points(axes: "Axes", traces: SampleTraces, channel: int) -> None:
    """Mark the width of the hammer pulse, and U1 and U2 of the sample."""
    points = traces.peak_points
    if channel == HAMMER:
        width = f"w50 {traces.half_amplitude_width * MICRO:.1f} µs"
        names = ("", width)
        ends = zip(names, traces.half_amplitude_points, strict=False)
        points = tuple((name, time, level) for name, (time, level) in ends)
    points = tuple(point for point in points if not point[1] > _find_stop(traces))
    for name, time, level in points:
        axes.plot([MICRO * time], [level], "o", color="black", markerfacecolor="none")
        axes.annotate(name, (MICRO * time, level), (5.0, 3.0), textcoords="offset points")


def draw_law_loop(curves: LawCurves, make_panel: MakePanel = reuse_panel) -> "Figure":
    """Draw force over indentation."""
    panel: Figure = make_panel(TALL + LOW, bottom=BOTTOM)
    (axes,) = panel.axes
    axes.plot(curves.indentation * MICRO, curves.loop_force, **LOOP_LOOK)
    axes.plot(curves.law_indentation * MICRO, curves.law_force, **LAW_LOOK)
    axes.set(title="c) force over indentation", xlabel="indentation [µm]", ylabel="force [N]")
    return panel
