"""Writes a panel as SVG: the same panel gives the same characters, and its texts stay text."""

import base64
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from impact_rig.core.records import FloatArray
from impact_rig.present.picture import TICK, WIDTH, Curve, Look, Panel, Plot
from impact_rig.results.palette import GREEN, format_hex

UNIT = 10  # of the page per point: coordinates are whole numbers
FONT, SMALL = 10.0, 8.3  # [pt]
LETTER = 0.56  # width of a letter, of its height
LEFT, NAMED_LEFT, RIGHT, TOP = 56.0, 108.0, 8.0, 20.0  # [pt], around the axes
GAP = 9.0  # between plots below each other [pt]
ROW = 12.0  # of a legend [pt]
X_LEGEND = 16.0  # where its rows begin [pt]
KEY = 22.0  # line or marker in a legend [pt]
MARGIN = 0.05  # on either side of the curves, of their range
X_TICKS, Y_TICKS = 45.0, 20.0  # distances, at least [pt]
STEPS = ((1.0, 0), (2.0, 0), (2.5, 1), (5.0, 0), (10.0, -1))
"""Between ticks, in powers of ten, and their decimals."""
SHAPES = {
    "s": "M-1-1H1V1H-1Z",
    "^": "M0-1L1 1H-1Z",
    "o": "M-1 0a1 1 0 1 0 2 0a1 1 0 1 0-2 0Z",
    "D": "M0-1.2L1 0 0 1.2-1 0Z",
    "v": "M0 1L1-1H-1Z",
    "P": "M-.4-1H.4V-.4H1V.4H.4V1H-.4V.4H-1V-.4H-.4Z",
    "X": "M-1-.6L-.6-1 0-.4 .6-1 1-.6 .4 0 1 .6 .6 1 0 .4-.6 1-1 .6-.4 0Z",
    "*": "M0-1.2L.3-.4 1.2-.4 .5.2 .7 1 0 .5-.7 1-.5.2-1.2-.4-.3-.4Z",
    TICK: "M-1 0H1",
}
"""Markers of radius 1."""
GRID = Look("#808080", 0.8, opacity=0.2)
FRAME = Look(width=0.8)
Numbers = Sequence[float] | FloatArray


@dataclass(frozen=True)
class Axis:
    """One axis of a plot, and where its ends are on the page."""

    low: float
    high: float
    start: float  # [pt]
    stop: float  # [pt]
    is_logarithmic: bool = False

    def place(self, values: Numbers) -> FloatArray:
        """Return the places of values [pt]."""
        found, low, high = np.asarray(values, dtype=float), self.low, self.high
        if self.is_logarithmic:
            # An error bar may reach below zero.
            found, low, high = np.log(np.maximum(found, low)), math.log(low), math.log(high)
        return self.start + (found - low) / (high - low) * (self.stop - self.start)

    def list_ticks(self, distance: float) -> list[tuple[float, str]]:
        """Return round values and their texts, at least this far from each other [pt]."""
        least = (self.high - self.low) * distance / abs(self.stop - self.start)
        exponent = math.floor(math.log10(least))
        power = 10.0**exponent
        step, decimals = next((it * power, n) for it, n in STEPS if it * power >= least)
        digits = max(decimals - exponent, 0)
        first, last = math.ceil(self.low / step), math.floor(self.high / step)
        values = [number * step for number in range(first, last + 1)]
        return [(value, f"{value:z.{digits}f}".replace("-", "\N{MINUS SIGN}")) for value in values]


def embed(panel: Panel) -> str:
    """Return a panel as the URL of an image."""
    return f"data:image/svg+xml;base64,{base64.b64encode(draw(panel).encode()).decode()}"


