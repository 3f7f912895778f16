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
from impact_rig.visualization.drawing.plots import Mark, PlotLog
from impact_rig.visualization.entities import Path

MARKERS = ("square", "up", "asterisk", "diamond", "circle", "left")
"""Of sizes, the smallest first: the paper's squares, triangles and stars, then others."""
HIT_SIZE = 2.5
"""Size of one hit [points], our choice."""
MEAN_SIZE = 6.0
"""Size of a mean [points], our choice."""
REFERENCE_SIZE = 10.0
"""Size of a published or expected value [points], our choice: a cross that is seen
around the mean."""
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
    masses = [row.relative_mass * GRAM for row in rows]
    name = "paper" if all(row.reference.is_published for row in rows) else "expected"
    _replace_points(
        plots,
        (*entities.FIGURE_3, "reference"),
        [[(row.reference.contact_time, mass) for row, mass in zip(rows, masses, strict=True)]],
        [Mark(name, GREY, "plus", REFERENCE_SIZE)],
    )
    for part, size, times in (
        ("hits", HIT_SIZE, [row.contact_times for row in rows]),
        ("means", MEAN_SIZE, [(row.contact_time,) for row in rows]),
    ):
        _replace_points(
            plots,
            (*entities.FIGURE_3, part),
            [
                [(time, mass) for time in of_sample]
                for of_sample, mass in zip(times, masses, strict=True)
            ],
            [Mark(row.name, colours[row.material], find_marker(row), size) for row in rows],
        )


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
    found = sorted(
        (time, column, value)
        for column, items in enumerate(points)
        for time, value in items
        if math.isfinite(time) and math.isfinite(value)
    )
    values = np.full((len(found), len(marks)), np.nan)
    for row, (_, column, value) in enumerate(found):
        values[row, column] = value
    plots.replace_points(family, np.array([time for time, *_ in found]), values, marks)
