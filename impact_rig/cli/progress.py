"""Progress bars on standard error, which are gone when the work is done."""

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
    """Takes a stage of the work, how much of it is done, and of how much."""

    def __call__(self, stage: str, done: float, total: float | None = None, /) -> None:
        """Show it."""


def make_progress() -> Progress:
    """Return rich's progress on standard error; where that is no terminal, it draws nothing."""
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
    """Yield a function that shows how far the work is: a bar for each stage of it."""
    stages: dict[str, TaskID] = {}
    with make_progress() as progress:

        def follow(stage: str, done: float, total: float | None = None) -> None:
            if stage not in stages:
                stages[stage] = progress.add_task(stage, total=total)
            progress.update(stages[stage], completed=done)

        yield follow
