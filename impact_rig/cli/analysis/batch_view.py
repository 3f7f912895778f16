"""What a person sees while many recordings are analyzed: a bar, or a line for each."""

from pathlib import Path

from rich.console import Console
from rich.progress import MofNCompleteColumn

from impact_rig.cli.progress_bar import ProgressBar, TimeLeft


class BatchProgress(ProgressBar):
    """Follows a batch on standard error; a context manager.

    Parameters
    ----------
    console : Console
        Where to; without a terminal, a line for each recording instead of a bar.
    total : int
        Recordings.
    """

    def __init__(self, console: Console, total: int) -> None:
        self._total = total
        self._done = 0
        super().__init__(console, "recordings", MofNCompleteColumn(), TimeLeft(), total=total)

    def report(self, path: Path) -> None:
        """Take a finished recording."""
        self._done += 1
        self.update(completed=self._done)
        if not self.is_drawn:
            self.console.print(f"{self._done} of {self._total}: {path}", soft_wrap=True)
