"""Fig. 6: the mean square error between model and measurement, with the paper's bounds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from impact_rig.reporting.figures.figure import ReportFigure, make_missing_figure
from impact_rig.reporting.figures.looks import find_looks
from impact_rig.reporting.figures.names import make_name
from impact_rig.reporting.figures.panel import make_named_panel
from impact_rig.reporting.figures.style import (
    INK,
    drawing_style,
)
from impact_rig.reporting.figures.vector import render_panels
from impact_rig.reporting.figures.words import format_percent
from impact_rig.results.figure_rows import (
    LARGEST_MSE_HAMMER_PERCENT,
    LARGEST_MSE_SAMPLE_PERCENT,
    FigureRow,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TITLE = "Fig. 6. Mean square error between model and measurement"
ROW_HEIGHT = 17.0
"""Of one sample's bar with its room [pt]."""
BAR_HEIGHT = 0.62
"""Part of that [-]."""
SHORTEST_BAR = 20.0
"""How many times the longest bar the bound may be before bars give way to points on a logarithmic
axis [-], our choice."""
VALUE_ROOM = 1.22
"""Length of the axis over the longest bar [-]: its value stands behind it."""
VALUE_SIZE = 9.0
VALUE_GAP = 6.0
VALUE_SHARE = 0.14
"""Of the values: size and distance from the bar [pt], and length as part of the axis [-]."""
CAPTION = (
    "Over the whole record, both traces normalised to their peak and shifted onto each other, as"
    " the paper has it. Dashed line: the largest value of the paper, which prints this figure"
    " without numbers. This measure is forgiving: a visibly wrong shape still gives 1 to 3 %."
)


@dataclass(frozen=True)
class _Part:
    """One panel: whose error, its attribute of `FigureRow`, and the paper's bound [%]."""

    title: str
    whose: str
    attribute: str
    bound: float


PARTS = (
    _Part("a) hammer", "hammer", "mse_hammer_percent", LARGEST_MSE_HAMMER_PERCENT),
    _Part("b) samples", "sample", "mse_sample_percent", LARGEST_MSE_SAMPLE_PERCENT),
)


def draw_figure_6(rows: Sequence[FigureRow], *, prefix: str = "") -> ReportFigure:
    """Draw the mean square error of the force-driven model, hammer and samples apart.

    Parameters
    ----------
    rows : sequence of FigureRow
        See `make_figure_rows`.
    prefix : str
        Put before the figure's name.

    Returns
    -------
    ReportFigure
        Not drawn if no sample was compared with the model.
    """
    name = make_name(prefix, "figure 6")
    parts = [
        (part, [row for row in rows if math.isfinite(_find_value(part, row))]) for part in PARTS
    ]
    parts = [(part, compared) for part, compared in parts if compared]
    if not parts:
        reason = "No sample could be compared with the model."
        return make_missing_figure(name, TITLE, reason)
    with drawing_style():
        svg = render_panels(name, [_draw_part(part, compared) for part, compared in parts])
    alternative = " ".join(_describe(part, compared) for part, compared in parts)
    return ReportFigure(name, TITLE, svg, alternative, CAPTION)


def _draw_part(part: _Part, rows: Sequence[FigureRow]) -> "Figure":
    from matplotlib.lines import Line2D

    looks = find_looks([row.material for row in rows])
    values = [_find_value(part, row) for row in rows]
    bound: dict[str, Any] = {"color": INK, "linewidth": 1.0, "linestyle": (0, (4, 2))}
    label = f"largest value of the paper, {part.bound:g} %"
    panel = make_named_panel(
        [row.name for row in rows],
        ROW_HEIGHT * len(rows),
        [[Line2D([], [], **bound, label=label)]],
    )
    axes = panel.axes[0]
    axes.axvline(part.bound, **bound, gid="bound-1")
    draw = _draw_points if _is_far(part, values) else _draw_bars
    draw(axes, values, [looks[row.material].colour for row in rows], part.bound)
    _write_values(axes, values, part.bound)
    axes.set_title(part.title)
    axes.set_xlabel("MSE [%]")
    return panel


def _write_values(axes: "Axes", values: Sequence[float], bound: float) -> None:
    room = VALUE_SHARE * axes.get_xlim()[1]
    for place, value in enumerate(values):
        # A number that would stand on the bound stands behind it.
        is_hidden = axes.get_xscale() == "linear" and value < bound < value + room
        axes.annotate(
            format_percent(value).removesuffix(" %"),
            (bound if is_hidden else value, place),
            xytext=(VALUE_GAP, 0.0),
            textcoords="offset points",
            va="center",
            fontsize=VALUE_SIZE,
        )


def _is_far(part: _Part, values: Sequence[float]) -> bool:
    """Tell whether the values are so far below the bound that bars to it would be nothing."""
    return min(values) > 0.0 and max(values) < part.bound / SHORTEST_BAR


def _draw_bars(
    axes: "Axes", values: Sequence[float], colours: Sequence[str], bound: float
) -> None:
    for place, (value, colour) in enumerate(zip(values, colours, strict=True)):
        axes.barh(
            [place], [value], height=BAR_HEIGHT, color=colour, linewidth=0.0, gid=f"bar-{place}"
        )
    axes.set_xlim(0.0, VALUE_ROOM * max([bound, *values]))


def _draw_points(
    axes: "Axes", values: Sequence[float], colours: Sequence[str], bound: float
) -> None:
    """Draw on a logarithmic axis, on which a bar would have no honest length."""
    axes.set_xscale("log")
    for place, (value, colour) in enumerate(zip(values, colours, strict=True)):
        axes.plot([value], [place], marker="o", color=colour, gid=f"bar-{place}")
    axes.set_xlim(0.5 * min(values), 2.0 * bound)
    axes.xaxis.set_major_formatter("{x:g}")


def _find_value(part: _Part, row: FigureRow) -> float:
    value: float = getattr(row, part.attribute)
    return value


def _describe(part: _Part, rows: Sequence[FigureRow]) -> str:
    worst = max(rows, key=lambda row: _find_value(part, row))
    above = sum(_find_value(part, row) > part.bound for row in rows)
    return (
        f"Mean square error of the {part.whose}: largest"
        f" {format_percent(_find_value(part, worst))} ({worst.name}); {above} of {len(rows)} above"
        f" the paper's {part.bound:g} %."
    )
