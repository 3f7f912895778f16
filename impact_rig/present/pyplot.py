"""Draws panels by matplotlib, into a figure of pyplot: for notebooks and for other formats."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from impact_rig.present.picture import WIDTH, Curve, Panel
from impact_rig.results.palette import GREEN, format_hex

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STYLE: dict[Any, Any] = {
    "text.parse_math": False,  # a sample may be called "$x$"
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlelocation": "left",
    "axes.titlesize": "medium",
    "figure.constrained_layout.use": True,
    "grid.alpha": 0.2,
    "legend.fontsize": "small",
    "legend.frameon": False,
}
POINTS_PER_INCH = 72.0
BORDER = 90.0  # [pt] of a panel, for titles, labels and legend


def draw_figure(rows: Sequence[Sequence[Panel]]) -> "Figure":
    """Return a figure with rows of panels, in our style whatever the user's settings are."""
    import matplotlib as mpl
    from matplotlib import pyplot as plt

    heights = [BORDER + sum(plot.height for plot in row[0].plots) for row in rows]
    columns = max(map(len, rows))
    size = columns * WIDTH / POINTS_PER_INCH, sum(heights) / POINTS_PER_INCH
    # Before the style, whose end would undo what the first figure sets up: notebooks show it.
    figure = plt.figure(figsize=size)
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        figure.set_layout_engine("constrained")
        parts = figure.subfigures(len(rows), columns, squeeze=False, height_ratios=heights)
        for row, panels in zip(parts, rows, strict=True):
            for part, panel in zip(row, panels, strict=False):
                _draw_panel(part, panel)
    return figure


def _draw_panel(part: Any, panel: Panel) -> None:
    heights = [plot.height for plot in panel.plots]
    part.subplots(len(heights), sharex=True, height_ratios=heights)
    for axes, plot in zip(part.axes, panel.plots, strict=True):
        for curve in plot.curves:
            _draw_curve(axes, curve)
        if plot.band:
            axes.axvspan(*plot.band, color=format_hex(GREEN), alpha=0.13, linewidth=0.0)
        for item in plot.texts:
            axes.annotate(item.text, (item.x, item.y), (5.0, 3.0), textcoords="offset points")
        axes.set(title=plot.title, xlabel=plot.x_label, ylabel=plot.y_label)
    part.legend(loc="outside lower center", ncols=2)


def _draw_curve(axes: "Axes", curve: Curve) -> None:
    look = curve.look
    dashes = (0.0, [length / look.width for length in look.dashes]) if look.dashes else "-"
    axes.plot(
        curve.x,
        curve.y,
        color=look.colour,
        alpha=look.opacity,
        linewidth=look.width,
        linestyle=dashes if look.width else "none",
        marker=look.marker,
        markersize=look.size,
        markerfacecolor="none" if look.is_hollow else look.colour,
        label=curve.name,
    )
