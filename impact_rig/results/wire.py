"""Records to JSON and to columns of text, and back, by one rule.

A record is a frozen dataclass; its fields say what they are (`core.quantity.describe`).

- JSON calls a field by its name and its unit: `half_amplitude_width_s`. A `Quantity` is five
  numbers, `stiffness_n_per_m`, with `_u_`, `_expanded_`, `_lower_` and `_upper_` before the unit:
  standard uncertainty, U, ends of the 95 % interval; the budgets of all quantities of a record are
  its list `budget`. What is not determined (NaN) is null.
- A row of text has what JSON has, without records within records.
"""

import json
import math
import re
import sys
from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any, TypeVar, get_args, get_origin

from impact_rig.core.given.errors import ParameterError, RigError
from impact_rig.core.given.findings import join_findings
from impact_rig.core.given.quantity import (
    CODES,
    BudgetLine,
    Quantity,
    StoredField,
    list_fields,
    read_code,
)
from impact_rig.core.given.records import Origin

Json = dict[str, Any]
Record = TypeVar("Record")
NUMBERS = {
    "": "value", "u": "standard", "expanded": "expanded", "lower": "lower", "upper": "upper",
}  # fmt: skip
"""Fields of a quantity, by the suffix of the name in JSON."""
BUDGET = "budget"
WANTED = {int: "a whole number from 0 to below 2^63", str: "text", bool: "true or false"}
"""Kinds of values that are taken as they are, with their names for messages."""
LARGEST_WHOLE = 2**63
"""Whole numbers are below this [-]: those of messages are."""
JOINED = ("warnings", "notes")
"""Lists whose items share a cell of a row."""

SURROGATE = re.compile("[\ud800-\udfff]")
"""Half of a letter in UTF-16: JSON can write it, but it is no text."""


class WireError(RigError):
    """A field is missing or of the wrong kind."""


def _make_key(field: StoredField, kind: str = "") -> str:
    """Return the name of a field in JSON; `kind` is a key of `NUMBERS`."""
    said = field.description
    unit = said.unit.lower()
    for sign, word in (("/", "_per_"), ("^n", "_n"), ("^", ""), (" ", "_")):
        unit = unit.replace(sign, word)
    return "_".join(part for part in (said.written or field.name, kind, unit) if part)


def to_json(record: Any) -> Json:
    """Return a record as a dict of plain values."""
    content: Json = {}
    lines: list[Json] = []
    for field in list_fields(type(record)):
        value = getattr(record, field.name)
        if field.hint is Quantity:
            for kind, name in NUMBERS.items():
                content[_make_key(field, kind)] = _value_to_json(float, getattr(value, name))
            lines += [{"quantity": field.name, **to_json(line)} for line in value.budget]
            content[BUDGET] = lines
        elif field.description.is_inline:
            content |= to_json(value)
        else:
            content[_make_key(field)] = _value_to_json(field.hint, value)
    return content


def _value_to_json(hint: Any, value: Any) -> Any:
    if get_origin(hint) is tuple:
        return [_value_to_json(get_args(hint)[0], item) for item in value]
    if hint is float:
        return float(value) if math.isfinite(value) else None
    if hint in CODES:
        return value.value
    return to_json(value) if is_dataclass(value) else value


def from_json(kind: type[Record], content: Any, place: str = "") -> Record:
    """Return the record that JSON holds.

    Parameters
    ----------
    content : object
        As parsed.
    place : str
        Of the record in the file, for what is said of it.

    Raises
    ------
    WireError
        If a field is missing, of the wrong kind, or cannot be meant.
    """
    if not isinstance(content, Mapping):
        raise WireError(f"{place} must be an object")
    values: Json = {}
    for field in list_fields(kind):
        if field.hint is Quantity:
            values[field.name] = _read_quantity(field, content, place)
        elif field.description.is_inline:
            values[field.name] = from_json(field.hint, content, place)
        else:
            values[field.name] = _read_value(field.hint, content, _make_key(field), place)
        found = values[field.name]
        if (problem := field.description.explain(found)) is not None:
            raise WireError(f"{_join(place, _make_key(field))} {problem}")
        if isinstance(found, Quantity) and (wrong := found.find_impossible(field.description)):
            number = next(key for key, each in NUMBERS.items() if each == wrong[0])
            raise WireError(f"{_join(place, _make_key(field, number))} {wrong[1]}")
    try:
        return kind(**values)
    except WireError:
        raise
    except RigError as error:
        raise WireError(f"{place}: {error}") from None


