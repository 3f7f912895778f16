"""results.json: written whole or not at all, read with errors that say what is wrong; and as CSV.

JSON numbers are written as Python's `repr` does, so that they come back bit by bit; what is not
determined (NaN) is null. CSV is for spreadsheets: a row for each sample, a column for each number.
"""

import contextlib
import csv
import io
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.estimates.speed_exponents import SpeedExponents
from impact_rig.core.given.errors import FileError, ParameterError, RigError
from impact_rig.results.campaign import Results
from impact_rig.results.remarks import gather_remarks
from impact_rig.results.wire import Json, format_json, from_json, origin_to_json, to_json, to_row

FORMAT_NAME = "impact-rig results"
FORMAT_VERSION = 13


def results_to_json(results: Results) -> Json:
    """Return the content of results.json as plain dicts, lists, strings and numbers."""
    return {
        "format": {"name": FORMAT_NAME, "version": FORMAT_VERSION},
        **origin_to_json(results.origin),
        **to_json(results),
        "remarks": [
            {"about": remark.about, "text": remark.text} for remark in gather_remarks(results)
        ],
    }


def read_path(what: str, path: Any) -> Path:
    """Return the path that a program gives; raises `ParameterError` if it is none."""
    if isinstance(path, str | Path) and str(path):
        return Path(path)
    raise ParameterError(f"{what} is {path!r}: it must be the name of a file or a folder")


def write_results(path: Path, results: Results) -> None:
    """Write results.json, or a table if the path ends so, in one step.

    A reader finds the old file or the new one.

    Parameters
    ----------
    path : Path
        Of the file; its folder must exist.

    Raises
    ------
    FileError
        If the file cannot be written. Nothing half-written is left.
    """
    is_table = path.suffix == ".csv"
    text = format_results_table([results]) if is_table else format_json(results_to_json(results))
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with part.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        raise FileError(
            f"results {path}: cannot be written ({error.strerror or error}); give a folder that"
            " exists and that you may write to"
        ) from None


def read_results(path: Path) -> Results:
    """Read results.json.

    Raises
    ------
    FileError
        If the file cannot be read, is no results file, or is of another version.
    """
    if path.exists() and not path.is_file():  # a pipe may never end
        raise FileError(f"results {path}: cannot be read (it is no regular file)")
    try:
        content = json.loads(path.read_text(encoding="utf-8"), object_pairs_hook=_make_object)
    except OSError as error:
        raise FileError(f"results {path}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:
        raise FileError(f"results {path}: is not JSON ({error})") from None
    except RecursionError:
        raise FileError(f"results {path}: is nested too deep to be results") from None
    kind = content.get("format") if isinstance(content, dict) else None
    if not isinstance(kind, dict) or kind.get("name") != FORMAT_NAME:
        raise FileError(
            f"results {path}: is not a results file; one has the format name {FORMAT_NAME!r}"
        )
    version = kind.get("version")
    if version != FORMAT_VERSION:
        raise FileError(
            f"results {path}: has format version {version!r}; this program reads version"
            f" {FORMAT_VERSION}: `impact-rig analyze RECORDING --json` gives the results again"
        )
    try:
        results = from_json(Results, content)
        check_names(results)
    except RigError as error:
        raise FileError(f"results {path}: {error}") from None
    return results


def check_names(results: Results) -> None:
    """Raise `ParameterError` if results are of a sample that their set-up does not have."""
    control = results.hammer.control_sample
    names = [item.name for item in results.samples] + [hit.sample for hit in results.hits]
    for name in [*names, control] if control else names:
        results.setup.samples.find(name)


def _make_object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"the key {twice[:32]!r} is there twice in one object")
    return content


FORMULA_MARKS = ("=", "+", "-", "@", "\t", "\r", "'")
"""Beginnings of cells that a spreadsheet takes for formulas, unless they are numbers."""


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
        origin of its hits. What is not determined is empty. Numbers are written with the digits
        that bring them back bit by bit. Contact law, free decay, hammer and speed exponents follow
        with their names before each column; budgets are in results.json alone.
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
    struck = results.setup.samples.find(sample.name)
    exponents = (item for item in results.speed_exponents if item.sample == struck.body)
    return {
        **to_row(sample),
        "best_shape": sample.pulse_shape.best_shape,
        **to_row(sample.contact_law, "contact_law_"),
        **to_row(sample.free_decay, "free_decay_"),
        **to_row(results.hammer, "hammer_"),
        "release_angle_rad": to_row(struck)["release_angle_rad"],
        **to_row(next(exponents, SpeedExponents("", 0)), "speed_exponents_"),
    }
