"""What commands that read files share: their errors, and how results are printed."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click

from impact_rig.core.errors import RigError
from impact_rig.present.terminal.console import make_console, make_printable, print_warning
from impact_rig.present.terminal.results import print_full, print_screen
from impact_rig.results.campaign import Results
from impact_rig.results.results_file import format_json, results_to_json

_S = TypeVar("_S")
_T = TypeVar("_T")


def process_each(files: Iterable[_S], process: Callable[[_S], _T]) -> tuple[list[_T], list[str]]:
    """Process files; return the results, and the errors of the others."""
    results: list[_T] = []
    errors: list[str] = []
    for file in files:
        try:
            results.append(process(file))
        except RigError as error:
            errors.append(str(error))
    return results, errors


def raise_errors(errors: Sequence[str]) -> None:
    """Print all errors, a line each, and end the command if there are any.

    Raises
    ------
    RigError
        The last one, which ends the command.
    """
    for error in errors[:-1]:
        click.echo(make_printable(f"error: {error}"), err=True)
    if errors:
        raise RigError(errors[-1])


def print_json(contents: Sequence[Any], *, is_list: bool) -> None:
    """Print one content, or a list of them, as JSON; without any, nothing."""
    if contents:
        click.echo(format_json(list(contents) if is_list else contents[0]), nl=False)


def show_results(
    path: Path,
    found: Sequence[Results],
    warnings: Sequence[str] = (),
    *,
    is_full: bool,
    as_json: bool,
) -> None:
    """Print the results of a file, campaign by campaign, as tables or as JSON."""
    if as_json:
        for warning in warnings:
            print_warning(warning)
        print_json(list(map(results_to_json, found)), is_list=len(found) > 1)
        return
    console = make_console()
    show = print_full if is_full else print_screen
    for number, results in enumerate(found, start=1):
        if len(found) > 1:
            console.print(f"{path}, campaign {number}\n", style="bold underline")
        show(console, results, warnings)
