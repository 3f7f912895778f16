"""The campaign's figures in the paper's manner: Figs. 3 to 6, the paper's points beside."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from impact_rig.core.signals.record import FloatArray
from impact_rig.present.figures import panels
from impact_rig.present.figures.markup import (
    ReportFigure,
    make_figure,
    make_missing_figure,
    make_name,
)
from impact_rig.present.figures.panels import INK, Look
from impact_rig.present.figures.trace_span import choose_span, cut_trace
from impact_rig.results.campaign import Results
from impact_rig.results.figure_rows import (
    ERRORS,
    LARGEST_ERRORS_PERCENT,
    PEAKS,
    FigureRow,
    describe_figure_6b,
    make_figure_rows,
    sort_as_figure_5,
)
from impact_rig.results.numbers import (
    MICRO,
    compute_difference,
    format_count,
    format_number,
    format_percent,
    format_uncertain,
)
from impact_rig.results.palette import VERMILION, format_hex
from impact_rig.results.references import explain_misprint
from impact_rig.results.sample_traces import DRIVEN, ModelTraces, SampleTraces

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TITLES = (
    "Fig. 3. Pulse width against relative mass",
    "Fig. 4. Maximum amplitude against pulse width",
    "Fig. 5. Model and measured response",
    "Fig. 6. Mean square error between model and measurement",
)
PANEL_TITLES = {"hammer": "a) hammer", "sample": "b) samples"}
"""Of Figs. 4 to 6, by body."""
ROW_HEIGHT = 17.0
"""Of one sample's line or bar with its room [pt]."""


def draw_campaign_figures(
    results: Results, samples: Sequence[SampleTraces]
) -> tuple[ReportFigure, ...]:
    """Draw Figs. 3 to 6 of the paper for one campaign.

    Parameters
    ----------
    results : Results
        What was found.
    samples : sequence of SampleTraces
        Mean hits and models; empty where only results are known.

    Returns
    -------
    tuple of ReportFigure
        Figs. 3, 4, 5, 6. One for which there is nothing to draw has an empty `svg`, and its
        caption says why.

    Raises
    ------
    ParameterError
        If the results name a sample that is not in their set-up.
    """
    rows = make_figure_rows(results)
    return (
        draw_figure_3(rows),
        draw_figure_4(rows),
        draw_figure_5(samples),
        draw_figure_6(rows),
    )


GRAM = 1e3
"""Kilograms to grams."""
HEIGHT_3 = 215.0
"""Of the axes of Fig. 3 at least [pt]."""
RING_GROWTH = 2.1
"""How much larger than our point the published one is [-]: both are seen."""
MARGIN = 1.12
"""Room at the end of the axis of differences [-]."""
SMALLEST_RANGE = 0.02
"""Least that the axis of pulse widths shows either side of its middle, part of that [-]."""
SMALLEST_LIMIT = 0.1
"""End of the axis of differences if all hits are alike [us]."""


def draw_figure_3(rows: Sequence[FigureRow]) -> ReportFigure:
    """Draw tau_p over m_eq, and the hits of each sample as differences from their mean.

    Not drawn if no sample has both a contact time and a relative mass.
    """
    name, title = make_name("figure 3"), TITLES[0]
    placed = [
        _scale(row)
        for row in rows
        if math.isfinite(row.relative_mass) and math.isfinite(row.contact_time)
    ]
    if not placed:
        has_times = any(math.isfinite(row.contact_time) for row in rows)
        reason = "The relative mass needs the masses of hammer and samples."
        return make_missing_figure(
            name, title, reason if has_times else "No sample has a pulse width."
        )
    left_out = [row.name for row in rows if row.name not in {item.name for item in placed}]
    caption = _explain_widths(placed, left_out)
    return make_figure(
        name, title, lambda: _draw_widths(placed), _describe_widths(placed), caption
    )


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


