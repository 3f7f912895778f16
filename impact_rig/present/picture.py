"""A figure of the report as data: panels of plots, apart from what draws them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.records import FloatArray

WIDTH = 346.0  # [pt], of a panel: two stand beside each other, on a phone one
COLUMNS = 280  # of a panel's plots, a point wide each
BLACK = "#000000"


@dataclass(frozen=True)
class Look:
    """How points are shown: joined, marked, or both. Lengths are in points."""

    colour: str = BLACK
    width: float = 1.2  # of the line; 0: none
    dashes: tuple[float, ...] = ()  # lengths of strokes and gaps; empty: solid
    opacity: float = 1.0
    marker: str = ""  # one of `MARKERS` or `TICK`; empty: none
    size: float = 5.0  # of the marker
    is_hollow: bool = False


MARKERS = "s^oDvPX*"
"""Of series, as matplotlib calls them."""
TICK = "_"


@dataclass(frozen=True)
class Curve:
    """Points of one look. Curves of one name share their entry in the legend."""

    x: Sequence[float] | FloatArray
    y: Sequence[float] | FloatArray  # a NaN breaks the line
    look: Look
    name: str = ""  # in the legend; empty: not there
    x_bars: Sequence[float] = ()  # half-lengths of error bars; empty: none
    y_bars: Sequence[float] = ()


@dataclass(frozen=True)
class Text:
    """Text beside a point."""

    x: float
    y: float
    text: str


@dataclass(frozen=True)
class Plot:
    """Curves in one pair of axes."""

    curves: tuple[Curve, ...]
    height: float  # [pt]
    title: str = ""
    x_label: str = ""
    y_label: str = ""
    texts: tuple[Text, ...] = ()
    corner: tuple[str, ...] = ()  # lines of text at the upper right
    band: tuple[float, float] | None = None  # what is shaded of the abscissa
    floor: float | None = None  # least ordinate that is shown; None: by the curves
    is_logarithmic: bool = False  # both axes
    x_ticks: tuple[tuple[float, str], ...] = ()  # values and their names; empty: round numbers
    y_ticks: tuple[tuple[float, str], ...] = ()


@dataclass(frozen=True)
class Panel:
    """Plots below each other, on one abscissa, over one legend."""

    plots: tuple[Plot, ...]


@dataclass(frozen=True)
class Picture:
    """A figure for a page."""

    title: str
    caption: str  # how to read it
    panels: tuple[Panel, ...]


def thin(values: FloatArray) -> NDArray[np.intp]:
    """Return the places of the least and the largest value in each column of a plot.

    Parameters
    ----------
    values : ndarray, shape (n,)
        At equal distances.
    """
    step = max(values.size // COLUMNS, 1)
    whole = values.size // step * step
    rows = np.nan_to_num(values[:whole].reshape(-1, step))
    ends = np.stack((rows.argmin(axis=1), rows.argmax(axis=1)), axis=1)
    places = ends + np.arange(0, whole, step)[:, np.newaxis]
    return np.unique(places)


def shorten_name(name: str, longest: int = 20) -> str:
    """Return a name shortened in its middle, without characters that XML forbids."""
    shown = "".join(letter if letter.isprintable() else "\ufffd" for letter in name)
    if len(shown) <= longest:
        return shown
    half = (longest - 1) // 2
    return f"{shown[:half]}…{shown[-half:]}"
