"""What all figures are made of: the report's style, panels of fixed margins, looks of samples.

A panel is axes one below the other and a legend below them. Its margins are fixed because panels
that stand beside each other must match, and because computing them would take longer than
everything else. A material has its colour and its dashes, a size its marker.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from impact_rig.results.figure_rows import FigureRow
from impact_rig.results.palette import BLUE, GREEN, GREY, PURPLE, VERMILION, Colour, format_hex

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = "#010203"
"""Stands for the page's ink until the figure is rendered: a colour that nothing else has."""
TEXT_SIZE = 10.0
TICK_SIZE = 9.5
"""Of the text, and of what stands at ticks and in legends [pt]: on a phone as on paper."""
GRID_OPACITY = 0.18
"""[-], our choice: seen when looked for."""
STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",  # text stays text
    "svg.hashsalt": "impact-rig report",  # the same results give the same file
    "text.parse_math": False,  # a sample may be called "$x$"
    "font.size": TEXT_SIZE,
    "axes.titlesize": TEXT_SIZE,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titley": 1.0,  # not found by looking at what is there
    "axes.labelsize": TEXT_SIZE,
    "xtick.labelsize": TICK_SIZE,
    "ytick.labelsize": TICK_SIZE,
    "legend.fontsize": TICK_SIZE,
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "legend.columnspacing": 1.2,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.alpha": GRID_OPACITY,
    "grid.linewidth": 0.8,
    "axes.unicode_minus": True,
    "axes.formatter.useoffset": False,
    **dict.fromkeys(
        (
            "text.color",
            "axes.edgecolor",
            "axes.labelcolor",
            "axes.titlecolor",
            "xtick.color",
            "ytick.color",
            "grid.color",
            "patch.edgecolor",
            "legend.labelcolor",
        ),
        INK,
    ),
}


@contextmanager
def drawing_style() -> Iterator[None]:
    """Draw in the report's style, whatever the user's own settings of matplotlib are."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


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
LONGEST_NAME = 20
"""Characters of a name in a figure [-], our choice: a third of a panel."""
LONGEST_IN_TWO_COLUMNS = 12
"""Characters of a material's name in a legend of two columns [-]: the markers fit beside them."""
SERIES_COLOURS: tuple[Colour, ...] = (BLUE, VERMILION, GREEN, PURPLE, GREY)
"""Those of `palette.MATERIALS`, in its order, that stand out from a white and from a black ground
(3:1, WCAG 2.2, 1.4.11), and grey."""
SERIES_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (1, 1.2)))
"""As many as have no common divisor with the colours: twenty materials differ."""
SIZE_MARKERS = ("s", "^", "*", "o", "D", "v", "P", "X")
"""Of a material's samples by mass: the paper's squares, triangles and stars first."""
SIZE_NAMES = ("small", "medium", "large")
"""Of the first three sizes, as the paper calls them."""
MARKER_SIZES = {"*": 8.5, "^": 6.0, "P": 6.5}
"""Of markers that look smaller than others of their size [pt]."""
MARKER_SIZE = 5.0
"""Of the others [pt]."""


def shorten_name(name: str, longest: int = LONGEST_NAME) -> str:
    """Return a name that fits, without characters that XML has not.

    Its beginning and its end stay: names often differ there.
    """
    name = "".join(character if character.isprintable() else "\ufffd" for character in name)
    if len(name) <= longest:
        return name
    head = 2 * longest // 3 - 1
    return f"{name[:head].rstrip()}…{name[head + 1 - longest :].lstrip()}"


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


def make_handle(label: str, **look: Any) -> "Artist":
    """Return what a legend shows for lines or markers of one look."""
    from matplotlib.lines import Line2D

    return Line2D([], [], **look, label=label)


def _add_legend(panel: "Figure", columns: "Sequence[Sequence[Artist]]") -> None:
    """Put a legend at the bottom, its columns filled from the top."""
    lines = max(map(len, columns))
    blank = make_handle(" ", linestyle="none")
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


@dataclass(frozen=True)
class Look:
    """How a series looks wherever it is drawn.

    Attributes
    ----------
    colour : str
        ``#rrggbb``
    dashes : Any
        Of its lines, as matplotlib takes them.
    """

    colour: str
    dashes: Any


def choose_looks(names: Sequence[str]) -> dict[str, Look]:
    """Return the look of every series by its name, in the order of the names."""
    return {
        name: Look(
            format_hex(SERIES_COLOURS[place % len(SERIES_COLOURS)]),
            SERIES_DASHES[place % len(SERIES_DASHES)],
        )
        for place, name in enumerate(dict.fromkeys(names))
    }


def choose_marker(place: int) -> dict[str, Any]:
    """Return the marker of the samples at one place among those of their material."""
    marker = SIZE_MARKERS[place % len(SIZE_MARKERS)]
    size = MARKER_SIZES.get(marker, MARKER_SIZE)
    return {"marker": marker, "markersize": size, "linestyle": "none"}


def make_material_handles(looks: dict[str, Look]) -> "list[Artist]":
    """Return the lines that a legend shows for the materials."""
    longest = LONGEST_NAME if len(looks) <= LONGEST_COLUMN else LONGEST_IN_TWO_COLUMNS
    return [
        make_handle(shorten_name(name, longest), color=look.colour, linestyle=look.dashes)
        for name, look in looks.items()
    ]


def make_size_handles(rows: Sequence[FigureRow]) -> "list[Artist]":
    """Return the markers that a legend shows for the sizes; none if there is only one."""
    sizes = sorted({row.size for row in rows})
    if len(sizes) == 1:
        return []
    names = SIZE_NAMES if sizes[-1] < len(SIZE_NAMES) else ()
    return [
        make_handle(
            names[size] if names else f"{size + 1}. by mass", color=INK, **choose_marker(size)
        )
        for size in sizes[: len(SIZE_MARKERS)]
    ]


def draw_material_lines(
    axes: "Axes", rows: Sequence[FigureRow], x: str, y: str, looks: dict[str, Look]
) -> None:
    """Join the samples of each material, thinly: the eye finds them."""
    for material, look in looks.items():
        points = sorted(
            (getattr(row, x), getattr(row, y)) for row in rows if row.material == material
        )
        if len(points) > 1:
            axes.plot(
                *zip(*points, strict=True),
                color=look.colour,
                linestyle=look.dashes,
                linewidth=1.0,
                zorder=1.5,
            )
