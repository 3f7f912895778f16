"""What a study shows: progress while it runs, tables when it is done."""

import math
from collections.abc import Sequence

from rich.console import Console
from rich.progress import MofNCompleteColumn

from impact_rig.cli.progress_bar import ProgressBar, TimeLeft
from impact_rig.reporting.terminal.columns import Column
from impact_rig.reporting.terminal.console import ALARM, GOOD, NOTE, print_table, print_text
from impact_rig.results.numbers import MISSING, format_number
from impact_rig.study.cases import Part
from impact_rig.study.goals import ESTIMATOR_NAMES, SYMBOLS, JudgedGoal, judge_goals
from impact_rig.study.results import Row, StudyResults
from impact_rig.study.statistics import Ratio

TITLES = {
    Part.COVERAGE: "Coverage of the 95 % intervals, default disturbances",
    Part.EFFICIENCY: "Efficiency of one hit in white noise, part of each trace's peak",
}
NOTES = {
    Part.COVERAGE: (
        "Each campaign has its own masses and clock, drawn by their stated uncertainties; the"
        " bound holds them as well as noise, steps and scatter of the hits."
    ),
    Part.EFFICIENCY: (
        "The paper's τp is twice the half-amplitude width. The bound is Cramér and Rao's of both"
        " traces, unknown start, gain and offsets included."
    ),
    Part.BIAS: (
        "Ten hits on the plant `dynamics`; masses and clock are exact, so that the estimators"
        " alone err. Mean and standard deviation of a campaign's result. Coverage and efficiency"
        " stand beside them on a wider terminal, and in study.csv."
    ),
}
WIDE_TERMINAL = 130
"""Where coverage and efficiency stand beside the bias [characters]."""
SPEED_PERIOD = 120.0
"""Over which the time left is estimated [s], our choice: units come in bursts."""


class StudyProgress(ProgressBar):
    """A bar with the time left, on a terminal only; a context manager.

    Parameters
    ----------
    console : Console
        Where to.
    """

    def __init__(self, console: Console) -> None:
        super().__init__(
            console,
            "campaigns",
            MofNCompleteColumn(),
            TimeLeft(),
            speed_period=SPEED_PERIOD,
        )

    def report(self, done: int, total: int) -> None:
        """Take finished and all campaigns."""
        self.update(completed=done, total=total)


def print_study(console: Console, results: StudyResults) -> None:
    """Print the tables of the parts that were asked, then the goals."""
    for part, title in TITLES.items():
        rows = [row for row in results.rows if row.part is part]
        if rows:
            print_table(console, title, _make_columns(rows), _make_notes(part, results))
    rows = [row for row in results.rows if row.part is Part.BIAS]
    for quantity in dict.fromkeys(row.quantity for row in rows):
        chosen = [row for row in rows if row.quantity == quantity]
        title = f"Bias ± spread of {SYMBOLS[quantity]} [%], one axis at a time from the default"
        is_wide = console.width >= WIDE_TERMINAL
        print_table(console, title, _make_bias_columns(chosen, is_wide=is_wide))
    if rows:
        for note in _make_notes(Part.BIAS, results):
            print_text(console, note, NOTE)
        console.print()
    _print_goals(console, judge_goals(results))


def _make_columns(rows: Sequence[Row]) -> list[Column]:
    conditions = [row.value for row in rows]
    names = [ESTIMATOR_NAMES[row.estimator] for row in rows]
    both = list(zip(conditions, names, strict=True))
    columns = [
        Column("Condition", _leave_out_repeated(conditions, conditions), is_text=True),
        Column("Estimator", _leave_out_repeated(names, both), is_text=True),
        Column("", [SYMBOLS[row.quantity] for row in rows], is_text=True),
        Column("bias\n[%]", [format_number(100.0 * row.bias.bias, 3) for row in rows]),
        Column(
            "its u\n[%]",
            [format_number(100.0 * row.bias.standard_error, 3) for row in rows],
            is_optional=True,
        ),
        Column("spread\n[%]", [format_number(100.0 * row.bias.spread, 3) for row in rows]),
        Column("covers\n[%]", [format_number(100.0 * row.coverage.value, 1) for row in rows]),
        Column(
            "95 %",
            [_format_interval(row.coverage, 100.0, 1) for row in rows],
            is_optional=True,
        ),
        Column("RMSE /\nbound", [format_number(row.efficiency.value, 3) for row in rows]),
        Column(
            "95 %",
            [_format_interval(row.efficiency, 1.0, 2) for row in rows],
            is_optional=True,
        ),
        Column("n", [str(row.determined) for row in rows], is_optional=True),
    ]
    # What no row has needs no column.
    return [
        column
        for column in columns
        if column.is_text or any(cell != MISSING for cell in column.cells)
    ]


def _make_bias_columns(rows: Sequence[Row], *, is_wide: bool) -> list[Column]:
    """Return one line per condition, the estimators side by side; all of them the same."""
    conditions = list(dict.fromkeys((row.axis, row.value) for row in rows))
    axes = [axis for axis, _ in conditions]
    columns = [
        Column("Axis", _leave_out_repeated(axes, axes), is_text=True),
        Column("", [value for _, value in conditions]),
    ]
    for estimator in dict.fromkeys(row.estimator for row in rows):
        found = {(row.axis, row.value): row for row in rows if row.estimator == estimator}
        chosen = [found[condition] for condition in conditions]
        columns.append(Column(ESTIMATOR_NAMES[estimator], [_format_bias(row) for row in chosen]))
        if is_wide:
            coverage = [format_number(100.0 * row.coverage.value, 1) for row in chosen]
            efficiency = [format_number(row.efficiency.value, 2) for row in chosen]
            columns += [Column("covers\n[%]", coverage), Column("RMSE /\nbound", efficiency)]
    return columns


def _format_bias(row: Row) -> str:
    if not math.isfinite(row.bias.spread):
        return format_number(100.0 * row.bias.bias, 3)
    return f"{100.0 * row.bias.bias:z.3f} ± {100.0 * row.bias.spread:.3f}"


def _leave_out_repeated(cells: Sequence[str], keys: Sequence[object]) -> list[str]:
    """Return the cells, empty where the row above has the same key."""
    return [
        "" if index and keys[index] == keys[index - 1] else cell
        for index, cell in enumerate(cells)
    ]


def _format_interval(ratio: Ratio, factor: float, digits: int) -> str:
    if not math.isfinite(ratio.value):
        return MISSING
    return f"{factor * ratio.low:.{digits}f} to {factor * ratio.high:.{digits}f}"


def _make_notes(part: Part, results: StudyResults) -> list[str]:
    notes = [NOTES[part]]
    missing = sum(row.campaigns - row.determined for row in results.rows if row.part is part)
    if missing:
        notes.append(f"Not determined, and said so: {missing} results of this part.")
    if part is Part.COVERAGE and results.lost_campaigns:
        notes.append(
            "Campaigns given up in all parts, since good hits were rejected:"
            f" {results.lost_campaigns}."
        )
    return notes


def _print_goals(console: Console, goals: Sequence[JudgedGoal]) -> None:
    columns = [
        Column("Goal", [goal.subject for goal in goals], is_text=True),
        Column("asked", [goal.goal for goal in goals], is_text=True),
        Column("found (95 %)", [goal.text for goal in goals]),
        Column(
            "",
            ["reached" if goal.is_reached else "MISSED" for goal in goals],
            is_text=True,
            styles=[GOOD if goal.is_reached else ALARM for goal in goals],
        ),
    ]
    print_table(console, "Goals", columns)
