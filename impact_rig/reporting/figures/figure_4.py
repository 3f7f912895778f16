"""Fig. 4: the maximum amplitude against the pulse width, averages."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from impact_rig.reporting.figures.figure import ReportFigure, make_missing_figure
from impact_rig.reporting.figures.looks import (
    Look,
    draw_material_lines,
    find_looks,
    find_marker,
    make_material_handles,
    make_size_handles,
)
from impact_rig.reporting.figures.names import make_name
from impact_rig.reporting.figures.panel import make_panel, split_into_columns
from impact_rig.reporting.figures.style import (
    drawing_style,
)
from impact_rig.reporting.figures.vector import render_panels
from impact_rig.reporting.figures.words import format_count
from impact_rig.results.figure_rows import FigureRow
from impact_rig.results.numbers import MICRO

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLE = "Fig. 4. Maximum amplitude against pulse width"
AXES_HEIGHT = 190.0
"""[pt]"""
PANELS = (("a) hammer", "hammer", "hammer_peak"), ("b) samples", "sample", "specimen_peak"))
"""Title of the panel, whose amplitude, and the attribute of `FigureRow`."""
CAPTION = (
    "Largest acceleration of the mean hit against the pulse width. Colour and dashes stand for"
    " the material, squares, triangles and stars for the sizes, as in the paper, which prints this"
    " figure without numbers: there is nothing to lay beside it."
)


def draw_figure_4(rows: Sequence[FigureRow], *, prefix: str = "") -> ReportFigure:
    """Draw the largest accelerations of the mean hits over tau_p, hammer and samples apart.

    Parameters
    ----------
    rows : sequence of FigureRow
        See `make_figure_rows`.
    prefix : str
        Put before the figure's name.

    Returns
    -------
    ReportFigure
        Not drawn if no sample has both a pulse width and an amplitude.
    """
    name = make_name(prefix, "figure 4")
    rows = [replace(row, contact_time=row.contact_time * MICRO) for row in rows]
    looks = find_looks([row.material for row in rows])
    shown = {
        attribute: [
            row
            for row in rows
            if math.isfinite(row.contact_time) and math.isfinite(getattr(row, attribute))
        ]
        for _, _, attribute in PANELS
    }
    if not any(shown.values()):
        reason = "No sample has a pulse width and an amplitude."
        return make_missing_figure(name, TITLE, reason)
    with drawing_style():
        panels = [
            _draw_panel(title, shown[attribute], attribute, looks)
            for title, _, attribute in PANELS
            if shown[attribute]
        ]
        svg = render_panels(name, panels)
    sentences = [
        _describe(whose, shown[attribute], attribute)
        for _, whose, attribute in PANELS
        if shown[attribute]
    ]
    return ReportFigure(name, TITLE, svg, " ".join(sentences), CAPTION)


def _draw_panel(
    title: str, rows: Sequence[FigureRow], attribute: str, looks: dict[str, Look]
) -> "Figure":
    columns = [*split_into_columns(make_material_handles(looks)), make_size_handles(rows)]
    panel = make_panel([AXES_HEIGHT], columns)
    axes = panel.axes[0]
    draw_material_lines(axes, rows, "contact_time", attribute, looks)
    for place, row in enumerate(rows):
        axes.plot(
            [row.contact_time],
            [getattr(row, attribute)],
            color=looks[row.material].colour,
            **find_marker(row.size),
            gid=f"mean-{place}",
        )
    axes.set_ylim(bottom=0.0)
    axes.set_title(title)
    axes.set_xlabel("pulse width τp [µs]")
    axes.set_ylabel("maximum amplitude [m/s²]")
    return panel


def _describe(whose: str, rows: Sequence[FigureRow], attribute: str) -> str:
    smallest = min(rows, key=lambda row: getattr(row, attribute))
    largest = max(rows, key=lambda row: getattr(row, attribute))
    return (
        f"Maximum amplitude of the {whose} against the pulse width,"
        f" {format_count(len(rows), 'sample')}: {_describe_row(smallest, attribute)}"
        + ("." if len(rows) == 1 else f" to {_describe_row(largest, attribute)}.")
    )


def _describe_row(row: FigureRow, attribute: str) -> str:
    return f"{getattr(row, attribute):.0f} m/s² at {row.contact_time:.1f} µs ({row.name})"
