"""One sample: its hits, their mean, the models, and what the models leave."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.signals.record import FloatArray
from impact_rig.present.figures.markup import ReportFigure, make_figure, make_name
from impact_rig.present.figures.panels import INK, make_handle, make_panel
from impact_rig.present.figures.trace_span import choose_span, cut_trace
from impact_rig.results.comparison import SAMPLE_MEASURANDS
from impact_rig.results.numbers import MICRO, format_count, format_percent
from impact_rig.results.palette import BLUE, GREEN, PURPLE, VERMILION, format_hex
from impact_rig.results.sample_traces import (
    DRIVEN,
    IDENTIFIED,
    PRINTED,
    AlignedHit,
    ModelTraces,
    SampleTraces,
)

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HEIGHTS = (140.0, 68.0)
"""Of the axes of traces and of residuals [pt]."""
FADED = 0.01
"""Part of the peak below which a trace has faded [-], our choice."""
HAMMER = 0
TITLES = ("a) hammer", "b) sample")
"""Of the channels."""
ROOM = 0.09
"""Above and below the traces [part of the axis]: for the names of peaks."""
CONTACT_COLOUR = format_hex(GREEN)
LOOKS: dict[str, dict[str, Any]] = {
    DRIVEN: {"color": format_hex(VERMILION), "linestyle": (0, (5, 1.5))},
    PRINTED: {"color": format_hex(PURPLE), "linestyle": (0, (5, 1.5, 1, 1.5))},
    IDENTIFIED: {"color": format_hex(BLUE), "linestyle": (0, (1.5, 1.2)), "linewidth": 1.8},
}
HIT_LOOK: dict[str, Any] = {"color": INK, "linewidth": 0.7, "alpha": 0.3}
MEAN_LOOK: dict[str, Any] = {"color": INK, "linewidth": 1.6}
POINT_LOOK: dict[str, Any] = {"marker": "o", "markersize": 4.5, "markerfacecolor": "none"}
LABEL_PLACE: dict[str, Any] = {"xytext": (5.0, 0.0), "textcoords": "offset points"}
MODEL_NAMES = {
    DRIVEN: "force-driven model",
    PRINTED: "model as printed",
    IDENTIFIED: "identified model",
}


def draw_sample_figure(
    sample: SampleEstimate, traces: SampleTraces, hits: Sequence[AlignedHit]
) -> ReportFigure:
    """Draw the traces of one sample, hammer and sample apart, residuals below.

    Parameters
    ----------
    sample : SampleEstimate
        The numbers.
    traces : SampleTraces
        Mean hit and models.
    hits : sequence of AlignedHit
        Those of the mean; hits of other samples are left out.

    Returns
    -------
    ReportFigure
        With the sample's tau_p, k2 and c2 in its title.
    """
    own = tuple(hit for hit in hits if hit.label.sample == traces.name)
    numbers = ", ".join(_list_numbers(sample))
    return make_figure(
        make_name("sample", traces.name),
        f"{sample.name}: {numbers}",
        lambda: [_draw_channel(_make_scene(traces, own, row)) for row in range(len(traces.mean))],
        _describe(sample, traces, len(own)),
        _explain(traces),
    )


def _list_numbers(sample: SampleEstimate) -> list[str]:
    """Return tau_p, k2 and c2 with their 95 % intervals, those that are known."""
    return [
        f"{item.sample_symbol} {item.format(item.read(sample))} {item.unit}"
        for item in SAMPLE_MEASURANDS
        if item.read(sample).is_known
    ]


def _describe(sample: SampleEstimate, traces: SampleTraces, hits: int) -> str:
    text = (
        f"Acceleration of hammer and sample over time for {sample.name}:"
        f" {format_count(hits, 'hit')} and their mean,"
        f" {', '.join(_list_numbers(sample))}."
    )
    peaks = [
        f"{peak:.0f} m/s² at the {whose}"
        for whose, peak in (
            ("hammer", sample.hammer_peak),
            ("sample", sample.specimen_peak),
        )
        if math.isfinite(peak)
    ]
    if peaks:
        text += f" The mean reaches {' and '.join(peaks)}."
    return text + "".join(
        f" Mean square error of the {MODEL_NAMES[model.model]}: hammer"
        f" {format_percent(model.mse_hammer_percent)}, sample"
        f" {format_percent(model.mse_sample_percent)}."
        for model in traces.models
    )


def _explain(traces: SampleTraces) -> str:
    text = (
        "Thin lines: the hits; bold: their mean; shaded: the contact, τp long; w50: the width at"
        " half amplitude. Time counts from the middle of the hammer pulse."
    )
    if math.isfinite(traces.first_peak_time) and math.isfinite(traces.second_peak_time):
        text += " U1, U2: the peaks of the log decrement."
    if traces.models:
        return text + " Below: measured less model, each model in its colour and dashes."
    return text + " No model could be laid over this sample."


@dataclass(frozen=True)
class _Scene:
    """What a panel shows: a channel of everything, between two times [us]."""

    channel: int
    start: float
    stop: float
    traces: SampleTraces
    hits: tuple[AlignedHit, ...]

    def cut(self, time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the points that are shown; `time` in seconds, theirs in microseconds."""
        return cut_trace(time * MICRO, values, self.start, self.stop)


