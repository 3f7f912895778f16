"""Fig. 6 as a drawing in a plane: one bar a sample, named, with the paper's largest value."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from impact_rig.results.figure_rows import (
    LARGEST_MSE_HAMMER_PERCENT,
    LARGEST_MSE_SAMPLE_PERCENT,
    FigureRow,
)
from impact_rig.results.palette import GREY, Colour
from impact_rig.visualization import entities
from impact_rig.visualization.drawing.figures import find_colours
from impact_rig.visualization.drawing.text import format_percent
from impact_rig.visualization.entities import Path
from impact_rig.visualization.rerun_sdk import import_rerun

if TYPE_CHECKING:
    import rerun as rr

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
LABEL_RISE = 0.4
"""How far labels are raised, since Rerun hangs them below their point [units], our choice."""
LARGEST_TICK_COUNT = 6
"""Most intervals of the axis [-], our choice."""
LIGHT: Colour = (200, 200, 200)
"""Of names and values, our choice: to be read on the dark ground that planes have."""


@dataclass(frozen=True)
class Bars:
    """One panel.

    Attributes
    ----------
    names : tuple of str
        Of the samples, from top to bottom.
    values : tuple of float
        [%]; NaN: no bar.
    colours : tuple of Colour
        Of the bars.
    bound : float
        The paper's largest value [%].
    """

    names: tuple[str, ...]
    values: tuple[float, ...]
    colours: tuple[Colour, ...]
    bound: float

    @property
    def top(self) -> float:
        """Value at the right end of the axis [%]."""
        return 1.05 * max(self.bound, *(value for value in self.values if math.isfinite(value)), 0)


def make_figure_6(rows: Sequence[FigureRow]) -> dict[Path, Bars]:
    """Return the panels of Fig. 6, by their entity."""
    names = tuple(row.name for row in rows)
    by_material = find_colours(rows)
    colours = tuple(by_material[row.material] for row in rows)
    hammer = tuple(row.mse_hammer_percent for row in rows)
    sample = tuple(row.mse_sample_percent for row in rows)
    return {
        (*entities.FIGURE_6, entities.HAMMER): Bars(
            names, hammer, colours, LARGEST_MSE_HAMMER_PERCENT
        ),
        (*entities.FIGURE_6, entities.SPECIMEN): Bars(
            names, sample, colours, LARGEST_MSE_SAMPLE_PERCENT
        ),
    }


def find_ticks(top: float) -> list[float]:
    """Return round values from 0 to at most `top`, in equal steps of 1, 2 or 5."""
    decade = 10.0 ** math.floor(math.log10(top / LARGEST_TICK_COUNT))
    step = next(
        factor * decade
        for factor in (1.0, 2.0, 5.0, 10.0)
        if factor * decade * LARGEST_TICK_COUNT >= top
    )
    return [i * step for i in range(int(top / step) + 1)]


def log_bars(stream: rr.RecordingStream, family: Path, bars: Bars) -> None:
    """Draw a panel in place of the one before."""
    rr = import_rerun()
    pitch = HEIGHT / max(len(bars.names), 1)
    rows = [(i + 0.5) * pitch for i in range(len(bars.names))]
    scale = WIDTH / bars.top
    found = [
        (row, value, colour)
        for row, value, colour in zip(rows, bars.values, bars.colours, strict=True)
        if math.isfinite(value)
    ]
    half = FILLING * pitch / 2
    strand = half / STRANDS
    offsets = [-half + (2 * i + 1) * strand for i in range(STRANDS)]

    def log(part: str, archetype: Any) -> None:
        stream.log(rr.new_entity_path([*family, part]), archetype, static=True)

    log(
        "bars",
        rr.LineStrips2D(
            [
                [(0.0, row + offset), (value * scale, row + offset)]
                for row, value, _ in found
                for offset in offsets
            ],
            colors=[colour for *_, colour in found for _ in offsets],
            radii=OVERLAP * strand,
        ),
    )
    ticks = find_ticks(bars.top)
    log("grid", _make_uprights([tick * scale for tick in ticks], 0.0, GREY, 0.5))
    log("bound", _make_uprights([bars.bound * scale], -0.4, LIGHT, 1.0))
    labels = [
        *((-LEFT / 2, row, name) for row, name in zip(rows, bars.names, strict=True)),
        *(
            (value * scale + VALUE_GAP, row, f"{format_percent(value)} %")
            for row, value, _ in found
        ),
        *((tick * scale, HEIGHT + 0.4, f"{tick:g} %") for tick in ticks),
        (bars.bound * scale, -0.8, f"paper: at most {bars.bound:g} %"),
    ]
    log(
        "labels",
        rr.Points2D(
            [(x, y - LABEL_RISE) for x, y, _ in labels],
            labels=[text for *_, text in labels],
            colors=LIGHT,
            radii=rr.Radius.ui_points(0.0),
            show_labels=True,
        ),
    )


def _make_uprights(places: Sequence[float], top: float, colour: Colour, radius: float) -> Any:
    rr = import_rerun()
    return rr.LineStrips2D(
        [[(place, top), (place, HEIGHT)] for place in places],
        colors=colour,
        radii=rr.Radius.ui_points(radius),
    )
