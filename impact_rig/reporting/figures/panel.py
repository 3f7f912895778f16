"""A panel: axes of fixed margins, one below the other, and a legend below them.

The margins are fixed because panels that stand beside each other must match, and because finding
them would take longer than everything else.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from impact_rig.reporting.figures.names import shorten_name
from impact_rig.reporting.figures.style import TICK_SIZE

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

POINTS_PER_INCH = 72.0
WIDTH = 340.0
"""Of a panel [pt], our choice: about that of a phone, where the text then has its own size."""
LEFT = 58.0
"""Left of the axes [pt]: an axis label and a tick's five characters."""
RIGHT = 9.0
TOP = 21.0
BOTTOM = 38.0
"""Beside, above and below the axes [pt]: a title above, ticks and an axis label below."""
GAP = 11.0
"""Between axes that share their time [pt]."""
LABEL_EDGE = 4.0
"""From the edge of the panel to the label of a vertical axis [pt]."""
LABEL_DEPTH = 22.0
"""From the axes down to the label of the horizontal axis [pt]."""
LEGEND_LINE = 14.0
LEGEND_ROOM = 6.0
"""Height of a line of the legend, and what is left around it [pt]."""
LONGEST_COLUMN = 10
"""Lines in a column of a legend [-], our choice."""


def make_panel(
    heights: Sequence[float], legend: "Sequence[Sequence[Artist]]", *, left: float = LEFT
) -> "Figure":
    """Return a panel with its axes and its legend; call it in `drawing_style`.

    Parameters
    ----------
    heights : sequence of float
        Of the axes, from top to bottom [pt]; they share their horizontal axis.
    legend : sequence of sequence of matplotlib.artist.Artist
        Handles of the legend, column by column.
    left : float
        Room left of the axes [pt].
    """
    # The Figure itself, not pyplot: no screen, no state that outlives the call.
    from matplotlib.figure import Figure

    inner = sum(heights) + GAP * (len(heights) - 1)
    bottom = BOTTOM + LEGEND_ROOM + LEGEND_LINE * max(map(len, legend))
    total = TOP + inner + bottom
    panel = Figure(figsize=(WIDTH / POINTS_PER_INCH, total / POINTS_PER_INCH))
    panel.subplots(
        len(heights),
        sharex=True,
        gridspec_kw={
            "height_ratios": heights,
            "hspace": GAP * len(heights) / sum(heights),
            "left": left / WIDTH,
            "right": 1.0 - RIGHT / WIDTH,
            "top": 1.0 - TOP / total,
            "bottom": bottom / total,
        },
    )
    for axes, height in zip(panel.axes, heights, strict=True):
        width = WIDTH - left - RIGHT
        axes.yaxis.set_label_coords((LABEL_EDGE - left) / width, 0.5)
        axes.yaxis.label.set_verticalalignment("top")
        axes.xaxis.set_label_coords(0.5, -LABEL_DEPTH / height)
    _add_legend(panel, legend)
    return panel


def make_named_panel(
    names: Sequence[str], height: float, legend: "Sequence[Sequence[Artist]]"
) -> "Figure":
    """Return a panel with a name at the places 0, 1, ... of its vertical axis, from the top."""
    shown = [shorten_name(name) for name in names]
    panel = make_panel([height], legend, left=LABEL_EDGE + 5.0 + _measure_widest(shown))
    axes: Axes = panel.axes[0]
    axes.set_yticks(range(len(shown)), shown)
    axes.set_ylim(len(shown) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)
    axes.grid(visible=False, axis="y")
    return panel


def split_into_columns(handles: "Sequence[Artist]") -> "list[Sequence[Artist]]":
    """Return one column of a legend, or two where one would be higher than the figure."""
    if len(handles) <= LONGEST_COLUMN:
        return [handles]
    half = (len(handles) + 1) // 2
    return [handles[:half], handles[half:]]


def _add_legend(panel: "Figure", columns: "Sequence[Sequence[Artist]]") -> None:
    """Put a legend at the bottom, its columns filled from the top."""
    from matplotlib.lines import Line2D

    lines = max(map(len, columns))
    blank = Line2D([], [], linestyle="none", label=" ")
    panel.legend(
        handles=[
            handle for column in columns for handle in (*column, *[blank] * (lines - len(column)))
        ],
        loc="lower left",
        ncols=len(columns),
        alignment="left",
        borderaxespad=0.0,
        labelspacing=0.3,
    )


def _measure_widest(texts: Sequence[str]) -> float:
    """Return the width of the widest text beside an axis [pt], in a font that is rather wide."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(size=TICK_SIZE)
    widths = (
        text_to_path.get_text_width_height_descent(text, font, ismath=False)[0] for text in texts
    )
    return max(widths)