def _make_scene(traces: SampleTraces, hits: Sequence[AlignedHit], channel: int) -> _Scene:
    """Choose the times between which there is something to see, in either channel."""
    start, stop = choose_span([traces], slice(None), FADED)
    return _Scene(channel, start * MICRO, stop * MICRO, traces, tuple(hits))


def _draw_channel(scene: _Scene) -> "Figure":
    """Draw traces above and residuals below, on one time axis; call it in `drawing_style`."""
    columns = _make_legend(scene)
    has_models = bool(scene.traces.models)
    panel = make_panel(HEIGHTS[: 1 + has_models], columns)
    rows = panel.axes
    for axes in rows:
        half = 0.5 * scene.traces.contact_time * MICRO
        axes.axvspan(-half, half, color=CONTACT_COLOUR, alpha=0.13, linewidth=0.0)
    _draw_traces(rows[0], scene)
    _draw_marks(rows[0], scene)
    rows[0].margins(y=ROOM)
    rows[0].set(title=TITLES[scene.channel], ylabel="acceleration [m/s²]")
    if has_models:
        _draw_residuals(rows[1], scene)
        rows[1].set_ylabel("residual [m/s²]")
    rows[-1].set_xlim(scene.start, scene.stop)
    rows[-1].set_xlabel("time from the middle of the hammer pulse [µs]")
    return panel


def _draw_traces(axes: "Axes", scene: _Scene) -> None:
    for place, hit in enumerate(scene.hits):
        points = scene.cut(hit.time, hit.traces[scene.channel])
        axes.plot(*points, **HIT_LOOK, gid=f"hit-{place}")
    axes.plot(
        *scene.cut(scene.traces.time, scene.traces.mean[scene.channel]), **MEAN_LOOK, gid="mean-1"
    )
    for model in scene.traces.models:
        axes.plot(
            *scene.cut(scene.traces.time, model.traces[scene.channel]),
            **LOOKS[model.model],
            gid=f"model-{model.model}",
        )


def _draw_marks(axes: "Axes", scene: _Scene) -> None:
    """Mark what was read from the mean: the width of the hammer pulse, U1 and U2 of the sample."""
    traces = scene.traces
    if scene.channel == HAMMER:
        points = traces.half_amplitude_points
        times, levels = [time * MICRO for time, _ in points], [level for _, level in points]
        axes.plot(times, levels, color=INK, linewidth=0.8, **POINT_LOOK, gid="width-1")
        if points:
            width = f"w50 {traces.half_amplitude_width * MICRO:.1f} µs"
            axes.annotate(width, (times[1], levels[1]), **LABEL_PLACE, va="center")
        return
    for label, time, height in traces.peak_points:
        point = (time * MICRO, height)
        place = [[value] for value in point]
        axes.plot(*place, color=INK, **POINT_LOOK, gid=f"peak-{label.lower()}")
        axes.annotate(label, point, **LABEL_PLACE, va="bottom" if height >= 0.0 else "top")


def _draw_residuals(axes: "Axes", scene: _Scene) -> None:
    axes.axhline(0.0, color=INK, linewidth=0.8, alpha=0.5)
    for model in scene.traces.models:
        residual = scene.traces.compute_residual(model)[scene.channel]
        axes.plot(
            *scene.cut(scene.traces.time, residual),
            **{**LOOKS[model.model], "linewidth": 1.2},
            gid=f"residual-{model.model}",
        )


def _make_legend(scene: _Scene) -> "list[list[Artist]]":
    from matplotlib.patches import Patch

    count = len(scene.hits)
    measured: list[Artist] = [make_handle("mean", **MEAN_LOOK)]
    if count:
        measured.insert(0, make_handle(format_count(count, "hit"), **HIT_LOOK))
    measured.append(Patch(color=CONTACT_COLOUR, alpha=0.25, label="contact τp"))
    models: list[Artist] = [
        make_handle(_name_model(model, scene.channel), **LOOKS[model.model])
        for model in scene.traces.models
    ]
    return [measured, models] if models else [measured]


def _name_model(model: ModelTraces, channel: int) -> str:
    return f"{MODEL_NAMES[model.model]}, MSE {format_percent(model.mse_percent[channel])}"
