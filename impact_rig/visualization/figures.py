"""The paper's figures 3, 4 and 6, with its values beside ours.

Plots over time have a time as abscissa, and a pulse width is one: Figs. 3 and 4 share it. Fig. 6
is drawn into a plane, since a bar chart of Rerun cannot name its bars.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from impact_rig.results.figure_rows import FigureRow
from impact_rig.results.palette import GREY, MATERIALS, Colour
from impact_rig.visualization import entities
from impact_rig.visualization.entities import Path
from impact_rig.visualization.plots import Mark, PlotLog

MARKERS = ("square", "up", "asterisk", "diamond", "circle", "plus")
"""Of sizes, the smallest first: the paper's squares, triangles and stars, then others."""
HIT_SIZE = 2.5
"""Size of one hit [points], our choice."""
MEAN_SIZE = 6.0
"""Size of a mean [points], our choice."""
REFERENCE_SIZE = 11.0
"""Size of a published or expected value [points], our choice: it surrounds the mean."""
REFERENCE_OPACITY = 110
"""Its opacity, of 255, our choice."""
HIT_OPACITY = 140
"""Of one hit, of 255, our choice."""
GRAM = 1e3
"""Kilograms to grams."""

Points = Sequence[tuple[float, float]]
"""Abscissa [s] and ordinate of what one mark shows."""


def find_colours(rows: Sequence[FigureRow]) -> dict[str, Colour]:
    """Return the colours of materials, in the order in which they come."""
    materials = dict.fromkeys(row.material for row in rows)
    return {name: MATERIALS[i % len(MATERIALS)] for i, name in enumerate(materials)}


def draw_figure_3(plots: PlotLog, rows: Sequence[FigureRow]) -> None:
    """Draw relative mass and pulse width: each hit, the mean, and what is expected, around it."""
    colours = find_colours(rows)
    name = "paper" if all(row.reference.is_published for row in rows) else "expected"
    # What comes first is drawn below.
    marks = [Mark(name, (*GREY, REFERENCE_OPACITY), "circle", REFERENCE_SIZE)]
    points: list[Points] = [
        [(row.reference.contact_time, row.relative_mass * GRAM) for row in rows]
    ]
    for row in rows:
        mass = row.relative_mass * GRAM
        colour = (*colours[row.material], HIT_OPACITY)
        marks.append(Mark(row.name, colour, find_marker(row), HIT_SIZE))
        points.append([(time, mass) for time in row.contact_times])
    for row in rows:
        marks.append(Mark(row.name, colours[row.material], find_marker(row), MEAN_SIZE))
        points.append([(row.contact_time, row.relative_mass * GRAM)])
    _replace_points(plots, entities.FIGURE_3, points, marks)


def draw_figure_4(plots: PlotLog, rows: Sequence[FigureRow]) -> None:
    """Draw the peaks of the means over the pulse width, of the hammer and of the samples."""
    colours = find_colours(rows)
    marks = [Mark(row.name, colours[row.material], find_marker(row), MEAN_SIZE) for row in rows]
    for body, peaks in (
        (entities.HAMMER, [row.hammer_peak for row in rows]),
        (entities.SPECIMEN, [row.specimen_peak for row in rows]),
    ):
        points = [[(row.contact_time, peak)] for row, peak in zip(rows, peaks, strict=True)]
        _replace_points(plots, (*entities.FIGURE_4, body), points, marks)


def find_marker(row: FigureRow) -> str:
    """Return the marker of a sample's size."""
    return MARKERS[row.size % len(MARKERS)]


def _replace_points(
    plots: PlotLog, family: Path, points: Sequence[Points], marks: Sequence[Mark]
) -> None:
    plots.hide(family)
    found = sorted(
        (time, column, value)
        for column, items in enumerate(points)
        for time, value in items
        if math.isfinite(time) and math.isfinite(value)
    )
    values = np.full((len(found), len(marks)), np.nan)
    for row, (_, column, value) in enumerate(found):
        values[row, column] = value
    plots.draw_points(family, np.array([time for time, *_ in found]), values, marks)
