"""What a bench shows: a bar while it runs, figures beside their goals when it is done."""

from typing import Any

from rich.console import Console
from rich.progress import MofNCompleteColumn

from impact_rig.bench.figures import Figure
from impact_rig.bench.part import Part
from impact_rig.bench.run import BenchResults
from impact_rig.cli.progress_bar import ProgressBar
from impact_rig.reporting.terminal.columns import Column
from impact_rig.reporting.terminal.console import ALARM, GOOD, print_table, print_text
from impact_rig.results.results_file import record_to_json

VERDICTS = {True: "reached", False: "MISSED", None: ""}
STYLES = {True: GOOD, False: ALARM, None: ""}
SIGNIFICANT_DIGITS = 3
"""Of a figure [-], our choice: its spread is seldom below a percent."""
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


def print_bench(console: Console, results: BenchResults) -> None:
    """Print the figures of each part beside their goals, and the machine they belong to."""
    for part in results.parts:
        if part.figures:
            notes = [f"{item.name}: {item.note}" for item in part.figures if item.note]
            print_table(console, part.title, _make_columns(part.figures), notes)
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


def _format_value(value: float, unit: str) -> str:
    text = f"{value:.0f}" if value.is_integer() else f"{value:.{SIGNIFICANT_DIGITS}g}"
    return f"{text} {unit}".strip()


def _format_spread(figure: Figure) -> str:
    if len(figure.values) == 1:
        return ""
    low, high = figure.quartiles
    return f"{_format_value(low, '')} to {_format_value(high, '')}"


def results_to_json(results: BenchResults) -> dict[str, Any]:
    """Return what was measured as plain dicts, lists, strings and numbers."""
    return {
        "machine": record_to_json(results.machine),
        "extent": record_to_json(results.extent),
        "parts": [
            {
                "name": part.name,
                "title": part.title,
                "error": part.error,
                "figures": [_figure_to_json(figure) for figure in part.figures],
            }
            for part in results.parts
        ],
    }


def _figure_to_json(figure: Figure) -> dict[str, Any]:
    low, high = figure.quartiles
    return {
        "name": figure.name,
        "unit": figure.unit,
        "median": figure.median,
        "lower_quartile": low,
        "upper_quartile": high,
        "values": list(figure.values),
        "goal": str(figure.goal) if figure.goal else None,
        "reached": figure.is_reached,
        "note": figure.note,
    }
