"""A figure of the report: panels drawn by matplotlib, as images for a page."""

import base64
import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",  # text stays text
    "svg.hashsalt": "impact-rig",  # the same results give the same file
    "text.parse_math": False,  # a sample may be called "$x$"
    "savefig.transparent": True,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlelocation": "left",
    "axes.titley": 1.0,  # fixed: placing each title takes a tenth of the time
    "axes.titlesize": "medium",
    "xtick.bottom": False,  # the grid marks the ticks
    "ytick.left": False,
    "grid.alpha": 0.2,
    "legend.fontsize": "small",
    "legend.frameon": False,
    "lines.linewidth": 1.2,
}
WIDTH = 4.8  # [inch], of a panel: two stand beside each other, on a phone one
LABEL = 0.28  # [inch], from axes to the label of the abscissa
MOST_TICKS = 6  # intervals of an axis: each tick takes time
LEFT, RIGHT, TOP, BOTTOM = 0.8, 0.1, 0.3, 0.95  # [inch], around axes; two rows of a legend


@dataclass(frozen=True)
class Panel:
    """One image of a figure."""

    url: str  # SVG as a data URL
    shows: str  # in words, for who does not see it


@dataclass(frozen=True)
class Picture:
    """A figure for a page."""

    title: str
    caption: str  # how to read it
    panels: tuple["Panel", ...]


def make_picture(title: str, caption: str, panels: "Iterable[Figure]") -> Picture:
    """Return a figure of panels, each of which may be drawn over the one before."""
    return Picture(title, caption, tuple(map(_embed, panels)))


@contextmanager
def drawing_style() -> Iterator[None]:
    """Draw in our style, whatever the user's settings of matplotlib are."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


def make_panel(*heights: float, left: float = LEFT, bottom: float = BOTTOM) -> "Figure":
    """Return a panel with axes below each other, of these heights [inch], on one abscissa.

    Its margins are fixed, since fitting them would take half the time of a report.
    """
    # The Figure itself, not pyplot: no screen, no state that outlives the call.
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, sum(heights) + TOP + bottom))
    panel: Figure = fill_panel(figure, *heights, left=left, bottom=bottom)
    return panel


def fill_panel(panel: Any, *heights: float, left: float = LEFT, bottom: float = BOTTOM) -> Any:
    """Make the axes of `make_panel` in a figure or subfigure of that size, and return it."""
    height = sum(heights) + TOP + bottom
    panel.subplots(len(heights), sharex=True, height_ratios=heights)
    panel.subplots_adjust(
        left / WIDTH, bottom / height, 1.0 - RIGHT / WIDTH, 1.0 - TOP / height, hspace=0.12
    )
    for axes, own in zip(panel.axes, heights, strict=True):
        axes.locator_params(nbins=MOST_TICKS)
        axes.locator_params(axis="y", nbins=min(MOST_TICKS, math.ceil(4.5 * own)))
        # Fixed as well: else each label is placed by all texts of its axis.
        axes.xaxis.set_label_coords(0.5, -LABEL / own)
        axes.yaxis.set_label_coords(-0.6 / (WIDTH - left - RIGHT), 0.5)
    return panel


_make_once = cache(make_panel)


def reuse_panel(*heights: float, left: float = LEFT, bottom: float = BOTTOM) -> "Figure":
    """Return a panel as `make_panel` does: the same one, cleared, for the same sizes.

    Axes and ticks take half the time of a panel.
    """
    panel = _make_once(*heights, left=left, bottom=bottom)
    for axes in panel.axes:
        for artist in (*axes.lines, *axes.patches, *axes.texts, *axes.collections):
            artist.remove()
        axes.containers.clear()
        axes.set_title("")
        axes.relim()
        axes.autoscale()
    for legend in panel.legends:
        legend.remove()
    return panel


def shorten_name(name: str, longest: int = 20) -> str:
    """Return a name shortened in its middle, without characters that XML forbids."""
    shown = "".join(letter if letter.isprintable() else "\ufffd" for letter in name)
    if len(shown) <= longest:
        return shown
    half = (longest - 1) // 2
    return f"{shown[:half]}…{shown[-half:]}"


def _embed(panel: "Figure") -> Panel:
    stream = BytesIO()
    panel.savefig(stream, format="svg", metadata={"Date": None})
    url = f"data:image/svg+xml;base64,{base64.b64encode(stream.getvalue()).decode()}"
    return Panel(url, "; below: ".join(map(_describe_axes, panel.axes)))


def _describe_axes(axes: "Axes") -> str:
    """Return title, axes and ranges of what is drawn, in words."""
    shown = f"{axes.get_ylabel()} over {axes.get_xlabel()}".removesuffix(" over ")
    title = axes.get_title("left")
    (first, low), (last, high) = axes.dataLim.min, axes.dataLim.max
    text = f"{title}: {shown}" if title else shown
    if axes.get_xlabel() and math.isfinite(last - first):
        text += f" from {first:.3g} to {last:.3g}"
    return f"{text}, {low:.3g} to {high:.3g}" if math.isfinite(high - low) else text
