"""How samples are told apart: a material has its colour and its dashes, a size its marker."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from impact_rig.reporting.figures.names import LONGEST_NAME, shorten_name
from impact_rig.reporting.figures.panel import LONGEST_COLUMN
from impact_rig.reporting.figures.style import INK
from impact_rig.results.figure_rows import FigureRow
from impact_rig.results.palette import BLUE, GREEN, GREY, PURPLE, VERMILION, Colour, format_hex

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

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


def find_looks(names: Sequence[str]) -> dict[str, Look]:
    """Return the look of every series by its name, in the order of the names."""
    return {
        name: Look(
            format_hex(SERIES_COLOURS[place % len(SERIES_COLOURS)]),
            SERIES_DASHES[place % len(SERIES_DASHES)],
        )
        for place, name in enumerate(dict.fromkeys(names))
    }


def find_marker(place: int) -> dict[str, Any]:
    """Return the marker of the samples at one place among those of their material."""
    marker = SIZE_MARKERS[place % len(SIZE_MARKERS)]
    size = MARKER_SIZES.get(marker, MARKER_SIZE)
    return {"marker": marker, "markersize": size, "linestyle": "none"}


def make_material_handles(looks: dict[str, Look]) -> "list[Artist]":
    """Return the lines that a legend shows for the materials."""
    from matplotlib.lines import Line2D

    longest = LONGEST_NAME if len(looks) <= LONGEST_COLUMN else LONGEST_IN_TWO_COLUMNS
    return [
        Line2D([], [], color=look.colour, linestyle=look.dashes, label=shorten_name(name, longest))
        for name, look in looks.items()
    ]


def make_size_handles(rows: Sequence[FigureRow]) -> "list[Artist]":
    """Return the markers that a legend shows for the sizes; none if there is only one."""
    from matplotlib.lines import Line2D

    sizes = sorted({row.size for row in rows})
    if len(sizes) == 1:
        return []
    names = SIZE_NAMES if sizes[-1] < len(SIZE_NAMES) else ()
    return [
        Line2D(
            [],
            [],
            color=INK,
            **find_marker(size),
            label=names[size] if names else f"{size + 1}. by mass",
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