def _read_quantity(field: StoredField, content: Mapping[str, Any], place: str) -> Quantity:
    numbers: Json = {}
    for kind, name in NUMBERS.items():
        key = _make_key(field, kind)
        numbers[name] = _read_value(float, content, key, place)
    lines = content.get(BUDGET)
    if not isinstance(lines, list):
        raise WireError(f"{_join(place, BUDGET)} must be a list")
    budget = tuple(
        from_json(BudgetLine, line, f"{_join(place, BUDGET)}[{number}]")
        for number, line in enumerate(lines)
        if isinstance(line, Mapping) and line.get("quantity") == field.name
    )
    return Quantity(**numbers, budget=budget)


def _read_value(hint: Any, content: Mapping[str, Any], key: str, place: str) -> Any:
    if key not in content:
        raise WireError(f"the field {_join(place, key)} is missing")
    return _value_from_json(hint, content[key], _join(place, key))


def _value_from_json(hint: Any, value: Any, place: str) -> Any:
    if get_origin(hint) is tuple:
        if not isinstance(value, list):
            raise WireError(f"{place} must be a list")
        item = get_args(hint)[0]
        return tuple(
            _value_from_json(item, each, f"{place}[{number}]") for number, each in enumerate(value)
        )
    if hint is float:
        if value is None:
            return math.nan
        is_number = isinstance(value, float | int) and not isinstance(value, bool)
        if not is_number or not abs(value) <= sys.float_info.max:
            raise WireError(f"{place} is {value!r:.32}: it must be a finite number or null")
        return float(value)
    if hint in CODES:
        return _read_code(hint, value, place)
    if hint in WANTED:
        is_kind = isinstance(value, hint) and isinstance(value, bool) is (hint is bool)
        if not is_kind or (hint is int and not 0 <= value < LARGEST_WHOLE):
            raise WireError(f"{place} is {value!r:.32}: it must be {WANTED[hint]}")
        if hint is str and SURROGATE.search(value):
            raise WireError(f"{place} is {value!r}: it holds half a letter")
        return value
    return from_json(hint, value, place)


def _read_code(hint: Any, value: Any, place: str) -> Any:
    try:
        return read_code(hint, _value_from_json(str, value, place))
    except ParameterError as error:
        raise WireError(f"{place} {error}") from None


def _join(place: str, name: str) -> str:
    return f"{place}.{name}" if place else name


def to_row(record: Any, prefix: str = "") -> dict[str, str]:
    """Return the numbers and texts of a record, by column; what is not determined is empty."""
    cells = {}
    for key, value in to_json(record).items():
        if key in JOINED:
            cells[prefix + key] = join_findings(getattr(record, key))
        elif isinstance(value, float):
            cells[prefix + key] = repr(value)
        elif not isinstance(value, list | dict):
            cells[prefix + key] = "" if value is None else str(value)
    return cells


def origin_to_json(origin: Origin) -> Json:
    """Return what a file says at its beginning of the origin of all that is in it."""
    return {"origin": origin.kind, "origin_source": origin.source}


UNSAFE = re.compile("[\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""What JSON may hold as it is, and terminals take for a command or an end of the line."""


def format_json(content: Any) -> str:
    """Return JSON text as every command prints it: indented, ending in a new line."""
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    return UNSAFE.sub(lambda letter: f"\\u{ord(letter[0]):04x}", text) + "\n"
