"""What a person sees while many recordings are analyzed: a bar, or a line for each."""

from pathlib import Path
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn


class BatchProgress:
    """Follows a batch on standard error; a context manager.

    Parameters
    ----------
    console : Console
        Where to; without a terminal, a line for each recording instead of a bar.
    total : int
        Recordings.
    """

    def __init__(self, console: Console, total: int) -> None:
        self._console = console
        self._total = total
        self._done = 0
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("left:"),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        )
        self._task = self._progress.add_task("recordings", total=total)

    def __enter__(self) -> Self:
        """Show the bar."""
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Take the bar away."""
        self._progress.stop()

    def report(self, path: Path) -> None:
        """Take a finished recording."""
        self._done += 1
        self._progress.update(self._task, completed=self._done)
        if not self._console.is_terminal:
            self._console.print(f"{self._done} of {self._total}: {path}", soft_wrap=True)