def _draw_widths(rows: Sequence[FigureRow]) -> "tuple[Figure, Figure]":
    looks = panels.choose_looks([row.material for row in rows])
    marks = [*panels.make_size_handles(rows), *_make_mark_handles(rows, "_")]
    columns = [*panels.split_into_columns(panels.make_material_handles(looks)), marks]
    # As high as the higher of the two: they stand beside each other.
    height = max(HEIGHT_3, ROW_HEIGHT * len(rows))
    left = panels.make_panel([height], columns)
    axes = left.axes[0]
    panels.draw_material_lines(axes, rows, "relative_mass", "contact_time", looks)
    for place, row in enumerate(rows):
        _draw_width(axes, place, row, looks[row.material])
    low, high = axes.get_ylim()
    middle = 0.5 * (low + high)
    half = max(0.5 * (high - low), SMALLEST_RANGE * middle)
    axes.set_ylim(middle - half, middle + half)
    axes.set(
        title="a) all samples",
        xlabel="relative mass m1 m2 / (m1 + m2) [g]",
        ylabel="pulse width τp [µs]",
    )
    # What no common axis can show: hits differ by less than the height of a point.
    marks = _make_mark_handles(rows, "|")
    right = panels.make_named_panel([row.name for row in rows], height, [[mark] for mark in marks])
    axes = right.axes[0]
    limit = _compute_limit(rows)
    axes.set_xlim(-limit, limit)
    axes.axvline(0.0, color=INK, linewidth=0.8, alpha=0.5)
    for place, row in enumerate(rows):
        _draw_differences(axes, place, row, looks[row.material], limit)
    axes.set(
        title="b) the same, less each sample's mean", xlabel="difference from the mean's τp [µs]"
    )
    return left, right


def _draw_width(axes: "Axes", place: int, row: FigureRow, look: Look) -> None:
    mass, marker = [row.relative_mass], panels.choose_marker(row.size)
    axes.plot(
        mass * len(row.contact_times),
        row.contact_times,
        **_make_tick("_", look.colour),
        gid=f"hits-{place}",
    )
    bar = [row.contact_time + sign * row.contact_time_expanded for sign in (-1.0, 1.0)]
    axes.plot(mass * 2, bar, color=look.colour, gid=f"bar-{place}")
    axes.plot(mass, [row.contact_time], color=look.colour, **marker, gid=f"mean-{place}")
    if math.isfinite(row.reference.contact_time):
        ring = _make_ring(row.size)
        axes.plot(mass, [row.reference.contact_time], **ring, gid=f"reference-{place}")


def _draw_differences(axes: "Axes", place: int, row: FigureRow, look: Look, limit: float) -> None:
    axes.plot(
        [time - row.contact_time for time in row.contact_times],
        [place] * len(row.contact_times),
        **_make_tick("|", look.colour),
        gid=f"differences-{place}",
    )
    bar = [-row.contact_time_expanded, row.contact_time_expanded]
    axes.plot(bar, [place] * 2, color=look.colour, gid=f"bar-{place}")
    axes.plot([0.0], [place], color=look.colour, **panels.choose_marker(row.size))
    reference = row.reference.contact_time - row.contact_time
    if abs(reference) <= limit:
        axes.plot([reference], [place], **_make_ring(row.size))
    elif math.isfinite(reference):
        # Too far away for this axis: an arrow at its end.
        arrow = ">" if reference > 0.0 else "<"
        end = [math.copysign(limit, reference)]
        axes.plot(end, [place], marker=arrow, color=INK, markersize=5.0, clip_on=False)


def _compute_limit(rows: Sequence[FigureRow]) -> float:
    """Return the end of the axis of differences [us]: every hit and every bar is on it."""
    differences = [abs(time - row.contact_time) for row in rows for time in row.contact_times]
    bars = [row.contact_time_expanded for row in rows if math.isfinite(row.contact_time_expanded)]
    return MARGIN * max([*differences, *bars, SMALLEST_LIMIT])


def _make_tick(marker: str, colour: str) -> dict[str, Any]:
    """Return the mark of one hit: thin, so that ten of them are ten."""
    look: dict[str, Any] = {"linestyle": "none", "markersize": 13.0, "markeredgewidth": 0.6}
    return {**look, "marker": marker, "color": colour}


def _make_ring(size: int) -> dict[str, Any]:
    """Return the mark of a published value: it is seen around our point when they agree."""
    marker = panels.choose_marker(size)
    edge = {"markerfacecolor": "none", "markeredgecolor": INK, "markeredgewidth": 0.7}
    return {**marker, **edge, "markersize": RING_GROWTH * marker["markersize"]}


def _make_mark_handles(rows: Sequence[FigureRow], tick: str) -> "list[Artist]":
    handles: list[Artist] = [
        panels.make_handle("one hit", **_make_tick(tick, INK)),
        panels.make_handle("mean, 95 % bar", color=INK, **panels.choose_marker(0)),
    ]
    if any(math.isfinite(row.reference.contact_time) for row in rows):
        handles.append(panels.make_handle(_name_reference(rows), **_make_ring(0)))
    return handles


