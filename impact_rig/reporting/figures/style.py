"""The look that all panels share: size, ink, fonts, lines."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

INK = "#010203"
"""Stands for the page's ink until the figure is rendered: a colour that nothing else has."""
PANEL_WIDTH = 340.0
"""[pt], our choice: about the width of a phone, where the text then has its own size."""
POINTS_PER_INCH = 72.0
LEGEND_ROW = 14.5
"""Height of a line of a legend [pt]."""
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


def add_legend(panel: "Figure", *columns: "Sequence[Artist]") -> None:
    """Put a legend below the axes, its columns filled from the top."""
    from matplotlib.lines import Line2D

    lines = max(map(len, columns))
    blank = Line2D([], [], linestyle="none", label=" ")
    panel.legend(
        handles=[
            handle for column in columns for handle in (*column, *[blank] * (lines - len(column)))
        ],
        loc="outside lower left",
        ncols=len(columns),
        alignment="left",
        borderaxespad=0.0,
        labelspacing=0.3,
    )
