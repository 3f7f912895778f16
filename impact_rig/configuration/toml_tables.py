"""Tables of a TOML file, read with errors that name place and value."""

import difflib
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from impact_rig.configuration.units import parse_quantity
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.core.setup.settings import AnalysisSettings

ANALYSIS_QUANTITIES = {
    "cutoff_frequency": ("Hz", "50 kHz"),
    "pre_trigger": ("s", "200 us"),
    "record_duration": ("s", "2 ms"),
}
"""Settings that have a unit; the others are plain numbers."""
WHOLE_SETTINGS = ("overload_run", "keep_hits")


def read_text_file(path: Path, what: str) -> str:
    """Return the text of a file; `what` it is, for the message.

    Raises
    ------
    FileError
        If there is no such file, or it is no text.
    """
    try:
        return path.read_text("utf-8")
    except FileNotFoundError:
        raise FileError(f"there is no {what} {path}: check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"the {what} {path} cannot be read: {error}") from None


def parse_toml(text: str) -> Mapping[str, Any]:
    """Read TOML; raises `ParameterError`."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ParameterError(f"this is no TOML: {error}") from None


def take_table(document: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    """Return a table, empty where there is none; raises `ParameterError` if it is none."""
    table = document.get(key, {})
    if not isinstance(table, dict):
        raise ParameterError(f"{key} is {table!r}: it must be a table [{key}]")
    return table


def take_text(table: Mapping[str, Any], place: str, key: str) -> str:
    """Return a text, empty where there is none; raises `ParameterError` if it is none."""
    value = table.get(key, "")
    if not isinstance(value, str):
        raise ParameterError(f"{key} of {place} is {value!r}: it must be a text in quotes")
    return value


def check_keys(table: Mapping[str, Any], place: str, known: Iterable[str]) -> None:
    """Require keys that are known, and suggest one where it is not; raises `ParameterError`."""
    names = list(known)
    for key in table:
        if key not in names:
            near = difflib.get_close_matches(key, names, n=1)
            hint = f"did you mean {near[0]!r}?" if near else "it knows " + ", ".join(names)
            raise ParameterError(f"{place} has an unknown key {key!r}: {hint}")


def parse_mass(table: Mapping[str, Any], place: str, key: str, example: str) -> float:
    """Return an optional mass or its uncertainty [kg]; 0: not stated."""
    if key not in table:
        return 0.0
    return parse_quantity(f"{key} of {place}", table[key], "kg", example)


def parse_required(
    table: Mapping[str, Any], place: str, key: str, unit: str, example: str
) -> float:
    """Return a quantity in SI units; raises `ParameterError`, too if it is missing."""
    if key not in table:
        raise ParameterError(f'{place} lacks {key}: give it, for example {key} = "{example}"')
    return parse_quantity(f"{key} of {place}", table[key], unit, example)


def parse_settings(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings that the table [analysis] gives, in SI units, by their names."""
    table = take_table(document, "analysis")
    check_keys(table, "[analysis]", AnalysisSettings.__dataclass_fields__)
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key in ANALYSIS_QUANTITIES:
            unit, example = ANALYSIS_QUANTITIES[key]
            values[key] = parse_quantity(f"{key} in [analysis]", value, unit, example)
        elif isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ParameterError(f"{key} in [analysis] is {value!r}: it must be a plain number")
        elif key not in WHOLE_SETTINGS:
            values[key] = float(value)
        elif not isinstance(value, int):
            raise ParameterError(f"{key} in [analysis] is {value!r}: it must be whole")
        else:
            values[key] = value
    return values