def _name_reference(rows: Sequence[FigureRow], otherwise: str = "expected") -> str:
    expected = [row.reference for row in rows if math.isfinite(row.reference.contact_time)]
    return "the paper's" if all(item.is_published for item in expected) else otherwise


def _describe_widths(rows: Sequence[FigureRow]) -> str:
    ends = [choose(rows, key=lambda row: row.contact_time) for choose in (min, max)]
    described = [
        f"{format_uncertain(row.contact_time, row.contact_time_expanded, 2)} µs at"
        f" {format_number(row.relative_mass, 1)} g ({row.name})"
        for row in ends[: len(rows)]
    ]
    hits = sum(len(row.contact_times) for row in rows)
    text = (
        f"Pulse width τp of {format_count(hits, 'hit')} on {format_count(len(rows), 'sample')}"
        f" against the relative mass: {' to '.join(described)}."
    )
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


def _explain_widths(rows: Sequence[FigureRow], left_out: Sequence[str]) -> str:
    ring = ""
    if any(math.isfinite(row.reference.contact_time) for row in rows):
        ring = f", the large hollow one {_name_reference(rows, 'the expected')} value"
    text = (
        "a) Each tick is one hit, the filled point the mean hit of a sample with its 95 %"
        f" interval{ring}. Colour and dashes stand for the material, markers for the sizes. b)"
        " The same as differences from the mean of the sample."
    )
    sentences = [text]
    limit = _compute_limit(rows)
    if any(abs(row.reference.contact_time - row.contact_time) > limit for row in rows):
        sentences.append("An arrow stands for a value that lies beyond the axis.")
    if left_out:
        sentences.append(f"Not shown, for want of a mass or a pulse width: {', '.join(left_out)}.")
    sentences += [
        explain_misprint(row.reference.published).removeprefix("* ")
        for row in rows
        if row.reference.published is not None and row.reference.is_misprinted
    ]
    return " ".join(sentences)


HEIGHT_4 = 190.0
"""Of the axes of Fig. 4 [pt]."""
CAPTION_4 = (
    "Largest acceleration of the mean hit against the pulse width. Colour and dashes stand for"
    " the material, squares, triangles and stars for the sizes, as in the paper, which prints this"
    " figure without numbers: there is nothing to lay beside it."
)


def draw_figure_4(rows: Sequence[FigureRow]) -> ReportFigure:
    """Draw the largest accelerations of the mean hits over tau_p, hammer and samples apart.

    Not drawn if no sample has both a pulse width and an amplitude.
    """
    name, title = make_name("figure 4"), TITLES[1]
    rows = [replace(row, contact_time=row.contact_time * MICRO) for row in rows]
    looks = panels.choose_looks([row.material for row in rows])
    shown = {
        body: [
            row
            for row in rows
            if math.isfinite(row.contact_time) and math.isfinite(getattr(row, field))
        ]
        for body, field in PEAKS.items()
    }
    shown = {body: found for body, found in shown.items() if found}
    if not shown:
        return make_missing_figure(name, title, "No sample has a pulse width and an amplitude.")
    return make_figure(
        name,
        title,
        lambda: [_draw_peaks(body, found, looks) for body, found in shown.items()],
        " ".join(_describe_peaks(body, found) for body, found in shown.items()),
        CAPTION_4,
    )


def _draw_peaks(body: str, rows: Sequence[FigureRow], looks: dict[str, Look]) -> "Figure":
    materials = panels.split_into_columns(panels.make_material_handles(looks))
    columns = [*materials, panels.make_size_handles(rows)]
    panel = panels.make_panel([HEIGHT_4], columns)
    axes = panel.axes[0]
    panels.draw_material_lines(axes, rows, "contact_time", PEAKS[body], looks)
    for place, row in enumerate(rows):
        point = [row.contact_time], [getattr(row, PEAKS[body])]
        look = {"color": looks[row.material].colour, **panels.choose_marker(row.size)}
        axes.plot(*point, **look, gid=f"mean-{place}")
    axes.set_ylim(bottom=0.0)
    axes.set(
        title=PANEL_TITLES[body], xlabel="pulse width τp [µs]", ylabel="maximum amplitude [m/s²]"
    )
    return panel


