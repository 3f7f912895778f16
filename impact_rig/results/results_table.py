"""Results as one table for spreadsheets: a row for each sample, a column for each number."""

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from impact_rig.results.campaign import Results
from impact_rig.results.cross_checks import IdentificationResults
from impact_rig.results.estimates import SampleResults

JOINT = "; "
"""Between several texts in one cell."""


def format_results_table(campaigns: Sequence[Results]) -> str:
    """Return the results as text in columns parted by commas.

    Parameters
    ----------
    campaigns : sequence of Results
        In their order.

    Returns
    -------
    str
        A line of names as in results.json, with their units, then a line for each sample. What is
        not determined is empty. Numbers are written with the digits that bring them back bit by
        bit. Free decay, preferred identification and hammer follow with their names before
        each column; budgets and other models are in results.json alone.
    """
    rows = [
        {"campaign": str(number), **_make_row(results, sample)}
        for number, results in enumerate(campaigns, start=1)
        for sample in results.samples
    ]
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]) if rows else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _make_row(results: Results, sample: SampleResults) -> dict[str, str]:
    identification = sample.identification or IdentificationResults("")
    return {
        **_flatten(sample),
        "best_shape": sample.pulse_shape.best_shape,
        **_flatten(sample.free_decay, "free_decay_"),
        **_flatten(identification, "identification_"),
        **_flatten(results.hammer, "hammer_"),
    }


def _flatten(record: Any, prefix: str = "") -> dict[str, str]:
    """Return the numbers and texts of a record; lists of texts are joined."""
    cells = {}
    for item in fields(record):
        value = getattr(record, item.name)
        if isinstance(value, float):
            cells[prefix + item.name] = repr(value) if math.isfinite(value) else ""
        elif isinstance(value, str | int):
            cells[prefix + item.name] = str(value)
        elif item.name in ("warnings", "notes"):
            cells[prefix + item.name] = JOINT.join(value)
    return cells
