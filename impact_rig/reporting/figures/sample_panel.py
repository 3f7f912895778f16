"""One channel of one sample: hits, mean and models, and what the models leave."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from impact_rig.core.signals.record import FloatArray
from impact_rig.reporting.figures.decimation import (
    cut_trace,
    decimate_trace,
    find_fading_time,
    find_peak,
)
from impact_rig.reporting.figures.panel import make_panel
from impact_rig.reporting.figures.style import (
    INK,
)
from impact_rig.reporting.figures.words import format_count, format_percent
from impact_rig.results.numbers import MICRO
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
COLUMNS = 280
"""Of a trace [-]: one for each point of the axes' width."""
HIT_COLUMNS = 130
"""Of a hit's trace [-], our choice: ten hits weigh as much as the other traces together."""
FADED = 0.01
"""Part of the peak below which a trace has faded [-], our choice."""
PULSE_WIDTHS_BEFORE = 1.2
PULSE_WIDTHS_AFTER = 2.0
"""What is shown at least, before and after the middle of the pulse [tau_p], our choice."""
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


@dataclass(frozen=True)
class Scene:
    """What a panel shows: a channel of everything, between two times [us]."""

    channel: int
    start: float
    stop: float
    traces: SampleTraces
    hits: tuple[AlignedHit, ...]

    def thin(
        self, time: FloatArray, values: FloatArray, columns: int = COLUMNS
    ) -> tuple[FloatArray, FloatArray]:
        """Return the points that are drawn; `time` in seconds, theirs in microseconds."""
        points = cut_trace(time * MICRO, values, self.start, self.stop)
        return decimate_trace(*points, columns)


def make_scene(traces: SampleTraces, hits: Sequence[AlignedHit], channel: int) -> Scene:
    """Choose the times between which there is something to see, in either channel."""
    faded = find_fading_time(traces.time, traces.mean, FADED)
    start = max(-PULSE_WIDTHS_BEFORE * traces.contact_time, traces.time[0])
    stop = min(max(PULSE_WIDTHS_AFTER * traces.contact_time, faded), traces.time[-1])
    return Scene(channel, start * MICRO, stop * MICRO, traces, tuple(hits))


def draw_sample_panel(scene: Scene) -> "Figure":
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
    rows[0].set_title(TITLES[scene.channel])
    rows[0].margins(y=ROOM)
    rows[0].set_ylabel("acceleration [m/s²]")
    if has_models:
        _draw_residuals(rows[1], scene)
        rows[1].set_ylabel("residual [m/s²]")
    rows[-1].set_xlim(scene.start, scene.stop)
    rows[-1].set_xlabel("time from the middle of the hammer pulse [µs]")
    return panel


def _draw_traces(axes: "Axes", scene: Scene) -> None:
    for place, hit in enumerate(scene.hits):
        points = scene.thin(hit.time, hit.traces[scene.channel], HIT_COLUMNS)
        axes.plot(*points, **HIT_LOOK, gid=f"hit-{place}")
    axes.plot(
        *scene.thin(scene.traces.time, scene.traces.mean[scene.channel]), **MEAN_LOOK, gid="mean-1"
    )
    for model in scene.traces.models:
        axes.plot(
            *scene.thin(scene.traces.time, model.traces[scene.channel]),
            **LOOKS[model.model],
            gid=f"model-{model.model}",
        )


def _draw_marks(axes: "Axes", scene: Scene) -> None:
    """Mark what was read from the mean: the width of the hammer pulse, U1 and U2 of the sample."""
    traces = scene.traces
    mean = traces.mean[scene.channel]
    if scene.channel == HAMMER:
        half = 0.5 * traces.half_amplitude_width
        level = 0.5 * find_peak(mean)
        times = np.array([-half, half]) * MICRO
        axes.plot(times, [level, level], color=INK, linewidth=0.8, **POINT_LOOK, gid="width-1")
        width = f"w50 {2.0 * half * MICRO:.1f} µs"
        axes.annotate(width, (times[1], level), **LABEL_PLACE, va="center")
        return
    for label, time in (("U1", traces.first_peak_time), ("U2", traces.second_peak_time)):
        if not math.isfinite(time):
            continue
        place = int(
            np.clip(np.rint((time - traces.start_time) * traces.sampling_rate), 0, mean.size - 1)
        )
        point = (time * MICRO, mean[place])
        axes.plot(
            *([value] for value in point), color=INK, **POINT_LOOK, gid=f"peak-{label.lower()}"
        )
        axes.annotate(label, point, **LABEL_PLACE, va="bottom" if mean[place] >= 0.0 else "top")


def _draw_residuals(axes: "Axes", scene: Scene) -> None:
    axes.axhline(0.0, color=INK, linewidth=0.8, alpha=0.5)
    for model in scene.traces.models:
        residual = scene.traces.find_residual(model)[scene.channel]
        axes.plot(
            *scene.thin(scene.traces.time, residual),
            **{**LOOKS[model.model], "linewidth": 1.2},
            gid=f"residual-{model.model}",
        )


def _make_legend(scene: Scene) -> "list[list[Artist]]":
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    count = len(scene.hits)
    measured: list[Artist] = [Line2D([], [], **MEAN_LOOK, label="mean")]
    if count:
        measured.insert(0, Line2D([], [], **HIT_LOOK, label=format_count(count, "hit")))
    measured.append(Patch(color=CONTACT_COLOUR, alpha=0.25, label="contact τp"))
    models: list[Artist] = [
        Line2D([], [], **LOOKS[model.model], label=_name_model(model, scene.channel))
        for model in scene.traces.models
    ]
    return [measured, models] if models else [measured]


def _name_model(model: ModelTraces, channel: int) -> str:
    mse = model.mse_hammer_percent if channel == HAMMER else model.mse_sample_percent
    return f"{MODEL_NAMES[model.model]}, MSE {format_percent(mse)}"
