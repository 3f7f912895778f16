"""What a person sees while one recording is analyzed, if that takes its time."""

from pathlib import Path

from rich.console import Console
from rich.progress import TextColumn

from impact_rig.cli.progress_bar import PATIENCE, ProgressBar, TimeLeft

MEGABYTE = 1e6


class AnalysisProgress(ProgressBar):
    """Follows the analysis of one recording; a context manager.

    Parameters
    ----------
    console : Console
        Where to; without a terminal nothing is shown.
    path : Path
        Of the recording.
    """

    def __init__(self, console: Console, path: Path) -> None:
        self._path = path
        self._what = ""
        super().__init__(
            console,
            str(path),
            TextColumn("{task.fields[figures]}"),
            TimeLeft(),
            patience=PATIENCE,
            figures="",
        )

    def report(self, what: str, done: int, total: int) -> None:
        """Take what is done, ``reading`` [byte] or ``estimating`` [samples], and how far it is."""
        if what != self._what or not done:
            self._what = what
            self.restart(f"{what} {self._path}" if what == "reading" else what, total)
        if what == "reading":
            figures = f"{done / MEGABYTE:.0f} of {total / MEGABYTE:.0f} MB"
        else:
            figures = f"{done} of {total} samples"
        self.update(completed=done, figures=figures)
