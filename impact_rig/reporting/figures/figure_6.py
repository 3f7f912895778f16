"""Fig. 6: the mean square error between model and measurement, with the paper's bounds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from impact_rig.reporting.figures.figure import ReportFigure, make_missing_figure, make_name
from impact_rig.reporting.figures.looks import find_looks, show_names
from impact_rig.reporting.figures.style import (
    INK,
    LEGEND_ROW,
    add_legend,
    drawing_style,
    make_panel,
)
from impact_rig.reporting.figures.vector import render_panels
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
FRAME_HEIGHT = 62.0
"""Of what is around the axes [pt]."""
BAR_HEIGHT = 0.62
"""Part of that [-]."""
SHORTEST_BAR = 20.0
"""How many times the longest bar the bound may be before bars give way to points on a logarithmic
axis [-], our choice."""
VALUE_ROOM = 1.22
"""Length of the axis over the longest bar [-]: its value stands behind it."""
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
    compared = [row for row in rows if math.isfinite(row.mse_hammer_percent)]
    if not compared:
        reason = "Fig. 6 is not drawn: no sample could be compared with the model."
        return make_missing_figure(name, TITLE, reason)
    with drawing_style():
        svg = render_panels(name, [_draw_part(part, compared) for part in PARTS])
    alternative = " ".join(_describe(part, compared) for part in PARTS)
    return ReportFigure(name, TITLE, svg, alternative, CAPTION)


def _draw_part(part: _Part, rows: Sequence[FigureRow]) -> "Figure":
    from matplotlib.lines import Line2D

    looks = find_looks([row.material for row in rows])
    values = [_find_value(part, row) for row in rows]
    panel = make_panel(FRAME_HEIGHT + ROW_HEIGHT * len(rows) + LEGEND_ROW)
    axes = panel.add_subplot()
    bound: dict[str, Any] = {"color": INK, "linewidth": 1.0, "linestyle": (0, (4, 2))}
    axes.axvline(part.bound, **bound, gid="bound-1")
    draw = _draw_points if _is_far(part, values) else _draw_bars
    draw(axes, values, [looks[row.material].colour for row in rows], part.bound)
    for place, value in enumerate(values):
        axes.annotate(
            f"{value:.3g}",
            (value, place),
            xytext=(6.0, 0.0),
            textcoords="offset points",
            va="center",
            fontsize=9.0,
        )
    show_names(axes, [row.name for row in rows])
    axes.set_title(part.title)
    axes.set_xlabel("MSE [%]")
    label = f"largest value of the paper, {part.bound:g} %"
    add_legend(panel, [Line2D([], [], **bound, label=label)])
    return panel


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
        f"Mean square error of the {part.whose}: largest {_find_value(part, worst):.3g} %"
        f" ({worst.name}); {above} of {len(rows)} above the paper's {part.bound:g} %."
    )
