"""How the figures look: sizes, ink, colours, markers, and what all panels have in common."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from impact_rig.results.figure_rows import FigureRow
from impact_rig.results.palette import BLUE, GREEN, GREY, PURPLE, VERMILION, Colour, format_hex

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = "#010203"
"""Stands for the page's ink until the figure is rendered: a colour that nothing else has."""
PANEL_WIDTH = 340.0
"""[pt], our choice: about the width of a phone, where the text then has its own size."""
POINTS_PER_INCH = 72.0
LONGEST_NAME = 20
"""Characters of a sample's name in a figure [-], our choice: a third of a panel."""
SERIES_COLOURS: tuple[Colour, ...] = (BLUE, VERMILION, GREEN, PURPLE, GREY)
"""Those of `palette.MATERIALS`, in its order, that stand out from a white and from a black ground
(3:1, WCAG 2.2, 1.4.11), and grey."""
SERIES_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (1, 1.2)))
"""As many as have no common divisor with the colours: twenty materials differ."""
SIZE_MARKERS = ("s", "^", "*", "o", "D", "v", "P", "X")
"""Of a material's samples by mass: the paper's squares, triangles and stars first."""
SIZE_NAMES = ("small", "medium", "large")
GRID_OPACITY = 0.18
"""[-], our choice: seen when looked for."""
STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",  # text stays text
    "svg.hashsalt": "impact-rig report",  # the same results give the same file
    "text.parse_math": False,  # a sample may be called "$x$"
    "path.simplify": False,  # what is left out is decided in `decimation`
    "font.size": 10.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 10.0,
    "xtick.labelsize": 9.5,
    "ytick.labelsize": 9.5,
    "legend.fontsize": 9.5,
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


@dataclass(frozen=True)
class SeriesLook:
    """How a material looks wherever it is drawn.

    Attributes
    ----------
    colour : str
        ``#rrggbb``
    dashes : Any
        Of lines, as matplotlib takes them.
    """

    colour: str
    dashes: Any


@contextmanager
def drawing_style() -> Iterator[None]:
    """Draw in the report's style, whatever the user's own settings of matplotlib are."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


def make_panel(height: float) -> "Figure":
    """Return an empty panel, `height` points high; call it in `drawing_style`."""
    # The Figure itself, not pyplot: no screen, no state that outlives the call.
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    size = (PANEL_WIDTH / POINTS_PER_INCH, height / POINTS_PER_INCH)
    return Figure(figsize=size, layout=ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.03))


def find_looks(names: Sequence[str]) -> dict[str, SeriesLook]:
    """Return the look of every series, by name, in their order."""
    return {
        name: SeriesLook(
            format_hex(SERIES_COLOURS[place % len(SERIES_COLOURS)]),
            SERIES_DASHES[place % len(SERIES_DASHES)],
        )
        for place, name in enumerate(dict.fromkeys(names))
    }


def find_marker(row: FigureRow) -> str:
    """Return the marker of a sample: by its place among those of its material."""
    return SIZE_MARKERS[row.size % len(SIZE_MARKERS)]


def shorten_name(name: str) -> str:
    """Return a name that fits beside an axis, without characters that XML has not."""
    name = "".join(character if character.isprintable() else "\ufffd" for character in name)
    return name if len(name) <= LONGEST_NAME else name[: LONGEST_NAME - 1].rstrip() + "…"


def show_names(axes: "Axes", names: Sequence[str]) -> None:
    """Write names beside the places 0, 1, ... of the vertical axis, the first at the top."""
    axes.set_yticks(range(len(names)), [shorten_name(name) for name in names])
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)
    axes.grid(visible=False, axis="y")
