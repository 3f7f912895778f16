"""Fig. 3: the pulse width of every hit against the relative mass, the paper's points beside."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from impact_rig.reporting.figures.figure import ReportFigure, make_missing_figure
from impact_rig.reporting.figures.looks import (
    Look,
    draw_material_lines,
    find_looks,
    find_marker,
    make_material_handles,
    make_size_handles,
)
from impact_rig.reporting.figures.names import make_name
from impact_rig.reporting.figures.panel import (
    make_named_panel,
    make_panel,
    split_into_columns,
)
from impact_rig.reporting.figures.style import (
    INK,
    drawing_style,
)
from impact_rig.reporting.figures.vector import render_panels
from impact_rig.reporting.figures.words import format_count
from impact_rig.results.figure_rows import FigureRow
from impact_rig.results.numbers import MICRO, compute_difference, format_number, format_uncertain
from impact_rig.results.references import explain_misprint

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TITLE = "Fig. 3. Pulse width against relative mass"
GRAM = 1e3
"""Kilograms to grams."""
AXES_HEIGHT = 215.0
ROW_HEIGHT = 17.0
"""Of the axes, and of one sample's line [pt]."""
RING_GROWTH = 2.1
"""How much larger than our point the published one is [-]: both are seen."""
MARGIN = 1.12
"""Room at the end of the axis of differences [-]."""
SMALLEST_RANGE = 0.02
"""Least that the axis of pulse widths shows either side of its middle, part of that [-]."""
SMALLEST_LIMIT = 0.1
"""End of that axis if all hits are alike [us]."""


def draw_figure_3(rows: Sequence[FigureRow], *, prefix: str = "") -> ReportFigure:
    """Draw tau_p over m_eq, and the hits of each sample as differences from their mean.

    Parameters
    ----------
    rows : sequence of FigureRow
        See `make_figure_rows`.
    prefix : str
        Put before the figure's name.

    Returns
    -------
    ReportFigure
        Not drawn if no sample has both a contact time and a relative mass.
    """
    name = make_name(prefix, "figure 3")
    placed = [
        _scale(row)
        for row in rows
        if math.isfinite(row.relative_mass) and math.isfinite(row.contact_time)
    ]
    if not placed:
        return make_missing_figure(name, TITLE, _explain_missing(rows))
    with drawing_style():
        svg = render_panels(name, _draw_panels(placed))
    left_out = [row.name for row in rows if row.name not in {item.name for item in placed}]
    return ReportFigure(name, TITLE, svg, _describe(placed), _explain(placed, left_out))


def _scale(row: FigureRow) -> FigureRow:
    """Return the row in grams and microseconds."""
    return replace(
        row,
        relative_mass=row.relative_mass * GRAM,
        contact_times=tuple(time * MICRO for time in row.contact_times),
        contact_time=row.contact_time * MICRO,
        contact_time_expanded=row.contact_time_expanded * MICRO,
        reference=replace(row.reference, contact_time=row.reference.contact_time * MICRO),
    )


def _draw_panels(rows: Sequence[FigureRow]) -> "tuple[Figure, Figure]":
    looks = find_looks([row.material for row in rows])
    marks = [*make_size_handles(rows), *_make_mark_handles(rows, "_")]
    columns = [*split_into_columns(make_material_handles(looks)), marks]
    # As high as the higher of the two: they stand beside each other.
    height = max(AXES_HEIGHT, ROW_HEIGHT * len(rows))
    return _draw_widths(rows, looks, columns, height), _draw_scatter(rows, looks, height)


def _draw_widths(
    rows: Sequence[FigureRow],
    looks: dict[str, Look],
    columns: "Sequence[Sequence[Artist]]",
    height: float,
) -> "Figure":
    panel = make_panel([height], columns)
    axes = panel.axes[0]
    draw_material_lines(axes, rows, "relative_mass", "contact_time", looks)
    for place, row in enumerate(rows):
        _draw_width(axes, place, row, looks[row.material])
    low, high = axes.get_ylim()
    middle = 0.5 * (low + high)
    half = max(0.5 * (high - low), SMALLEST_RANGE * middle)
    axes.set_ylim(middle - half, middle + half)
    axes.set_title("a) all samples")
    axes.set_xlabel("relative mass m1 m2 / (m1 + m2) [g]")
    axes.set_ylabel("pulse width τp [µs]")
    return panel


def _draw_width(axes: "Axes", place: int, row: FigureRow, look: Look) -> None:
    axes.plot(
        [row.relative_mass] * len(row.contact_times),
        row.contact_times,
        **_make_tick("_", look.colour),
        gid=f"hits-{place}",
    )
    bar = [row.contact_time + sign * row.contact_time_expanded for sign in (-1.0, 1.0)]
    axes.plot([row.relative_mass] * 2, bar, color=look.colour, gid=f"bar-{place}")
    axes.plot(
        [row.relative_mass],
        [row.contact_time],
        color=look.colour,
        **find_marker(row.size),
        gid=f"mean-{place}",
    )
    if math.isfinite(row.reference.contact_time):
        axes.plot(
            [row.relative_mass],
            [row.reference.contact_time],
            **_make_ring(row.size),
            gid=f"reference-{place}",
        )


