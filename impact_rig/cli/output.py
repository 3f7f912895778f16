"""Output of commands: progress, results, errors, places of files."""

import contextlib
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from impact_rig.configuration.processes import RECORDING_NAME, REPORT_NAME
from impact_rig.core.given.errors import RigError
from impact_rig.present.console import (
    GOOD,
    make_console,
    make_printable,
    print_text,
    print_trace,
    print_warning,
)
from impact_rig.results.wire import format_json

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from impact_rig.analysis.measured_files import MeasuredFiles
    from impact_rig.results.campaign import Results

_S = TypeVar("_S")
_T = TypeVar("_T")


def make_progress() -> "Progress":
    """Return rich's progress bar on standard error, drawn in terminals only."""
    from rich import progress

    console = make_console(stderr=True)
    return progress.Progress(
        progress.TextColumn("{task.description}"),
        progress.BarColumn(None, complete_style=GOOD, finished_style=GOOD),
        progress.TaskProgressColumn(),
        progress.TimeRemainingColumn(),
        console=console,
        transient=True,
        # What a command prints goes above the bar, but not what it writes into a pipe.
        redirect_stdout=sys.stdout.isatty(),
        disable=not console.is_interactive,
    )


@contextlib.contextmanager
def show_progress() -> Iterator[Callable[..., None]]:
    """Yield a function that shows a progress bar for each stage of the work.

    It takes the name of the stage, the work done in it and, at its first call, its total.
    """
    if not make_console(stderr=True).is_interactive:
        yield lambda *_: None
        return
    stages: dict[str, TaskID] = {}
    with make_progress() as progress:

        def follow(stage: str, done: float, total: float | None = None) -> None:
            if stage not in stages:
                stages[stage] = progress.add_task(stage, total=total)
            progress.update(stages[stage], completed=done)

        yield follow


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
    """Print all errors, one per line, and end the command if there are any.

    Raises
    ------
    RigError
        The last one, which ends the command.
    """
    for error in errors[:-1]:
        click.echo(make_printable(f"error: {error}"), err=True)
    if errors:
        raise RigError(errors[-1])


def print_json(contents: Sequence[Any], *, is_list: bool = True) -> None:
    """Print contents as JSON: as a list or, if there is only one, by itself."""
    if contents or is_list:
        click.echo(format_json(contents if is_list else contents[0]), nl=False)


def show_results(
    path: Path,
    found: "Sequence[Results]",
    warnings: Sequence[str] = (),
    *,
    is_full: bool,
    as_json: bool,
) -> None:
    """Print the results of each campaign of a file, as tables or as JSON."""
    # Most commands show none.
    from impact_rig.present.screen import print_full, print_screen
    from impact_rig.results.results_file import results_to_json

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


def print_places(**places: Path | None) -> None:
    """Print on standard error where the files lie, and how to make a report."""
    for name, path in places.items():
        if path is not None:
            click.echo(f"{name + ':':10} {shorten_path(path)}", err=True)
    source = places.get("recording") or places.get("results")
    if source is not None:
        run = source.parent if source.name == RECORDING_NAME else source
        report = (run if run.is_dir() else run.parent) / REPORT_NAME
        command = f"impact-rig report {shorten_path(run)}"
        click.echo(f"report:    {shorten_path(report) if report.exists() else command}", err=True)


def print_taken(files: "MeasuredFiles", *, is_shown: bool, is_aside: bool = False) -> None:
    """Print which channel was taken as what, and draw the first hit of each choice if asked to.

    Beside JSON that goes to standard error.
    """
    console = make_console(stderr=is_aside)
    for line in files.taken:
        print_text(console, f"Channels: {line}.")
    first = {hit.taken: hit for hit in reversed(files.hits)} if is_shown else {}
    for hit in reversed(first.values()):
        block = hit.block
        print_text(
            console, f"{hit.path.name}: {hit.duration * 1e3:.4g} ms at {block.sampling_rate:g} Hz"
        )
        for role, name, channel in zip(
            ("hammer", "sample"), hit.names, block.channels, strict=False
        ):
            print_trace(console, f"{role} {name!r}, as in the file", channel.output)


def shorten_path(path: Path) -> Path:
    """Return a path relative to the working folder if it lies in it."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path
