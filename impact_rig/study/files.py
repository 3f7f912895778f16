"""Results of a study as JSON, CSV and figure."""

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from io import StringIO
from typing import Any

from impact_rig.study.figure import draw_figure
from impact_rig.study.folder import StudyFolder, describe_configuration
from impact_rig.study.goals import judge_goals
from impact_rig.study.results import StudyResults
from impact_rig.study.selection import SelectionCount
from impact_rig.study.statistics import find_fraction

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
        "speed": asdict(results.speed) if results.speed else None,
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
    """Return one row per fault, and one for the good hits."""
    counts = [
        *((fault, total, count.detected.get(fault, 0)) for fault, total in count.faulty.items()),
        ("none", count.good, count.good_rejected),
    ]
    rows = []
    for fault, total, rejected in counts:
        part = find_fraction(rejected, total)
        rows.append(
            {
                "fault": fault,
                "hits": total,
                "rejected": rejected,
                "rejected_percent": 100.0 * part.value,
                "rejected_low_percent": 100.0 * part.low,
                "rejected_high_percent": 100.0 * part.high,
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
