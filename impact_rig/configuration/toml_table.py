"""A table of a TOML file whose errors name the line, the value and what would be right."""

import contextlib
import datetime as dt
import difflib
import math
import re
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from numbers import Integral, Real
from pathlib import Path
from typing import Any, TypeVar

from impact_rig.configuration.units import parse_quantity
from impact_rig.core.given.errors import FileError, ParameterError, RigError

Content = TypeVar("Content")


def read_toml_file(path: Path, what: str, parse: Callable[[str], Content]) -> Content:
    """Parse the text of a file; `what` names its kind in messages.

    Raises
    ------
    FileError
        If it does not exist, is no text, or `parse` refuses it; the message names the file.
    """
    if path.exists() and not path.is_file():  # a pipe may never end
        raise FileError(f"the {what} {path} cannot be read: it is no regular file")
    try:
        return parse(path.read_text("utf-8-sig"))
    except FileNotFoundError:
        raise FileError(f"there is no {what} {path}: check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"the {what} {path} cannot be read: {error}") from None
    except RigError as error:
        raise FileError(f"{what} {path}: {error}") from None


KeyPath = tuple[str | int, ...]
"""Keys from the top of the file down to a value; tables of a list are counted from 0."""


def find_lines(text: str) -> dict[KeyPath, int]:
    """Return the line on which each table and each of its keys begins, counted from 1.

    Parameters
    ----------
    text : str
        That `tomllib` can read.
    """
    lines: dict[KeyPath, int] = {}
    newest: dict[KeyPath, int] = {}
    table: KeyPath = ()
    for line, statement in _split_statements(text):
        values = tomllib.loads(statement)
        if statement.lstrip().startswith("["):
            table = _follow_header(values, newest)
            lines.setdefault(table, line)
        else:
            for key in values:
                lines.setdefault((*table, key), line)
    return lines


def _split_statements(text: str) -> Iterator[tuple[int, str]]:
    """Yield each header or assignment, with its line; it ends where it can be read by itself."""
    statement, begin = "", 1
    for number, line in enumerate(text.split("\n"), start=1):
        statement += line + "\n"
        try:
            tomllib.loads(statement)
        except tomllib.TOMLDecodeError:
            continue
        yield begin, statement
        statement, begin = "", number + 1


def _follow_header(values: Mapping[str, Any], newest: dict[KeyPath, int]) -> KeyPath:
    """Return which table a header begins.

    Parameters
    ----------
    values : mapping
        What the header alone gives.
    newest : dict
        Number of the newest table of each list of tables; brought up to date.
    """
    path: KeyPath = ()
    below: Any = values
    while below:
        ((key, below),) = below.items()
        path = (*path, key)
        if isinstance(below, list):
            newest[path] = newest.get(path, -1) + 1
            below = {}
        if path in newest:
            path = (*path, newest[path])
    return path


REQUIRED: Any = object()
"""Default of a key that must be there."""
LARGEST = sys.float_info.max  # a whole number of TOML may be larger


class TomlTable(Mapping[str, Any]):
    """A table that is read key by key, each with its type and range.

    `check_keys` finds keys that no `take_` method reads.

    Parameters
    ----------
    values : mapping
        As `tomllib` gives it.
    place : str
        What the table is called in messages: "the file", "[source]".
    lines : mapping
        Where in the file each path stands, counted from 1; empty: not from a file.
    path : tuple
        Of this table.
    """

    def __init__(
        self,
        values: Mapping[str, Any],
        place: str = "the file",
        lines: Mapping[KeyPath, int] | None = None,
        path: KeyPath = (),
    ) -> None:
        self._values = values
        self.place = place
        self._lines = lines or {}
        self._path = path
        self._taken: tuple[str, ...] = ()  # keys that other readers take

    def __getitem__(self, key: str) -> Any:
        """Return a value as the file has it."""
        return self._values[key]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the keys."""
        return iter(self._values)

    def __len__(self) -> int:
        """Return the number of keys."""
        return len(self._values)

    def without(self, *keys: str) -> "TomlTable":
        """Return the table without some keys, which other readers take."""
        left = {key: value for key, value in self._values.items() if key not in keys}
        table = TomlTable(left, self.place, self._lines, self._path)
        table._taken = (*self._taken, *keys)
        return table

    def merge(self, other: "TomlTable") -> "TomlTable":
        """Return the table with the values of another one in place of its own."""
        overruled = {(*self._path, key) for key in other}
        lines = {
            place: line
            for place, line in self._lines.items()
            if place[: len(self._path) + 1] not in overruled
        }
        return TomlTable({**self._values, **other}, self.place, lines, self._path)

    def make_error(self, key: str, text: str) -> ParameterError:
        """Return an error that names the line of a key, or of the table that should have it."""
        place: KeyPath = (*self._path, key)
        while place and place not in self._lines:
            place = place[:-1]
        line = self._lines.get(place)
        error = ParameterError(f"line {line}: {text}" if line else text)
        error.line = line
        return error

    @contextlib.contextmanager
    def locating(self, key: str = "") -> Iterator[None]:
        """Add the line of a key to an error that is raised in the block.

        Without a key it is the longest one in the name of what has the value, else the line of
        the table.
        """
        try:
            yield
        except ParameterError as error:
            name = error.name.replace("_", " ").replace("-", " ")
            named = [item for item in self._values if item.replace("_", " ") in name]
            key = key or max(named, key=len, default="")
            raise self.make_error(key, str(error)) from None

    def refuse(self, key: str, wanted: str) -> ParameterError:
        """Return the error that a value is not what is wanted: "it must be ..."."""
        return self.make_error(
            key, f"{key} of {self.place} is {self._values.get(key)!r}: it must be {wanted}"
        )

    def check_keys(self, *known: str) -> None:
        """Refuse unknown keys, and suggest the nearest known one.

        Raises
        ------
        ParameterError
            If a key is unknown.
        """
        known += self._taken
        for key in self._values:
            if key not in known:
                near = difflib.get_close_matches(key, known, n=1)
                hint = f"did you mean {near[0]!r}?" if near else "it knows " + ", ".join(known)
                raise self.make_error(key, f"{self.place} has an unknown key {key!r}: {hint}")

    def take_text(self, key: str, default: str = "", example: str = "") -> str:
        """Return a text; raises `ParameterError` if it has another type or is missing."""
        value = self._take(key, default, f'"{example}"')
        if not isinstance(value, str):
            raise self.refuse(key, "a text in quotes")
        return value

    def take_choice(self, key: str, choices: Sequence[str], default: str = REQUIRED) -> str:
        """Return one of some texts; errors as `take_text`."""
        value = self.take_text(key, default, choices[0])
        if value not in choices:
            raise self.refuse(key, "one of " + ", ".join(choices))
        return value

    def take_boolean(self, key: str) -> bool:
        """Return true or, where it is missing, false; raises `ParameterError` if it is neither."""
        value = self._values.get(key, False)
        if not isinstance(value, bool):
            raise self.refuse(key, "true or false")
        return value

    def take_number(
        self, key: str, low: float = -LARGEST, high: float = LARGEST, default: float = REQUIRED
    ) -> float:
        """Return a plain number between two others; raises `ParameterError`."""
        value = self._take(key, default, "1.0")
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not low <= value <= high:
            limits = "" if high == LARGEST else f" between {low:g} and {high:g}"
            raise self.refuse(key, f"a plain number{limits}")
        return float(value)

    def take_whole(self, key: str, low: int, high: int, default: int = REQUIRED) -> int:
        """Return a whole number between two others; raises `ParameterError`."""
        value = self._take(key, default, str(low))
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            raise self.refuse(key, f"a whole number between {low} and {high}")
        return value

    def take_quantity(
        self,
        key: str,
        unit: str,
        example: str,
        default: float = REQUIRED,
        *,
        low: float = -math.inf,
        high: float = math.inf,
    ) -> float:
        """Return a quantity in SI units.

        Parameters
        ----------
        key : str
            Of the table.
        unit : str
            SI unit of the result, in pint's notation.
        example : str
            A good value, for the message.
        default : float
            Where the key is missing.
        low, high : float
            What it may be [unit].

        Raises
        ------
        ParameterError
            If it is missing and `REQUIRED`, is no quantity, or not in the range.
        """
        value = self._take(key, default, f'"{example}"')
        if key not in self._values:
            return float(value)
        with self.locating(key):
            number = parse_quantity(f"{key} of {self.place}", value, unit, example)
        if not (low <= number <= high and math.isfinite(number)):
            raise self.refuse(key, _describe_range(low, high, unit))
        return number

    def take_date(self, key: str) -> str:
        """Return a date as year-month-day, empty if it is missing; raises `ParameterError`."""
        value = self._values.get(key, "")
        if isinstance(value, dt.date) and not isinstance(value, dt.datetime):
            return value.isoformat()
        if value == "":
            return ""
        try:
            return dt.date.fromisoformat(value).isoformat()
        except (TypeError, ValueError):
            raise self.refuse(key, "a date, written as year-month-day like 2026-03-01") from None

    def take_table(self, key: str) -> "TomlTable":
        """Return a table below this one, empty if it is missing; raises `ParameterError`."""
        value = self._values.get(key, {})
        name = ".".join(str(part) for part in (*self._path, key))
        if not isinstance(value, Mapping):
            raise self.make_error(key, f"{name} is {value!r}: it must be a table [{name}]")
        return TomlTable(value, f"[{name}]", self._lines, (*self._path, key))

    def take_tables(self, key: str) -> "tuple[TomlTable, ...]":
        """Return a list of tables, empty if it is missing; raises `ParameterError`."""
        entries = self._values.get(key, [])
        if not isinstance(entries, list) or not all(isinstance(item, Mapping) for item in entries):
            raise self.make_error(key, f"{key}: give it as tables [[{key}]], one for each")
        return tuple(
            TomlTable(entry, f"{key} {entry.get('name', number + 1)!r}", self._lines,
                      (*self._path, key, number))
            for number, entry in enumerate(entries)
        )  # fmt: skip

    def _take(self, key: str, default: Any, example: str) -> Any:
        if key in self._values:
            return self._values[key]
        if default is REQUIRED:
            raise self.make_error(
                key, f"{self.place} lacks {key}: give it, for example {key} = {example}"
            )
        return default


def _describe_range(low: float, high: float, unit: str) -> str:
    if math.isfinite(low) and math.isfinite(high):
        return f"between {low:g} and {high:g} {unit}"
    if math.isfinite(low):
        return f"{low:g} {unit} or more"
    return f"{high:g} {unit} or less" if math.isfinite(high) else f"a finite number of {unit}"


def make_values(given: Mapping[str, Any], units: Mapping[str, str]) -> dict[str, Any]:
    """Return what a program gives as TOML would have it: with units [SI], of Python's types."""
    values = dict(given)
    for key, value in given.items():
        if isinstance(value, Real) and not isinstance(value, bool):
            number = int(value) if isinstance(value, Integral) else float(value)
            values[key] = f"{number!r} {units[key]}" if key in units else number
    return values


def parse_toml_table(text: str) -> TomlTable:
    """Read the text of a TOML file; raises `ParameterError` if it is not TOML."""
    # Each part is a table, and 20 000 of them take 1.6 GB.
    if re.search(r"(?<![\w\"'-])(?:[\w\"'-]+[ \t]*\.[ \t]*){64}", text):
        raise ParameterError("this is not TOML: a key has more than 64 parts")
    try:
        values = tomllib.loads(text)
        lines = find_lines(text)
    except ValueError as error:
        raise ParameterError(f"this is not TOML: {error}") from None
    except RecursionError:
        raise ParameterError("this is not TOML: it is nested too deep") from None
    return TomlTable(values, lines=lines)
