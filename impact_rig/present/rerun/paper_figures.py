"""The paper's figures 3, 4 and 6, with its values beside ours.

Plots over time have a time as abscissa, and a pulse width is one: Figs. 3 and 4 share it. Fig. 6
is drawn into a plane, one bar a sample, since a bar chart of Rerun cannot name its bars.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from impact_rig.present.rerun import entities
from impact_rig.present.rerun.entities import Path
from impact_rig.present.rerun.plots import Mark, PlotLog
from impact_rig.present.rerun.rerun_sdk import import_rerun
from impact_rig.results.figure_rows import ERRORS, LARGEST_ERRORS_PERCENT, PEAKS, FigureRow
from impact_rig.results.palette import GREY, MATERIALS, Colour

if TYPE_CHECKING:
    import rerun as rr

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


def choose_colours(rows: Sequence[FigureRow]) -> dict[str, Colour]:
    """Return the colours of materials, in the order in which they come."""
    materials = dict.fromkeys(row.material for row in rows)
    return {name: MATERIALS[i % len(MATERIALS)] for i, name in enumerate(materials)}


def draw_figure_3(plots: PlotLog, rows: Sequence[FigureRow]) -> None:
    """Draw relative mass and pulse width: each hit, the mean, and what is expected, around it."""
    colours = choose_colours(rows)
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
            [Mark(row.name, colours[row.material], choose_marker(row), size) for row in rows],
        )


def draw_figure_4(plots: PlotLog, rows: Sequence[FigureRow]) -> None:
    """Draw the peaks of the means over the pulse width, of the hammer and of the samples."""
    colours = choose_colours(rows)
    marks = [Mark(row.name, colours[row.material], choose_marker(row), MEAN_SIZE) for row in rows]
    for body, field in PEAKS.items():
        points = [[(row.contact_time, getattr(row, field))] for row in rows]
        _replace_points(plots, (*entities.FIGURE_4, body), points, marks)


def choose_marker(row: FigureRow) -> str:
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


WIDTH = 10.0
"""Of the drawing without names [units of the plane], our choice."""
HEIGHT = 12.0
"""Of all bars together [units of the plane], our choice."""
LEFT, RIGHT, ABOVE, BELOW = 5.8, 2.8, 1.4, 1.4
"""Room for names, values, bound and axis [units of the plane], our choice."""
FILLING = 0.7
"""Height of a bar over the height of its row [-], our choice."""
STRANDS = 8
"""Lines side by side that fill a bar [-], our choice: the ends of lines are round."""
OVERLAP = 1.4
"""Width of a strand over the distance to the next [-], our choice: no gap shows."""
VALUE_GAP = 1.5
"""From the end of a bar to the middle of its value [units of the plane], our choice."""
SMALLEST_VALUE = 0.001
"""What three decimals can tell from nothing [%]."""
LABEL_RISE = 0.4
"""How far labels are raised, since Rerun hangs them below their point [units], our choice."""
LARGEST_TICK_COUNT = 6
"""Most intervals of the axis [-], our choice."""
LIGHT: Colour = (200, 200, 200)
"""Of names and values, our choice: to be read on the dark ground that planes have."""


def draw_figure_6(stream: rr.RecordingStream, rows: Sequence[FigureRow]) -> None:
    """Draw the mean square errors of hammer and samples, in place of those before."""
    colours = choose_colours(rows)
    pitch = HEIGHT / max(len(rows), 1)
    places = {row.name: (place + 0.5) * pitch for place, row in enumerate(rows)}
    for body, field in ERRORS.items():
        bars = [
            (places[row.name], getattr(row, field), colours[row.material])
            for row in rows
            if math.isfinite(getattr(row, field))
        ]
        family = (*entities.FIGURE_6, body)
        _draw_bars(stream, family, bars, places, FILLING * pitch, LARGEST_ERRORS_PERCENT[body])


def compute_axis_end(values: Iterable[float], bound: float) -> float:
    """Return the value at the right end of the axis [%]: beyond every bar and the bound."""
    return 1.05 * max(bound, *values, 0.0)


def choose_ticks(top: float) -> list[float]:
    """Return round values from 0 to at most `top`, in equal steps of 1, 2 or 5."""
    decade = 10.0 ** math.floor(math.log10(top / LARGEST_TICK_COUNT))
    step = next(
        factor * decade
        for factor in (1.0, 2.0, 5.0, 10.0)
        if factor * decade * LARGEST_TICK_COUNT >= top
    )
    return [i * step for i in range(int(top / step) + 1)]


def _draw_bars(
    stream: rr.RecordingStream,
    family: Path,
    bars: Sequence[tuple[float, float, Colour]],
    places: Mapping[str, float],
    width: float,
    bound: float,
) -> None:
    """Draw one panel: bars by place, value [%] and colour; names by place; the bound [%]."""
    rr = import_rerun()
    end = compute_axis_end((value for _, value, _ in bars), bound)
    scale = WIDTH / end
    strand = width / 2 / STRANDS
    offsets = [(2 * i + 1) * strand - width / 2 for i in range(STRANDS)]
    strips = [
        [(0.0, place + offset), (value * scale, place + offset)]
        for place, value, _ in bars
        for offset in offsets
    ]
    ticks = choose_ticks(end)
    labels = [
        *((-LEFT / 2, place, name) for name, place in places.items()),
        *((value * scale + VALUE_GAP, place, _format(value)) for place, value, _ in bars),
        *((tick * scale, HEIGHT + 0.4, f"{tick:g} %") for tick in ticks),
        (bound * scale, -0.8, f"paper: at most {bound:g} %"),
    ]
    parts = {
        "bars": rr.LineStrips2D(
            strips,
            colors=[colour for *_, colour in bars for _ in offsets],
            radii=OVERLAP * strand,
        ),
        "grid": make_lines(_make_uprights([tick * scale for tick in ticks], 0.0), GREY, 1.0),
        "bound": make_lines(_make_uprights([bound * scale], -0.4), LIGHT, 2.0),
        "labels": make_labels(labels),
    }
    draw_parts(stream, family, parts)


def draw_parts(stream: rr.RecordingStream, family: Path, parts: Mapping[str, Any]) -> None:
    """Draw into a plane, in place of what was there, what `make_lines` and such return."""
    for part, archetype in parts.items():
        path = import_rerun().new_entity_path([*family, part])
        stream.log(path, archetype, static=True)


def make_labels(labels: Sequence[tuple[float, float, str]]) -> Any:
    """Return texts in the middle of their places."""
    rr = import_rerun()
    return rr.Points2D(
        [(x, y - LABEL_RISE) for x, y, _ in labels],
        labels=[text for *_, text in labels],
        colors=LIGHT,
        radii=rr.Radius.ui_points(0.0),
        show_labels=True,
    )


def make_lines(
    strips: Sequence[Any], colour: Colour, width: float, order: float | None = None
) -> Any:
    """Return lines through points, shape (n, 2) each, so thick [points]; higher order: on top."""
    rr = import_rerun()
    return rr.LineStrips2D(
        strips, colors=colour, radii=rr.Radius.ui_points(width / 2.0), draw_order=order
    )


def _format(value: float) -> str:
    """Return a value [%] in few letters: there is little room beside the bars."""
    return f"{value:.3f} %" if value >= SMALLEST_VALUE else f"< {SMALLEST_VALUE} %"


def _make_uprights(places: Sequence[float], top: float) -> Sequence[Points]:
    return [[(place, top), (place, HEIGHT)] for place in places]
