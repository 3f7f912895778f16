"""results.json: written whole or not at all, read with errors that say what is wrong.

JSON numbers are written as Python's `repr` does, so that they come back bit by bit; what is not
determined (NaN) is null.
"""

import json
import math
import os
import tempfile
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

from impact_rig.core.errors import FileError
from impact_rig.results.campaign import Results

FORMAT_NAME = "impact-rig results"
FORMAT_VERSION = 3
ADDED_FIELDS: dict[str, list[Any]] = {"setup.sensors": []}
"""Fields that files of this version may lack, and what they then hold."""

Json = dict[str, Any]
WANTED = {int: "a whole number", str: "text", bool: "true or false"}
"""Kinds of values that are taken as they are, in words."""


def results_to_json(results: Results) -> Json:
    """Return the content of results.json as plain dicts, lists, strings and numbers."""
    content: Json = {"format": {"name": FORMAT_NAME, "version": FORMAT_VERSION}}
    content.update(record_to_json(results))
    return content


def record_to_json(record: Any) -> Json:
    """Return a frozen dataclass of this package as a dict of plain values, NaN as None."""
    return {field.name: _value_to_json(getattr(record, field.name)) for field in fields(record)}


def _value_to_json(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_value_to_json(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, str | int):
        return value
    return record_to_json(value)


def format_json(content: Any) -> str:
    """Return JSON text as every command prints it: indented, ending in a new line."""
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def write_results(path: Path, results: Results) -> None:
    """Write results.json; whoever looks finds the old file or the whole new one.

    Parameters
    ----------
    path : Path
        Of the file; its folder must exist.
    results : Results
        What to write.

    Raises
    ------
    FileError
        If the file cannot be written. Nothing half-written is left.
    """
    text = format_json(results_to_json(results))
    temporary: Path | None = None
    try:
        with tempfile.NamedTemporaryFile(
            "w",
            encoding="utf-8",
            dir=path.parent,
            prefix=f".{path.name}.",
            suffix=".part",
            delete=False,
        ) as file:
            temporary = Path(file.name)
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        # Temporary files are private; results are as readable as any other new file.
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        temporary.replace(path)
    except OSError as error:
        if temporary:
            temporary.unlink(missing_ok=True)
        reason = error.strerror or error
        raise FileError(
            f"results {path}: cannot be written ({reason}); give a folder that exists and that"
            " you may write to"
        ) from None


def read_results(path: Path) -> Results:
    """Read results.json.

    Raises
    ------
    FileError
        If the file cannot be read, is no results file, or is of a newer version.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FileError(f"results {path}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:
        raise FileError(f"results {path}: is not JSON ({error})") from None
    kind = content.get("format") if isinstance(content, dict) else None
    if not isinstance(kind, dict) or kind.get("name") != FORMAT_NAME:
        raise FileError(
            f"results {path}: is not a results file; one has the format name {FORMAT_NAME!r}"
        )
    if kind.get("version") != FORMAT_VERSION:
        raise FileError(
            f"results {path}: has format version {kind.get('version')!r}; this program reads"
            f" version {FORMAT_VERSION}"
        )
    try:
        results: Results = _record_from_json(Results, content, "")
        return results
    except _FieldError as error:
        raise FileError(f"results {path}: {error}") from None


class _FieldError(Exception):
    """A field that is missing or of the wrong kind, in words."""


def _record_from_json(kind: Any, content: Any, place: str) -> Any:
    if not isinstance(content, Mapping):
        raise _FieldError(f"{place} must be an object")
    hints = get_type_hints(kind)
    values = {}
    for field in fields(kind):
        name = f"{place}.{field.name}" if place else field.name
        if field.name not in content and name not in ADDED_FIELDS:
            raise _FieldError(f"the field {name} is missing")
        value = content.get(field.name, ADDED_FIELDS.get(name))
        values[field.name] = _value_from_json(hints[field.name], value, name)
    return kind(**values)


def _value_from_json(kind: Any, value: Any, place: str) -> Any:
    if get_origin(kind) is tuple:
        if not isinstance(value, list):
            raise _FieldError(f"{place} must be a list")
        item = get_args(kind)[0]
        return tuple(_value_from_json(item, v, f"{place}[{i}]") for i, v in enumerate(value))
    if kind is float:
        if value is None:
            return math.nan
        if isinstance(value, bool) or not isinstance(value, float | int):
            raise _FieldError(f"{place} is {value!r}: it must be a number or null")
        return float(value)
    if kind in WANTED:
        if not isinstance(value, kind) or isinstance(value, bool) is not (kind is bool):
            raise _FieldError(f"{place} is {value!r}: it must be {WANTED[kind]}")
        return value
    return _record_from_json(kind, value, place)