def draw(panel: Panel) -> str:
    """Return a panel as SVG."""
    lowest = panel.plots[-1]
    left = NAMED_LEFT if lowest.y_ticks else LEFT
    curves = [curve for plot in panel.plots for curve in plot.curves]
    is_logarithmic = lowest.is_logarithmic
    low, high = _find_limits([(it.x, it.x_bars) for it in curves], is_logarithmic=is_logarithmic)
    x_axis = Axis(low, high, left, WIDTH - RIGHT, is_logarithmic)
    ticks = lowest.x_ticks or x_axis.list_ticks(X_TICKS)
    places = x_axis.place([value for value, _ in ticks]).tolist()
    parts: list[str] = []
    bottom = TOP - GAP
    for plot in panel.plots:
        top, bottom = bottom + GAP, bottom + GAP + plot.height
        parts += _draw_plot(plot, x_axis, (top, bottom), places)
    texts = zip(places, (text for _, text in ticks), strict=True)
    parts += [_write(x, bottom + 13.0, text, anchor="middle") for x, text in texts]
    middle = (left + WIDTH - RIGHT) / 2.0
    parts.append(_write(middle, bottom + 26.0, lowest.x_label, anchor="middle"))
    legend, bottom = _draw_legend(curves, bottom + 41.0)
    parts += legend
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH:.0f}pt" height="{bottom:.0f}pt"'
        f' viewBox="0 0 {UNIT * WIDTH:.0f} {UNIT * bottom:.0f}" font-family="sans-serif">'
        f"{''.join(parts)}</svg>"
    )


def _draw_plot(
    plot: Plot, x_axis: Axis, ends: tuple[float, float], x_ticks: Sequence[float]
) -> Iterator[str]:
    """Draw one plot between its upper and its lower end [pt]."""
    top, bottom = ends
    left, right = x_axis.start, x_axis.stop
    spans = [(curve.y, curve.y_bars) for curve in plot.curves]
    low, high = _find_limits(spans, is_logarithmic=plot.is_logarithmic)
    low = low if plot.floor is None else plot.floor
    y_axis = Axis(low, high, bottom, top, plot.is_logarithmic)
    ticks = plot.y_ticks or y_axis.list_ticks(min(Y_TICKS, plot.height / 4.0))
    heights = y_axis.place([value for value, _ in ticks]).tolist()
    if plot.band:
        start, stop = (UNIT * x_axis.place(plot.band)).round().tolist()
        yield (
            f'<rect x="{start:.0f}" y="{UNIT * top:.0f}" width="{stop - start:.0f}"'
            f' height="{UNIT * plot.height:.0f}" fill="{format_hex(GREEN)}" fill-opacity=".13"/>'
        )
    for x in x_ticks:
        yield _join([x, x], [top, bottom], GRID)
    for y in heights:
        yield _join([left, right], [y, y], GRID)
    yield _join([left, left, right], [top, bottom, bottom], FRAME)
    for curve in plot.curves:
        yield from _draw_curve(curve, x_axis, y_axis)
    for y, (_, text) in zip(heights, ticks, strict=True):
        yield _write(left - 4.0, y + 3.5, text, anchor="end")
    for item in plot.texts:
        (x,), (y,) = x_axis.place([item.x]).tolist(), y_axis.place([item.y]).tolist()
        yield _write(x + 5.0, y - 3.0, item.text)
    for number, text in enumerate(plot.corner, start=1):
        yield _write(right - 2.0, top + ROW * number, text, anchor="end")
    yield _write(left, TOP - 6.0, plot.title)
    yield _write(10.0, (top + bottom) / 2.0, plot.y_label, anchor="middle", is_upright=True)


def _draw_curve(curve: Curve, x_axis: Axis, y_axis: Axis) -> Iterator[str]:
    look = curve.look
    x, y = x_axis.place(curve.x), y_axis.place(curve.y)
    if look.width:
        yield _join(x, y, look)
    bar = Look(look.colour)
    for place, value, half in zip(y, curve.x, curve.x_bars, strict=False):
        yield _join(x_axis.place([value - half, value + half]), [place, place], bar)
    for place, value, half in zip(x, curve.y, curve.y_bars, strict=False):
        yield _join([place, place], y_axis.place([value - half, value + half]), bar)
    if look.marker:
        for point in zip(x.tolist(), y.tolist(), strict=True):
            yield _mark(*point, look)