def _describe_peaks(body: str, rows: Sequence[FigureRow]) -> str:
    ends = [choose(rows, key=lambda row: getattr(row, PEAKS[body])) for choose in (min, max)]
    described = [
        f"{getattr(row, PEAKS[body]):.0f} m/s² at {row.contact_time:.1f} µs ({row.name})"
        for row in ends[: len(rows)]
    ]
    return (
        f"Maximum amplitude of the {body} against the pulse width,"
        f" {format_count(len(rows), 'sample')}: {' to '.join(described)}."
    )


CASES = 3
"""Samples that the paper shows in Fig. 5 [-]."""
CASE_HEIGHT = 90.0
"""Of one sample's axes [pt]."""
FADED = 0.02
"""Part of the peak below which a response has faded [-], our choice."""
MODEL = "model"
MEASURED = "measured"
LOOKS_5: dict[str, dict[str, Any]] = {
    MODEL: {"color": format_hex(VERMILION), "linewidth": 1.6},
    MEASURED: {"color": INK, "linewidth": 1.0, "linestyle": (0, (4, 2))},
}
"""As in the paper: the model solid, the measurement dashed."""
CAPTION_5 = (
    "Solid: the force-driven model, with k and c by the paper's method; dashed: the mean hit, as"
    " in the paper. Both are normalised to their peak, and the model is shifted in time onto the"
    " measurement. MSE: mean square error over the record, as in Fig. 6."
)
Case = tuple[SampleTraces, ModelTraces]
"""A sample with its force-driven model."""


def draw_figure_5(samples: Sequence[SampleTraces]) -> ReportFigure:
    """Draw model and mean hit of the paper's three cases, or of the first three samples.

    Not drawn if no sample has both traces and the force-driven model.
    """
    name, title = make_name("figure 5"), TITLES[2]
    cases = [
        (sample, model)
        for sample in samples
        if (model := sample.find_model(DRIVEN)) is not None and sample.mean.shape[0] > 1
    ]
    if not cases:
        reason = (
            "No sample has a model to lay over its mean hit."
            if samples
            else "There are no traces: a report of the recording has them."
        )
        return make_missing_figure(name, title, reason)
    order = sort_as_figure_5(tuple(sample.name for sample, _ in cases))
    cases = sorted(cases, key=lambda case: order.index(case[0].name))[:CASES]
    errors = (
        f"{sample.name}: hammer {format_percent(model.mse_hammer_percent)},"
        f" sample {format_percent(model.mse_sample_percent)}"
        for sample, model in cases
    )
    text = (
        "Normalised response of model and measurement, hammer and sample apart. Mean square"
        f" error: {'; '.join(errors)}."
    )
    return make_figure(
        name,
        title,
        lambda: [_draw_responses(cases, channel) for channel in (0, 1)],
        text,
        CAPTION_5,
    )


