"""The files of a study: its results as JSON and CSV, and its figure."""

import csv
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from io import BytesIO, StringIO
from typing import Any

import numpy as np

from impact_rig.study.cases import (
    CONTACT_LAW,
    FREE_DECAY,
    IDENTIFICATION,
    PAPER,
    Part,
    list_cases,
)
from impact_rig.study.results import (
    COVERAGE_RANGE,
    ESTIMATOR_NAMES,
    LARGEST_EFFICIENCY_RATIO,
    SYMBOLS,
    Row,
    StudyResults,
    compute_fraction,
    judge_goals,
)
from impact_rig.study.run import StudyFolder, describe_configuration
from impact_rig.study.selection import SelectionCount

FORMATS = ("svg", "png")
RESOLUTION = 150
"""Of the bitmap [dots per inch]."""
PANEL_SIZE = (3.6, 2.7)
"""[inch]"""
STYLES = {
    PAPER: ("#D55E00", "o", -0.12),
    FREE_DECAY: ("#009E73", "^", 0.0),
    IDENTIFICATION: ("#0072B2", "s", 0.12),
    CONTACT_LAW: ("#CC79A7", "D", 0.12),
}
"""Colour, marker, and place beside the others on an axis."""
LINES = dict(zip(SYMBOLS, ("-", "--", ":", "-.", "--", ":"), strict=True))
"""Of quantities, where estimators are told apart by colour."""
STYLE: dict[Any, Any] = {
    "svg.hashsalt": "impact-rig study",  # the same study gives the same file
    "font.size": 9,
    "axes.grid": True,
    "grid.alpha": 0.3,
}
LINEAR_RANGE = 0.1
"""Up to where the bias axis is linear [%]; beyond it is logarithmic."""
LARGEST_BIAS = 100.0
"""End of the bias axes, which are all alike [%]."""
BIAS_TICKS = (-100, -10, -1, -0.1, 0, 0.1, 1, 10, 100)
LOWEST_COVERAGE = 85.0
"""Where the coverage axis begins [%]; what lies below is written there."""
LEGEND_ROOM = 1.4
"""Height of the efficiency axis over the highest point [-]."""
LARGEST_RATIO = 20.0
"""Largest error over its bound that is drawn [-]: beyond, it is all bias."""


def draw_figure(results: StudyResults) -> dict[str, bytes]:
    """Draw the parts that simulate campaigns.

    Returns
    -------
    dict of str to bytes
        The figure by format; empty where no such part was asked.

    Raises
    ------
    ModuleNotFoundError
        If there is no matplotlib.
    """
    by_part = {part: [row for row in results.rows if row.part is part] for part in Part}
    axes = list(dict.fromkeys(row.axis for row in by_part[Part.BIAS]))
    summaries = [
        (draw, by_part[part])
        for part, draw in ((Part.COVERAGE, _draw_coverage), (Part.EFFICIENCY, _draw_efficiency))
        if by_part[part]
    ]
    if not axes and not summaries:
        return {}
    # The Figure itself, not pyplot: no screen, no state that outlives the call.
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    columns = max(len(axes), 2 * len(summaries), 2)
    rows = (len(SYMBOLS) if axes else 0) + bool(summaries)
    with rc_context(STYLE):
        figure = Figure(
            figsize=(PANEL_SIZE[0] * columns, PANEL_SIZE[1] * rows + 0.6), layout="constrained"
        )
        grid = figure.add_gridspec(rows, 2 * columns)
        for place, axis in enumerate(axes):
            for line, (quantity, symbol) in enumerate(SYMBOLS.items()):
                panel = figure.add_subplot(grid[line, 2 * place : 2 * place + 2])
                _draw_bias(panel, by_part[Part.BIAS], axis, quantity)
                panel.set_ylabel("" if place else f"bias of {symbol} [%]")
                panel.set_title("" if line else axis)
        for place, (draw, chosen) in enumerate(summaries):
            width = 2 * columns // len(summaries)
            draw(figure.add_subplot(grid[-1, place * width : (place + 1) * width]), chosen)
        _add_legend(figure)
        return {name: _render(figure, name) for name in FORMATS}


def _draw_bias(panel: Any, rows: Sequence[Row], axis: str, quantity: str) -> None:
    """Points with bars of one standard deviation of a campaign's result."""
    values = [case.value for case in list_cases(Part.BIAS) if case.axis == axis]
    for estimator, (*_, shift) in STYLES.items():
        wanted = (axis, quantity, estimator)
        chosen = [
            row
            for row in rows
            if (row.axis, row.quantity, row.estimator) == wanted and math.isfinite(row.bias.bias)
        ]
        if chosen:
            panel.errorbar(
                [values.index(row.value) + shift for row in chosen],
                [100.0 * row.bias.bias for row in chosen],
                yerr=[100.0 * np.nan_to_num(row.bias.spread) for row in chosen],
                **_choose_style(estimator),
            )
    panel.axhline(0.0, color="black", linewidth=0.8)
    panel.set_yscale("symlog", linthresh=LINEAR_RANGE)
    panel.set_ylim(-LARGEST_BIAS, LARGEST_BIAS)
    panel.set_yticks(BIAS_TICKS, [f"{tick:g}" for tick in BIAS_TICKS])
    panel.set_xticks(range(len(values)), values, rotation=20)