def _draw_legend(curves: Iterable[Curve], top: float) -> tuple[list[str], float]:
    """Draw the named looks row by row; return them and where they end [pt]."""
    looks: dict[str, Look] = {}
    for curve in curves:
        looks.setdefault(curve.name, curve.look)
    parts: list[str] = []
    x, y = X_LEGEND, top
    for name, look in looks.items():
        if not name:
            continue
        width = KEY + LETTER * SMALL * len(name) + ROW
        if x > X_LEGEND and x + width > WIDTH:
            x, y = X_LEGEND, y + ROW
        if look.width:
            parts.append(_join([x, x + KEY - 5.0], [y - 3.0, y - 3.0], look))
        if look.marker:
            parts.append(_mark(x + KEY / 2.0 - 2.5, y - 3.0, look))
        parts.append(_write(x + KEY, y, name, size=SMALL))
        x += width
    return parts, y + 5.0


def _find_limits(
    spans: Iterable[tuple[Numbers, Numbers]], *, is_logarithmic: bool
) -> tuple[float, float]:
    """Return the ends of an axis, by values and the half-lengths of their error bars."""
    ends: list[FloatArray] = [np.zeros(0)]
    for values, bars in spans:
        middle, half = np.asarray(values, dtype=float), np.asarray(bars, dtype=float)
        ends += [middle - half, middle + half] if half.size else [middle]
    found = np.concatenate(ends)
    found = found[np.isfinite(found)]
    if is_logarithmic:
        found = np.log(found[found > 0.0])
    low, high = (float(found.min()), float(found.max())) if found.size else (0.0, 1.0)
    is_wide = high - low > 1e-9 * abs(high)
    margin = MARGIN * ((high - low) if is_wide else abs(high) or 1.0)
    limits = low - margin, high + margin
    return (math.exp(limits[0]), math.exp(limits[1])) if is_logarithmic else limits


def _join(x: Numbers, y: Numbers, look: Look) -> str:
    """Return a line through points [pt]."""
    points = np.rint(UNIT * np.stack((x, y), axis=1))
    # A trace is level for long: of such a part the ends are enough.
    across, up = np.diff(points, axis=0).T
    is_kept = np.ones(len(points), dtype=bool)
    is_kept[1:-1] = (up[1:] != 0.0) | (up[:-1] != 0.0) | (across[1:] * across[:-1] <= 0.0)
    points = points[is_kept]
    is_known = np.isfinite(points).all(axis=1)
    pieces = np.split(points, np.flatnonzero(np.diff(is_known)) + 1)
    shown = [piece.astype(int).ravel().tolist() for piece in pieces if np.isfinite(piece).all()]
    path = "".join(f"M{' '.join(map(str, numbers))}" for numbers in shown)
    dashes = " ".join(f"{UNIT * length:g}" for length in look.dashes)
    return (
        f'<path d="{path}" fill="none" stroke="{look.colour}" stroke-width="{UNIT * look.width:g}"'
        f"{f' stroke-dasharray={chr(34)}{dashes}{chr(34)}' * bool(dashes)}"
        f"{f' opacity={chr(34)}{look.opacity:g}{chr(34)}' * (look.opacity < 1.0)}/>"
    )


def _mark(x: float, y: float, look: Look) -> str:
    """Return a marker at a point [pt]; nothing where there is none."""
    if not (math.isfinite(x) and math.isfinite(y)):
        return ""
    radius = UNIT * look.size / 2.0
    fill = "none" if look.is_hollow or look.marker == TICK else look.colour
    return (
        f'<path transform="translate({UNIT * x:.0f} {UNIT * y:.0f}) scale({radius:g})"'
        f' d="{SHAPES[look.marker]}" fill="{fill}" stroke="{look.colour}"'
        f' stroke-width="{UNIT / radius:.2g}"/>'
    )


def _write(
    x: float,
    y: float,
    text: str,
    *,
    anchor: str = "start",
    size: float = FONT,
    is_upright: bool = False,
) -> str:
    """Return a text that begins, is centred or ends at a point [pt]."""
    place = f"{UNIT * x:.0f} {UNIT * y:.0f}"
    turned = " rotate(-90)" * is_upright
    return (
        f'<text transform="translate({place}){turned}" text-anchor="{anchor}"'
        f' font-size="{UNIT * size:g}">{escape(text)}</text>'
    )
