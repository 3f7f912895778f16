"""A new sensitivity in the text of a rig file: two lines change, and nothing else."""

import copy
import re
from pathlib import Path
from typing import Any

from impact_rig.configuration.toml_table import TomlTable, find_lines, parse_toml_table
from impact_rig.configuration.units import parse_sensitivity
from impact_rig.core.errors import FileError, ParameterError

DIGITS = 6  # of a sensitivity: more than any calibration determines
_VOLTAGE = re.compile(r"\s*(?P<number>[+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*(?P<unit>[^\s\d/][^/]*)")
_DATED = re.compile(r"-\d{4}-\d{2}-\d{2}$")


def name_new_file(path: Path, day: str) -> Path:
    """Return ``rig-2026-11-21.toml`` for ``rig.toml``, and for ``rig-2026-03-01.toml``."""
    return path.with_name(f"{_DATED.sub('', path.stem)}-{day}{path.suffix}")


def change_sheet(text: str, channel: str, sensitivity: float, day: str) -> str:
    """Return the text of a rig file with another sensitivity and another date of calibration.

    Parameters
    ----------
    text : str
        Of the file; its line ends and comments stay as they are.
    channel : {"hammer", "specimen"}
        Of the sensor.
    sensitivity : float
        For one unit of its sensitivity in the file [V].
    day : str
        Of the calibration, year-month-day.

    Raises
    ------
    ParameterError
        If the file has no sensitivity of that sensor.
    FileError
        If it is written in a way that cannot be changed by itself.
    """
    document = parse_toml_table(text)
    table = document.take_table("source").take_table(channel)
    written = _format_sensitivity(table, sensitivity)
    lines, places = text.split("\n"), find_lines(text)
    place = places["source", channel, "sensitivity"] - 1
    lines[place] = _replace_value(lines[place], "sensitivity", f'"{written}"')
    if "calibration_date" in table:
        dated = places["source", channel, "calibration_date"] - 1
        lines[dated] = _replace_value(lines[dated], "calibration_date", day)
    else:
        lines.insert(place + 1, _make_date_line(lines[place], day))
    new = "\n".join(lines)
    _check_change(text, new, channel, written, day)
    return new


def _format_sensitivity(table: TomlTable, sensitivity: float) -> str:
    """Return a sensitivity in the units in which the file has the old one."""
    old = table.get("sensitivity")
    if not isinstance(old, str):
        raise table.make_error(
            "sensitivity", f"{table.place} has no sensitivity: give it, for example 10 mV/g"
        )
    voltage, stroke, unit = old.partition("/")
    match = _VOLTAGE.fullmatch(voltage)
    if match is None:
        raise table.refuse("sensitivity", 'a voltage per unit, written like "10 mV/g"')
    scale = parse_sensitivity("sensitivity", f"1 {match['unit']}/{unit}").voltage
    return f"{sensitivity / scale:.{DIGITS}g} {match['unit']}{stroke}{unit}"


def _replace_value(line: str, key: str, value: str) -> str:
    """Return a line with another value of a key; unchanged if it is not found."""
    pattern = rf"""(?<![\w-]){key}(["']?\s*=\s*)("[^"]*"|'[^']*'|[^\s,#}}]+)"""
    return re.sub(pattern, lambda match: f"{key}{match[1]}{value}", line, count=1)


def _make_date_line(neighbour: str, day: str) -> str:
    """Return a new line, set in and ended as the one before it."""
    indent = neighbour[: len(neighbour) - len(neighbour.lstrip())]
    return f"{indent}calibration_date = {day}" + ("\r" if neighbour.endswith("\r") else "")


def _check_change(old: str, new: str, channel: str, sensitivity: str, day: str) -> None:
    """Require that a reader of the new text finds the new sheet, and all else as it was."""
    expected: dict[str, Any] = copy.deepcopy(_read_plain(old))
    sheet = expected["source"][channel]
    sheet["sensitivity"], sheet["calibration_date"] = sensitivity, day
    try:
        found = _read_plain(new)
        sheet_found = found["source"][channel]
        sheet_found["calibration_date"] = str(sheet_found["calibration_date"])
    except (ParameterError, KeyError):
        found = {}
    if found != expected:
        raise FileError(
            "the table of the sensor is written in a way that cannot be changed by itself: write"
            f' sensitivity = "{sensitivity}" and calibration_date = {day} into'
            f" [source.{channel}] by hand"
        )


def _read_plain(text: str) -> dict[str, Any]:
    return dict(parse_toml_table(text))