def _draw_scatter(rows: Sequence[FigureRow], looks: dict[str, Look], height: float) -> "Figure":
    """Draw what no common axis can show: hits differ by less than the height of a point."""
    marks = [[mark] for mark in _make_mark_handles(rows, "|")]
    panel = make_named_panel([row.name for row in rows], height, marks)
    axes = panel.axes[0]
    limit = _find_limit(rows)
    axes.set_xlim(-limit, limit)
    axes.axvline(0.0, color=INK, linewidth=0.8, alpha=0.5)
    for place, row in enumerate(rows):
        _draw_differences(axes, place, row, looks[row.material], limit)
    axes.set_title("b) the same, less each sample's mean")
    axes.set_xlabel("difference from the mean's τp [µs]")
    return panel


def _draw_differences(axes: "Axes", place: int, row: FigureRow, look: Look, limit: float) -> None:
    axes.plot(
        [time - row.contact_time for time in row.contact_times],
        [place] * len(row.contact_times),
        **_make_tick("|", look.colour),
        gid=f"differences-{place}",
    )
    bar = [-row.contact_time_expanded, row.contact_time_expanded]
    axes.plot(bar, [place] * 2, color=look.colour, gid=f"bar-{place}")
    axes.plot([0.0], [place], color=look.colour, **find_marker(row.size))
    reference = row.reference.contact_time - row.contact_time
    if abs(reference) <= limit:
        axes.plot([reference], [place], **_make_ring(row.size))
    elif math.isfinite(reference):
        # Too far away for this axis: an arrow at its end.
        axes.plot(
            [math.copysign(limit, reference)],
            [place],
            marker=">" if reference > 0.0 else "<",
            color=INK,
            markersize=5.0,
            clip_on=False,
        )


def _find_limit(rows: Sequence[FigureRow]) -> float:
    """Return the end of the axis of differences [us]: every hit and every bar is on it."""
    differences = [abs(time - row.contact_time) for row in rows for time in row.contact_times]
    bars = [row.contact_time_expanded for row in rows if math.isfinite(row.contact_time_expanded)]
    return MARGIN * max([*differences, *bars, SMALLEST_LIMIT])


def _make_tick(marker: str, colour: str) -> dict[str, Any]:
    """Return the mark of one hit: thin, so that ten of them are ten."""
    return {
        "linestyle": "none",
        "marker": marker,
        "markersize": 13.0,
        "color": colour,
        "markeredgewidth": 0.6,
    }


def _make_ring(size: int) -> dict[str, Any]:
    """Return the mark of a published value: it is seen around our point when they agree."""
    marker = find_marker(size)
    return {
        **marker,
        "markersize": RING_GROWTH * marker["markersize"],
        "markerfacecolor": "none",
        "markeredgecolor": INK,
        "markeredgewidth": 0.7,
    }


def _make_mark_handles(rows: Sequence[FigureRow], tick: str) -> "list[Artist]":
    from matplotlib.lines import Line2D

    handles: list[Artist] = [
        Line2D([], [], **_make_tick(tick, INK), label="one hit"),
        Line2D([], [], color=INK, **find_marker(0), label="mean, 95 % bar"),
    ]
    if any(math.isfinite(row.reference.contact_time) for row in rows):
        handles.append(Line2D([], [], **_make_ring(0), label=_name_reference(rows)))
    return handles


def _name_reference(rows: Sequence[FigureRow], otherwise: str = "expected") -> str:
    expected = [row.reference for row in rows if math.isfinite(row.reference.contact_time)]
    return "the paper's" if all(item.is_published for item in expected) else otherwise


def _explain_missing(rows: Sequence[FigureRow]) -> str:
    if not any(math.isfinite(row.contact_time) for row in rows):
        return "No sample has a pulse width."
    return "The relative mass needs the masses of hammer and samples."


def _describe(rows: Sequence[FigureRow]) -> str:
    shortest = min(rows, key=lambda row: row.contact_time)
    longest = max(rows, key=lambda row: row.contact_time)
    hits = sum(len(row.contact_times) for row in rows)
    text = (
        f"Pulse width τp of {format_count(hits, 'hit')} on {format_count(len(rows), 'sample')}"
        f" against the relative mass: {_describe_row(shortest)}"
    )
    text += "." if len(rows) == 1 else f" to {_describe_row(longest)}."
    differences = [
        (abs(compute_difference(row.contact_time, row.reference.contact_time)), row.name)
        for row in rows
        if math.isfinite(row.reference.contact_time)
    ]
    if differences:
        percent, name = max(differences)
        reference = _name_reference(rows, "the expected")
        text += f" Largest difference from {reference} value: {percent:.2f} % ({name})."
    return text


def _describe_row(row: FigureRow) -> str:
    time = format_uncertain(row.contact_time, row.contact_time_expanded, 2)
    return f"{time} µs at {format_number(row.relative_mass, 1)} g ({row.name})"


def _explain(rows: Sequence[FigureRow], left_out: Sequence[str]) -> str:
    ring = ""
    if any(math.isfinite(row.reference.contact_time) for row in rows):
        ring = f", the large hollow one {_name_reference(rows, 'the expected')} value"
    text = (
        "a) Each tick is one hit, the filled point the mean hit of a sample with its 95 %"
        f" interval{ring}. Colour and dashes stand for the material, markers for the sizes. b)"
        " The same as differences from the mean of the sample."
    )
    limit = _find_limit(rows)
    if any(abs(row.reference.contact_time - row.contact_time) > limit for row in rows):
        text += " An arrow stands for a value that lies beyond the axis."
    sentences = [text]
    if left_out:
        sentences.append(f"Not shown, for want of a mass or a pulse width: {', '.join(left_out)}.")
    sentences += [
        explain_misprint(row.reference.published).removeprefix("* ")
        for row in rows
        if row.reference.published is not None and row.reference.is_misprinted
    ]
    return " ".join(sentences)
