"""What was measured: as JSON, as tables, and beside an earlier result."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import MofNCompleteColumn

from bench.measure import BenchResults, Figure, Machine, Part, PartResults
from impact_rig.cli.progress_bar import ProgressBar
from impact_rig.core.errors import FileError
from impact_rig.present.terminal.console import ALARM, GOOD, print_table, print_text
from impact_rig.results.tables import Column
from impact_rig.results.wire import to_json

MeasuredFigures = Mapping[tuple[str, str], Figure]
"""Figures by the names of their part and of themselves."""
PERCENT = 100.0


@dataclass(frozen=True)
class Change:
    """What has become of a figure.

    Attributes
    ----------
    percent : float
        Change of the median [%]; NaN: it was 0.
    is_beyond_spread : bool or None
        The quartiles of both have nothing in common; None: one of them was measured once, and
        its spread is not known.
    """

    percent: float
    is_beyond_spread: bool | None


def compare_figures(part: PartResults, earlier: MeasuredFigures) -> dict[str, Change]:
    """Return the changes of a part's figures, by name, that another bench has measured, too."""
    return {
        figure.name: compare_figure(figure, earlier[part.name, figure.name])
        for figure in part.figures
        if (part.name, figure.name) in earlier
    }


def compare_figure(figure: Figure, earlier: Figure) -> Change:
    """Return what has become of a figure."""
    before, now = earlier.median, figure.median
    percent = PERCENT * (now - before) / abs(before) if before else math.nan
    if now == before:
        percent = 0.0
    if min(len(figure.values), len(earlier.values)) == 1:
        return Change(percent, None)
    (low, high), (earlier_low, earlier_high) = figure.quartiles, earlier.quartiles
    return Change(percent, low > earlier_high or high < earlier_low)


@dataclass(frozen=True)
class EarlierBench:
    """What another bench has measured.

    Attributes
    ----------
    path : Path
        Of its file.
    processor : str
        That it ran on.
    cores : int
        Which it used.
    figures : mapping
        By the names of part and figure.
    """

    path: Path
    processor: str
    cores: int
    figures: MeasuredFigures

    def find_difference(self, machine: Machine) -> str:
        """Return why its figures say little about a machine; empty: it is the same."""
        if (self.processor, self.cores) == (machine.processor, machine.cores):
            return ""
        return (
            f"{self.path} was measured on another machine, {self.processor} with {self.cores}"
            f" cores; this is {machine.processor} with {machine.cores}"
        )


def read_bench(path: Path) -> EarlierBench:
    """Read what `impact-rig bench --json` has printed.

    Raises
    ------
    FileError
        If the file cannot be read, or is nothing of the kind.
    """
    try:
        content = json.loads(path.read_text("utf-8"))
    except OSError as error:
        raise FileError(f"bench {path}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:
        raise FileError(f"bench {path}: is not JSON ({error})") from None
    try:
        figures = {
            (str(part["name"]), str(figure["name"])): Figure(
                str(figure["name"]), tuple(map(float, figure["values"])), str(figure["unit"])
            )
            for part in content["parts"]
            for figure in part["figures"]
            if figure["values"]
        }
        machine = content["machine"]
        return EarlierBench(path, str(machine["processor"]), int(machine["cores"]), figures)
    except (KeyError, TypeError, ValueError):
        raise FileError(
            f"bench {path}: is no result of a bench; `impact-rig bench --json > {path.name}`"
            " writes one"
        ) from None


def results_to_json(results: BenchResults, earlier: EarlierBench | None = None) -> dict[str, Any]:
    """Return what was measured as plain dicts, lists, strings and numbers.

    Parameters
    ----------
    results : BenchResults
        What was measured.
    earlier : EarlierBench, optional
        To compare with: each figure that it has, too, has its change.
    """
    changes = {
        part.name: compare_figures(part, earlier.figures) if earlier else {}
        for part in results.parts
    }
    return {
        "machine": to_json(results.machine),
        "extent": to_json(results.extent),
        "whole": _figure_to_json(results.whole) if results.whole else None,
        "parts": [
            {
                "name": part.name,
                "title": part.title,
                "error": part.error,
                "seconds": part.seconds,
                "announced_seconds": part.announced,
                "figures": [
                    _figure_to_json(figure, changes[part.name].get(figure.name))
                    for figure in part.figures
                ],
            }
            for part in results.parts
        ],
    }


def _figure_to_json(figure: Figure, change: Change | None = None) -> dict[str, Any]:
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
        "change": _change_to_json(change) if change else None,
    }


def _change_to_json(change: Change) -> dict[str, Any]:
    percent = change.percent if math.isfinite(change.percent) else None
    return {"percent": percent, "is_beyond_spread": change.is_beyond_spread}


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

    def follow(self, part: Part, done: int, total: int) -> None:
        """Take the part that runs, and done and all of what it counts; 0: not known."""
        self.update(description=part.name, completed=done, total=total or None)
        if part.name != self._part and not self.is_drawn:
            self.console.print(f"{part.name}: {part.title}", soft_wrap=True)
        self._part = part.name


def print_part(console: Console, part: PartResults, earlier: EarlierBench | None = None) -> None:
    """Print the figures of a part beside their goals; `earlier`: with the changes since then."""
    if not part.figures:
        return
    notes = [f"{item.name}: {item.note}" for item in part.figures if item.note]
    columns = _make_columns(part.figures)
    if changes := compare_figures(part, earlier.figures) if earlier else {}:
        columns.append(_make_change_column(part.figures, changes))
    print_table(console, part.title, columns, notes)


def print_end(
    console: Console, results: BenchResults, earlier: EarlierBench | None = None
) -> None:
    """Print how long the parts took, and the machine that the figures belong to."""
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
