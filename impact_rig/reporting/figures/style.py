"""The look that all panels share: size, ink, fonts, lines."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

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
    "path.simplify": False,  # what is left out is decided in `decimation`
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
