"""Where in the text of a TOML file its keys stand, which `tomllib` does not tell."""

import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

KeyPath = tuple[str | int, ...]
"""Keys from the top of the file down to a value; tables of a list are counted from 0."""


def find_lines(text: str) -> dict[KeyPath, int]:
    """Return on which line of a TOML text each table and key begins, counted from 1.

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
            for path in _list_paths(values):
                lines.setdefault((*table, *path), line)
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


def _list_paths(value: Any) -> Iterator[KeyPath]:
    """Yield the path of everything below a value."""
    if not isinstance(value, dict | list):
        return
    for key, item in value.items() if isinstance(value, dict) else enumerate(value):
        yield (key,)
        for path in _list_paths(item):
            yield (key, *path)
