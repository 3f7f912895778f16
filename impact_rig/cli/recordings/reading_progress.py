"""A bar on standard error while a large recording is read."""

from pathlib import Path

from rich.console import Console
from rich.progress import DownloadColumn

from impact_rig.cli.progress_bar import PATIENCE, ProgressBar, TimeLeft
from impact_rig.recording.reading.source import find_recording
from impact_rig.recording.recovery.contents import Contents
from impact_rig.recording.recovery.inspection import inspect_recording
from impact_rig.reporting.terminal.console import make_console


class ReadingProgress(ProgressBar):
    """Follows the reading of files; a context manager.

    Parameters
    ----------
    console : Console
        Where to; without a terminal nothing is shown.
    title : str
        Before the bar.
    total : int
        What will be read [byte].
    """

    def __init__(self, console: Console, title: str, total: int) -> None:
        super().__init__(
            console,
            title,
            DownloadColumn(),
            TimeLeft(),
            total=total,
            patience=PATIENCE,
        )

    def report(self, done: int) -> None:
        """Show how many bytes were read."""
        self.update(completed=done)


def inspect_with_progress(path: Path) -> Contents:
    """Read all of the recording that a path means, under a bar; errors as `inspect_recording`."""
    found = find_recording(path)
    with ReadingProgress(make_console(stderr=True), f"reading {path}", measure(found)) as bar:
        return inspect_recording(found, report=bar.report)


def measure(path: Path) -> int:
    """Return the size of a file, or of all files of a folder [byte]; 0: it cannot be told."""
    try:
        files = list(path.iterdir()) if path.is_dir() else [path]
        return sum(file.stat().st_size for file in files)
    except OSError:
        return 0
