"""Results as one table for spreadsheets: a row for each sample, a column for each number."""

import csv
import io
from collections.abc import Sequence

from impact_rig.core.sample import FittedModel, SampleEstimate
from impact_rig.core.speed_exponents import SpeedExponents
from impact_rig.results.campaign import Results
from impact_rig.results.results_file import origin_to_json
from impact_rig.results.wire import to_row

FORMULA_MARKS = ("=", "+", "-", "@", "\t", "\r", "'")
"""How a cell begins that a spreadsheet takes for a formula; numbers are none."""


def format_results_table(campaigns: Sequence[Results]) -> str:
    """Return the results as text in columns parted by commas.

    Parameters
    ----------
    campaigns : sequence of Results
        In their order.

    Returns
    -------
    str
        A line of names as in results.json, with their units, then a line for each sample, with the
        origin of its hits. What is
        not determined is empty. Numbers are written with the digits that bring them back bit by
        bit. Contact law, free decay, preferred identification, hammer and speed exponents follow
        with their names before each column; budgets and other models are in results.json alone.
    """
    rows = [
        {
            "campaign": str(number),
            **origin_to_json(results.find_origin(sample.name)),
            **_make_row(results, sample),
        }
        for number, results in enumerate(campaigns, start=1)
        for sample in results.samples
    ]
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]) if rows else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _guard(cell) for name, cell in row.items()} for row in rows)
    return text.getvalue()


def _guard(cell: str) -> str:
    """Return a cell that no spreadsheet computes: an apostrophe goes before what looks like it."""
    if not cell.startswith(FORMULA_MARKS):
        return cell
    try:
        float(cell)
    except ValueError:
        return f"'{cell}"
    return cell


def _make_row(results: Results, sample: SampleEstimate) -> dict[str, str]:
    identification = sample.identification or FittedModel("")
    struck = results.setup.samples.find(sample.name)
    exponents = (item for item in results.speed_exponents if item.sample == struck.body)
    return {
        **to_row(sample),
        "best_shape": sample.pulse_shape.best_shape,
        **to_row(sample.contact_law, "contact_law_"),
        **to_row(sample.free_decay, "free_decay_"),
        **to_row(identification, "identification_"),
        **to_row(results.hammer, "hammer_"),
        "release_angle_rad": to_row(struck)["release_angle_rad"],
        **to_row(next(exponents, SpeedExponents("", 0)), "speed_exponents_"),
    }
