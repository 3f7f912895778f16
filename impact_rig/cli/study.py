"""``impact-rig study``: the estimators over the virtual rig, where the truth is known."""

import math
import os
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import click
from rich.console import Console
from rich.progress import MofNCompleteColumn

from impact_rig.cli import options
from impact_rig.cli.progress_bar import ProgressBar, TimeLeft
from impact_rig.present.terminal.console import ALARM, GOOD, NOTE, print_table, print_text
from impact_rig.results.numbers import MISSING, format_number
from impact_rig.results.tables import Column
from impact_rig.study.cases import Part
from impact_rig.study.files import list_selection
from impact_rig.study.results import (
    ESTIMATOR_NAMES,
    SYMBOLS,
    JudgedGoal,
    Ratio,
    Row,
    StudyResults,
    judge_goals,
)

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
        "Ten hits on the plant `dynamics`, or `contact` where a law is varied; masses and clock"
        " are exact, so that the estimators alone err. Mean and standard deviation of a"
        " campaign's result. Coverage and efficiency stand beside them on a wider terminal, and"
        " in study.csv."
    ),
}
WIDE_TERMINAL = 130
"""Where coverage and efficiency stand beside the bias [characters]."""
SPEED_PERIOD = 120.0
"""Over which the time left is estimated [s], our choice: units come in bursts."""


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
    if results.selection:
        found = list_selection(results.selection)
        columns = [
            Column("What is wrong with a hit", [row["fault"] for row in found], is_text=True),
            Column("hits", [str(row["hits"]) for row in found]),
            Column("found\n[%]", [f"{row['found_percent']:.1f}" for row in found]),
            Column(
                "95 %",
                [
                    f"{row['found_low_percent']:.2f} to {row['found_high_percent']:.2f}"
                    for row in found
                ],
            ),
        ]
        print_table(console, "Faults by their size: found and rightly named", columns)
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
        chosen = [found.get(condition) for condition in conditions]
        columns.append(
            Column(
                ESTIMATOR_NAMES[estimator], [_format_bias(row) if row else "" for row in chosen]
            )
        )
        if is_wide:
            coverage = [
                format_number(100.0 * row.coverage.value, 1) if row else "" for row in chosen
            ]
            efficiency = [format_number(row.efficiency.value, 2) if row else "" for row in chosen]
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


PARTS = ("coverage", "efficiency", "bias", "selection")
"""As `impact_rig.study.cases.Part` has them; here so that the help needs no numpy."""


@click.command(
    "study",
    epilog="""
    \b
    Parts:
      coverage    how often 95 % intervals cover the truth
      efficiency  error over the Cramér-Rao bound, in white noise
      bias        against noise, bits, sampling rate, damping and pulse shape
      selection   faults of sensors found by their size, good hits lost

    \b
    Examples:
      impact-rig study                         all parts; minutes
      impact-rig study --quick                 all parts, roughly
      impact-rig study coverage selection --json > study.json
      impact-rig study --output studies/mine   goes on where it was stopped

    \b
    Exit code: 0 also where a goal is missed; the table says so.
    """,
)
@click.argument("parts", nargs=-1, metavar="[PART...]", type=click.Choice(PARTS))
@click.option(
    "--campaigns", type=click.IntRange(1), help="Per coverage case; the rest goes with it. [2000]"
)
@click.option("--quick", is_flag=True, help="60 campaigns: a look, no proof.")
@click.option("--jobs", type=click.IntRange(1), help="Processes. [one per core]")
@click.option(
    "--seed", type=click.IntRange(0), default=1, help="The same seed gives the same numbers. [1]"
)
@click.option(
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for data and figure; that of a stopped study: go on. [studies/<time>]",
)
@options.json_option
def command(
    parts: tuple[str, ...],
    campaigns: int | None,
    quick: bool,
    jobs: int | None,
    seed: int,
    output: Path | None,
    as_json: bool,
) -> None:
    """Run the estimators over the virtual rig, where the truth is known.

    Simulates campaigns and tells bias, spread, coverage and efficiency of the paper's method,
    free decay and identification, and whether the goals are reached. Ctrl-C stops it and keeps
    what is done; the same command with the same --output goes on.
    """
    from impact_rig.core.errors import ParameterError
    from impact_rig.present.terminal.console import make_console
    from impact_rig.results.results_file import format_json
    from impact_rig.study.cases import FULL_CAMPAIGNS, QUICK_CAMPAIGNS, Configuration, Part
    from impact_rig.study.files import results_to_json, write_figure, write_results
    from impact_rig.study.results import summarize
    from impact_rig.study.run import StudyFolder, run_units

    if quick and campaigns is not None:
        raise ParameterError("--quick and --campaigns exclude each other: give one of them")
    configuration = Configuration(
        parts=tuple(map(Part, parts or PARTS)),
        campaigns=campaigns or (QUICK_CAMPAIGNS if quick else FULL_CAMPAIGNS),
        seed=seed,
    )
    path = output or Path("studies") / datetime.now().astimezone().strftime("%Y-%m-%dT%H-%M-%S")
    with StudyFolder(path, configuration) as folder:
        try:
            columns = (MofNCompleteColumn(), TimeLeft())
            with ProgressBar(
                make_console(stderr=True), "campaigns", *columns, speed_period=SPEED_PERIOD
            ) as progress:
                run_units(configuration, folder, jobs or _count_cores(), progress.report)
        except KeyboardInterrupt:
            click.echo(
                f"stopped; what is done is kept: the same command with --output {path} goes on",
                err=True,
            )
            raise
        results = summarize(configuration, folder.finished)
        files = write_results(folder, results)
        try:
            files += write_figure(folder, results)
        except ModuleNotFoundError as error:
            click.echo(f"no figure was drawn: Python finds no module {error.name!r}", err=True)
    if as_json:
        click.echo(format_json(results_to_json(results)), nl=False)
    else:
        print_study(make_console(), results)
    click.echo(f"in {path}: {', '.join(files)}", err=True)


def _count_cores() -> int:
    """Return the cores that this process may use."""
    return len(os.sched_getaffinity(0))