def _draw_coverage(panel: Any, rows: Sequence[Row]) -> None:
    """Part of the intervals that cover the truth, each with its own interval."""
    low, high = (100.0 * limit for limit in COVERAGE_RANGE)
    panel.axhspan(low, high, color="0.85")
    labels = []
    last = ""
    for place, row in enumerate(rows):
        # The plant is named once, below its first quantity.
        labels.append(SYMBOLS[row.quantity] + ("" if row.value == last else f"\n{row.value}"))
        last = row.value
        value, low, high = (
            100.0 * part for part in (row.coverage.value, row.coverage.low, row.coverage.high)
        )
        if value < LOWEST_COVERAGE:
            panel.annotate(
                f"{value:.0f} %",
                (place, LOWEST_COVERAGE),
                ha="center",
                va="bottom",
                color=STYLES[row.estimator][0],
            )
        elif math.isfinite(value):
            yerr = [[value - low], [high - value]]
            panel.errorbar([place], [value], yerr=yerr, **_choose_style(row.estimator))
    panel.set_ylim(LOWEST_COVERAGE, 100.5)
    panel.set_xlim(-0.5, len(labels) - 0.5)
    panel.set_xticks(range(len(labels)), labels)
    panel.set_title("coverage of the 95 % intervals [%]; grey: the goal")


def _draw_efficiency(panel: Any, rows: Sequence[Row]) -> None:
    """Root of the mean squared error over the bound, against noise; lines by quantity."""
    levels = {case.value: 100.0 * case.noise_of_peak for case in list_cases(Part.EFFICIENCY)}
    for estimator, (colour, marker, _) in STYLES.items():
        for quantity, line in LINES.items():
            chosen = [
                row
                for row in rows
                if (row.estimator, row.quantity) == (estimator, quantity)
                and row.efficiency.value <= LARGEST_RATIO
            ]
            if chosen:
                panel.plot(
                    [levels[row.value] for row in chosen],
                    [row.efficiency.value for row in chosen],
                    color=colour,
                    marker=marker,
                    markersize=4,
                    linestyle=line,
                    label=f"{SYMBOLS[quantity]}, {ESTIMATOR_NAMES[estimator]}",
                )
    panel.axhline(LARGEST_EFFICIENCY_RATIO, color="black", linewidth=0.8)
    panel.set_xscale("log")
    panel.set_xticks(list(levels.values()), [f"{level:g}" for level in levels.values()])
    panel.set_xticks([], minor=True)
    panel.set_ylim(0.0, LEGEND_ROOM * panel.get_ylim()[1])
    panel.set_xlabel("white noise [% of each trace's peak]")
    panel.set_title("RMS error over the Cramér-Rao bound; line: the goal")
    if panel.get_legend_handles_labels()[0]:
        panel.legend(fontsize=7, ncols=3, loc="upper center")


def _choose_style(estimator: str) -> dict[str, Any]:
    colour, marker, _ = STYLES[estimator]
    return {
        "color": colour,
        "marker": marker,
        "markersize": 4,
        "linestyle": "none",
        "capsize": 2,
        "elinewidth": 1,
    }


def _add_legend(figure: Any) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], label=ESTIMATOR_NAMES[name], color=colour, marker=marker, linestyle="none")
        for name, (colour, marker, _) in STYLES.items()
    ]
    figure.legend(
        handles=handles,
        loc="outside upper center",
        ncols=len(handles),
        title="mean of many campaigns, bars: one standard deviation of a campaign's result",
    )


def _render(figure: Any, name: str) -> bytes:
    content = BytesIO()
    # Without its date the same study gives the same file.
    metadata = {"Date": None} if name == "svg" else {}
    figure.savefig(content, format=name, dpi=RESOLUTION, metadata=metadata)
    return content.getvalue()


RESULTS_NAME = "study.json"
ROWS_NAME = "study.csv"
SELECTION_NAME = "selection.csv"
FIGURE_STEM = "study"

Json = dict[str, Any]


def results_to_json(results: StudyResults) -> Json:
    """Return everything a study found as plain values; None is what is not determined."""
    return {
        **describe_configuration(results.configuration),
        "lost_campaigns": results.lost_campaigns,
        "goals": [asdict(goal) for goal in judge_goals(results)],
        "rows": [row.to_json() for row in results.rows],
        "selection": results.selection.to_json() if results.selection else None,
    }


def write_results(folder: StudyFolder, results: StudyResults) -> list[str]:
    """Write JSON and CSV; returns the names of the files."""
    content = results_to_json(results)
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    folder.write_bytes(RESULTS_NAME, text.encode())
    names = [RESULTS_NAME]
    if results.rows:
        folder.write_bytes(ROWS_NAME, format_csv(content["rows"]))
        names.append(ROWS_NAME)
    if results.selection:
        folder.write_bytes(SELECTION_NAME, format_csv(list_selection(results.selection)))
        names.append(SELECTION_NAME)
    return names


def write_figure(folder: StudyFolder, results: StudyResults) -> list[str]:
    """Draw the figure; returns the names of the files, none where there is nothing to draw."""
    names = []
    for suffix, content in draw_figure(results).items():
        names.append(f"{FIGURE_STEM}.{suffix}")
        folder.write_bytes(names[-1], content)
    return names


def list_selection(count: SelectionCount) -> list[Json]:
    """Return one row for each fault and size, and one for the good hits that are left out."""
    counts = [(fault, total, count.detected[fault]) for fault, total in count.faulty.items()]
    rows = []
    for fault, total, found in [*counts, ("nothing", count.good, count.good_rejected)]:
        part = compute_fraction(found, total)
        rows.append(
            {
                "fault": fault,
                "hits": total,
                "found": found,
                "found_percent": 100.0 * part.value,
                "found_low_percent": 100.0 * part.low,
                "found_high_percent": 100.0 * part.high,
            }
        )
    return rows


def format_csv(rows: Sequence[Mapping[str, Any]]) -> bytes:
    """Return dicts of the same keys as CSV; None is an empty cell."""
    text = StringIO(newline="")
    writer = csv.DictWriter(text, list(rows[0]))
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode()
