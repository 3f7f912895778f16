"""What a bench has measured as a file, and an earlier one read again."""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from impact_rig.bench.comparison import Change, MeasuredFigures, compare_figures
from impact_rig.bench.figures import Figure
from impact_rig.bench.machine import Machine
from impact_rig.bench.run import BenchResults
from impact_rig.core.errors import FileError
from impact_rig.results.results_file import record_to_json


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
    changes = compare_figures(results, earlier.figures) if earlier else {}
    return {
        "machine": record_to_json(results.machine),
        "extent": record_to_json(results.extent),
        "whole": _figure_to_json(results.whole) if results.whole else None,
        "parts": [
            {
                "name": part.name,
                "title": part.title,
                "error": part.error,
                "seconds": part.seconds,
                "announced_seconds": part.announced,
                "figures": [
                    _figure_to_json(figure, changes.get((part.name, figure.name)))
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
