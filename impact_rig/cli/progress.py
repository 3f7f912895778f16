"""Progress bars on standard error; they vanish when the work is done."""

import contextlib
import sys
from collections.abc import Iterator
from typing import Protocol

from rich.progress import (
    BarColumn,
    Progress,
    TaskID,
    TaskProgressColumn,
    TextColumn,
    TimeRemainingColumn,
)

from impact_rig.present.terminal.console import GOOD, make_console


class Follow(Protocol):
    """Takes the name of a stage, the work done in it, and its total."""

    def __call__(self, stage: str, done: float, total: float | None = None, /) -> None:
        """Show it."""


def make_progress() -> Progress:
    """Return rich's progress on standard error; it draws in terminals only."""
    console = make_console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(None, complete_style=GOOD, finished_style=GOOD),
        TaskProgressColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        # What a command prints goes above the bar, but not what it writes into a pipe.
        redirect_stdout=sys.stdout.isatty(),
        disable=not console.is_interactive,
    )


@contextlib.contextmanager
def show_progress() -> Iterator[Follow]:
    """Yield a function that shows a progress bar for each stage of the work."""
    stages: dict[str, TaskID] = {}
    with make_progress() as progress:

        def follow(stage: str, done: float, total: float | None = None) -> None:
            if stage not in stages:
                stages[stage] = progress.add_task(stage, total=total)
            progress.update(stages[stage], completed=done)

        yield follow