def _draw_responses(cases: Sequence[Case], channel: int) -> "Figure":
    legend = [[panels.make_handle(kind, **look)] for kind, look in LOOKS_5.items()]
    panel = panels.make_panel([CASE_HEIGHT] * len(cases), legend)
    rows = panel.axes
    shown = choose_span([sample for sample, _ in cases], slice(channel, channel + 1), FADED)
    span = shown[0] * MICRO, shown[1] * MICRO
    for place, (axes, case) in enumerate(zip(rows, cases, strict=True)):
        _draw_case(axes, case, channel, span, place)
    rows[0].set_xlim(*span)
    rows[0].set_title(list(PANEL_TITLES.values())[channel])
    rows[len(rows) // 2].set_ylabel("acceleration / peak")
    rows[-1].set_xlabel("time from the middle of the pulse [µs]")
    return panel


def _draw_case(
    axes: "Axes", case: Case, channel: int, span: tuple[float, float], place: int
) -> None:
    sample, model = case
    measured, modelled = sample.normalise(channel)
    curves: dict[str, FloatArray | None] = {MODEL: modelled, MEASURED: measured}
    for kind, trace in curves.items():
        if trace is not None:
            points = cut_trace(sample.time * MICRO, trace, *span)
            axes.plot(*points, **LOOKS_5[kind], gid=f"{kind}-{place}")
    axes.text(
        0.99,
        0.95,
        f"{panels.shorten_name(sample.name)}\nMSE {format_percent(model.mse_percent[channel])}",
        transform=axes.transAxes,
        ha="right",
        va="top",
    )
    axes.set_yticks([-1, 0, 1])
    axes.margins(y=0.08)


BAR_HEIGHT = 0.62
"""Part of a row [-]."""
SHORTEST_BAR = 20.0
"""How many times the longest bar the bound may be before bars give way to points on a logarithmic
axis [-], our choice."""
VALUE_ROOM = 1.22
"""Length of the axis over the longest bar [-]: its value stands behind it."""
VALUE_SIZE = 9.0
VALUE_GAP = 6.0
VALUE_SHARE = 0.14
"""Of the values: size and distance from the bar [pt], and length as part of the axis [-]."""
CAPTION_6 = (
    "Over the whole record, both traces normalised to their peak and shifted onto each other, as"
    " the paper has it. Dashed line: the largest value of the paper, which prints this figure"
    " without numbers. This measure is forgiving: a visibly wrong shape still gives 1 to 3 %."
)


def draw_figure_6(rows: Sequence[FigureRow]) -> ReportFigure:
    """Draw the mean square error of the force-driven model, hammer and samples apart.

    Not drawn if no sample was compared with the model.
    """
    name, title = make_name("figure 6"), TITLES[3]
    looks = panels.choose_looks([row.material for row in rows])
    parts = {
        body: {
            row.name: (getattr(row, field), looks[row.material].colour)
            for row in rows
            if math.isfinite(getattr(row, field))
        }
        for body, field in ERRORS.items()
    }
    parts = {body: bars for body, bars in parts.items() if bars}
    found = describe_figure_6b({row.name: row.mse_sample_percent for row in rows})
    if not parts:
        return make_missing_figure(name, title, "No sample could be compared with the model.")
    return make_figure(
        name,
        title,
        lambda: [_draw_errors(body, bars) for body, bars in parts.items()],
        " ".join(_describe_errors(body, bars) for body, bars in parts.items()),
        f"{CAPTION_6} {found}".rstrip(),
    )


Bars = dict[str, tuple[float, str]]
"""Value [%] and colour, by sample."""


def _draw_errors(body: str, bars: Bars) -> "Figure":
    bound = LARGEST_ERRORS_PERCENT[body]
    look: dict[str, Any] = {"color": INK, "linewidth": 1.0, "linestyle": (0, (4, 2))}
    legend = panels.make_handle(f"largest value of the paper, {bound:g} %", **look)
    panel = panels.make_named_panel(list(bars), ROW_HEIGHT * len(bars), [[legend]])
    axes = panel.axes[0]
    axes.axvline(bound, **look, gid="bound-1")
    values = [value for value, _ in bars.values()]
    # So far below the bound that bars to it would be nothing: points on a logarithmic axis, on
    # which a bar would have no honest length.
    if min(values) > 0.0 and max(values) < bound / SHORTEST_BAR:
        axes.set_xscale("log")
        for place, (value, colour) in enumerate(bars.values()):
            axes.plot([value], [place], marker="o", color=colour, gid=f"bar-{place}")
        axes.set_xlim(0.5 * min(values), 2.0 * bound)
        axes.xaxis.set_major_formatter("{x:g}")
    else:
        for place, (value, colour) in enumerate(bars.values()):
            style: dict[str, Any] = {"color": colour, "linewidth": 0.0, "gid": f"bar-{place}"}
            axes.barh([place], [value], height=BAR_HEIGHT, **style)
        axes.set_xlim(0.0, VALUE_ROOM * max([bound, *values]))
    _write_values(axes, values, bound)
    axes.set(title=PANEL_TITLES[body], xlabel="MSE [%]")
    return panel


def _write_values(axes: "Axes", values: Sequence[float], bound: float) -> None:
    room = VALUE_SHARE * axes.get_xlim()[1]
    for place, value in enumerate(values):
        # A number that would stand on the bound stands behind it.
        is_hidden = axes.get_xscale() == "linear" and value < bound < value + room
        axes.annotate(
            format_percent(value).removesuffix(" %"),
            (bound if is_hidden else value, place),
            xytext=(VALUE_GAP, 0.0),
            textcoords="offset points",
            va="center",
            fontsize=VALUE_SIZE,
        )


def _describe_errors(body: str, bars: Bars) -> str:
    bound = LARGEST_ERRORS_PERCENT[body]
    worst = max(bars, key=lambda name: bars[name][0])
    above = sum(value > bound for value, _ in bars.values())
    return (
        f"Mean square error of the {body}: largest {format_percent(bars[worst][0])} ({worst});"
        f" {above} of {len(bars)} above the paper's {bound:g} %."
    )
