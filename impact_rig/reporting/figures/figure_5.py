"""Fig. 5: model and measured response, normalised and shifted onto each other."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from impact_rig.reporting.figures.decimation import (
    cut_trace,
    decimate_trace,
    find_fading_time,
    find_peak,
)
from impact_rig.reporting.figures.figure import ReportFigure, make_missing_figure
from impact_rig.reporting.figures.names import make_name, shorten_name
from impact_rig.reporting.figures.panel import make_panel
from impact_rig.reporting.figures.style import (
    INK,
    drawing_style,
)
from impact_rig.reporting.figures.vector import render_panels
from impact_rig.reporting.figures.words import format_percent
from impact_rig.results.figure_rows import sort_as_figure_5
from impact_rig.results.numbers import MICRO
from impact_rig.results.palette import VERMILION, format_hex
from impact_rig.results.sample_traces import DRIVEN, ModelTraces, SampleTraces

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TITLE = "Fig. 5. Model and measured response"
CASES = 3
"""Samples that the paper shows [-]."""
CASE_HEIGHT = 90.0
"""Of one sample's axes [pt]."""
COLUMNS = 280
"""Of a trace [-]: one for each point of the axes' width."""
FADED = 0.02
"""Part of the peak below which a response has faded [-], our choice."""
PULSE_WIDTHS_BEFORE = 1.2
PULSE_WIDTHS_AFTER = 2.0
"""What is shown at least, before and after the middle of the pulse [tau_p], our choice."""
MODEL = "model"
MEASURED = "measured"
LOOKS: dict[str, dict[str, Any]] = {
    MODEL: {"color": format_hex(VERMILION), "linewidth": 1.6},
    MEASURED: {"color": INK, "linewidth": 1.0, "linestyle": (0, (4, 2))},
}
"""As in the paper: the model solid, the measurement dashed."""
PANELS = (("a) hammer", 0), ("b) samples", 1))
"""Title and channel."""
CAPTION = (
    "Solid: the force-driven model, with k and c by the paper's method; dashed: the mean hit, as"
    " in the paper. Both are normalised to their peak, and the model is shifted in time onto the"
    " measurement. MSE: mean square error over the record, as in Fig. 6."
)


def draw_figure_5(samples: Sequence[SampleTraces], *, prefix: str = "") -> ReportFigure:
    """Draw model and mean hit of the paper's three cases, or of the first three samples.

    Parameters
    ----------
    samples : sequence of SampleTraces
        All that there are.
    prefix : str
        Put before the figure's name.

    Returns
    -------
    ReportFigure
        Not drawn if no sample has both traces and the force-driven model.
    """
    name = make_name(prefix, "figure 5")
    cases = [
        (sample, model)
        for sample in samples
        if (model := sample.find_model(DRIVEN)) is not None and sample.mean.shape[0] > 1
    ]
    if not cases:
        reason = (
            "No sample has a model to lay over its mean hit."
            if samples
            else "There are no traces: a report of the recording has them."
        )
        return make_missing_figure(name, TITLE, reason)
    order = sort_as_figure_5(tuple(sample.name for sample, _ in cases))
    cases = sorted(cases, key=lambda case: order.index(case[0].name))[:CASES]
    with drawing_style():
        panels = [_draw_panel(title, cases, channel) for title, channel in PANELS]
        svg = render_panels(name, panels)
    return ReportFigure(name, TITLE, svg, _describe(cases), CAPTION)


def _draw_panel(
    title: str, cases: Sequence[tuple[SampleTraces, ModelTraces]], channel: int
) -> "Figure":
    from matplotlib.lines import Line2D

    legend = [[Line2D([], [], **look, label=kind)] for kind, look in LOOKS.items()]
    panel = make_panel([CASE_HEIGHT] * len(cases), legend)
    rows = panel.axes
    span = _find_span([sample for sample, _ in cases], channel)
    for place, (axes, (sample, model)) in enumerate(zip(rows, cases, strict=True)):
        _draw_case(axes, sample, model, channel, span, place)
    rows[0].set_xlim(*span)
    rows[0].set_title(title)
    rows[len(rows) // 2].set_ylabel("acceleration / peak")
    rows[-1].set_xlabel("time from the middle of the pulse [µs]")
    return panel


def _draw_case(
    axes: "Axes",
    sample: SampleTraces,
    model: ModelTraces,
    channel: int,
    span: tuple[float, float],
    place: int,
) -> None:
    peak = find_peak(sample.mean[channel]) or 1.0
    time = sample.time * MICRO
    for kind, trace in ((MODEL, model.traces[channel]), (MEASURED, sample.mean[channel])):
        points = decimate_trace(*cut_trace(time, trace / peak, *span), COLUMNS)
        axes.plot(*points, **LOOKS[kind], gid=f"{kind}-{place}")
    mse = (model.mse_hammer_percent, model.mse_sample_percent)[channel]
    axes.text(
        0.99,
        0.95,
        f"{shorten_name(sample.name)}\nMSE {format_percent(mse)}",
        transform=axes.transAxes,
        ha="right",
        va="top",
    )
    axes.set_yticks([-1, 0, 1])
    axes.margins(y=0.08)


def _find_span(samples: Sequence[SampleTraces], channel: int) -> tuple[float, float]:
    """Return from when to when there is something to see in any of the samples [us]."""
    longest = max(sample.contact_time for sample in samples)
    faded = max(
        find_fading_time(sample.time, sample.mean[channel : channel + 1], FADED)
        for sample in samples
    )
    last = min(sample.time[-1] for sample in samples)
    first = max(sample.time[0] for sample in samples)
    start = max(-PULSE_WIDTHS_BEFORE * longest, first)
    stop = min(max(PULSE_WIDTHS_AFTER * longest, faded), last)
    return start * MICRO, stop * MICRO


def _describe(cases: Sequence[tuple[SampleTraces, ModelTraces]]) -> str:
    parts = (
        f"{sample.name}: hammer {format_percent(model.mse_hammer_percent)},"
        f" sample {format_percent(model.mse_sample_percent)}"
        for sample, model in cases
    )
    return (
        "Normalised response of model and measurement, hammer and sample apart. Mean square"
        f" error: {'; '.join(parts)}."
    )
