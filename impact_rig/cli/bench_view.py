"""What a bench shows: a bar while it runs, figures beside their goals when it is done."""

import math
from collections.abc import Mapping

from rich.console import Console
from rich.progress import MofNCompleteColumn

from impact_rig.bench.comparison import Change, compare_figures
from impact_rig.bench.figures import Figure
from impact_rig.bench.part import Part
from impact_rig.bench.results_file import EarlierBench
from impact_rig.bench.run import BenchResults
from impact_rig.cli.progress_bar import ProgressBar
from impact_rig.reporting.terminal.columns import Column
from impact_rig.reporting.terminal.console import ALARM, GOOD, print_table, print_text

VERDICTS = {True: "reached", False: "MISSED", None: ""}
STYLES = {True: GOOD, False: ALARM, None: ""}
SIGNIFICANT_DIGITS = 3
"""Of a figure [-], our choice: its spread is seldom below a percent."""
BEYOND = "*"
"""Marks a change beyond the spread."""
GIGA = 1e9


class BenchProgress(ProgressBar):
    """Follows a bench on standard error; a context manager.

    Parameters
    ----------
    console : Console
        Where to; without a terminal, a line for each part instead of a bar.
    """

    def __init__(self, console: Console) -> None:
        super().__init__(console, "bench", MofNCompleteColumn())
        self._part = ""

    def report(self, part: Part, done: int, total: int) -> None:
        """Take the part that runs, and done and all of what it counts; 0: not known."""
        self.update(description=part.name, completed=done, total=total or None)
        if part.name != self._part and not self.is_drawn:
            self.console.print(f"{part.name}: {part.title}", soft_wrap=True)
        self._part = part.name


def print_bench(
    console: Console, results: BenchResults, earlier: EarlierBench | None = None
) -> None:
    """Print the figures of each part beside their goals, and the machine they belong to.

    Parameters
    ----------
    console : Console
        Where to.
    results : BenchResults
        What was measured.
    earlier : EarlierBench, optional
        To compare with: each figure that it has, too, has its change beside it.
    """
    changes = compare_figures(results, earlier.figures) if earlier else {}
    for part in results.parts:
        if part.figures:
            notes = [f"{item.name}: {item.note}" for item in part.figures if item.note]
            columns = _make_columns(part.figures)
            own = {name: change for (owner, name), change in changes.items() if owner == part.name}
            if own:
                columns.append(_make_change_column(part.figures, own))
            print_table(console, part.title, columns, notes)
    if results.parts:
        print_table(console, "Time that the bench took", _make_time_columns(results))
    if earlier is not None:
        print_text(
            console,
            f"change: of the median since {earlier.path}; {BEYOND}: the quartiles of both have"
            " nothing in common. Of what was measured once (n = 1) no spread is known.",
        )
    machine = results.machine
    print_text(
        console,
        f"{machine.processor}, {machine.cores} cores, {machine.memory_byte / GIGA:.0f} GB,"
        f" {machine.system}, Python {machine.python}, impact_rig {machine.software}",
    )


def _make_columns(figures: tuple[Figure, ...]) -> list[Column]:
    spreads = [_format_spread(figure) for figure in figures]
    return [
        Column("Figure", [figure.name for figure in figures], is_text=True),
        Column("median", [_format_value(figure.median, figure.unit) for figure in figures]),
        Column("quartiles", spreads, is_optional=True),
        Column("n", [str(len(figure.values)) for figure in figures]),
        Column("asked", [str(figure.goal or "") for figure in figures], is_text=True),
        Column(
            "",
            [VERDICTS[figure.is_reached] for figure in figures],
            is_text=True,
            styles=[STYLES[figure.is_reached] for figure in figures],
        ),
    ]


def _make_change_column(figures: tuple[Figure, ...], changes: Mapping[str, Change]) -> Column:
    cells = []
    for figure in figures:
        change = changes.get(figure.name)
        mark = BEYOND if change and change.is_beyond_spread else ""
        cells.append(f"{_format_percent(change.percent)} {mark:1}" if change else "")
    return Column("change", cells)


def _format_percent(percent: float) -> str:
    return "from 0" if math.isnan(percent) else f"{percent:+.1f} %"


def _make_time_columns(results: BenchResults) -> list[Column]:
    parts, whole = results.parts, results.whole
    names = [part.name for part in parts]
    taken = [_format_seconds(part.seconds) for part in parts]
    asked = [f"about {_format_seconds(part.announced)}" for part in parts]
    verdict = None
    if whole is not None:
        names.append(whole.name)
        taken.append(_format_seconds(whole.median))
        asked.append(f"{whole.goal} s" if whole.goal else "")
        verdict = whole.is_reached
    verdicts = [*[None] * len(parts), verdict][: len(names)]
    return [
        Column("Part", names, is_text=True),
        Column("took", taken),
        Column("announced", asked, is_text=True),
        Column(
            "",
            [VERDICTS[item] for item in verdicts],
            is_text=True,
            styles=[STYLES[item] for item in verdicts],
        ),
    ]


def _format_seconds(seconds: float) -> str:
    return f"{seconds:.1f} s"


def _format_value(value: float, unit: str) -> str:
    text = f"{value:.0f}" if value.is_integer() else f"{value:.{SIGNIFICANT_DIGITS}g}"
    return f"{text} {unit}".strip()


def _format_spread(figure: Figure) -> str:
    if len(figure.values) == 1:
        return ""
    low, high = figure.quartiles
    return f"{_format_value(low, '')} to {_format_value(high, '')}"
