"""Many recordings, analyzed side by side: each gives the numbers that it gives alone."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from impact_rig.analysis.recording_analysis import (
    AnalyzedRecording,
    Settings,
    analyze_recording,
)
from impact_rig.analysis.repeated_files import list_files
from impact_rig.core.errors import RigError

WORTH_WORKERS = 1_000_000
"""Size of all recordings together [byte] from which more processes are worth the second that they
take to start, measured: a core analyzes this much in 0.3 s to 3 s, mostly by the number of samples
in it."""

Report = Callable[[Path], None]
"""Called with each recording as it is finished."""
Remark = Callable[[str], None]
"""Is told what else a person should know."""


@dataclass(frozen=True)
class BatchOutcome:
    """What came of one recording of many.

    Attributes
    ----------
    path : Path
        As it was given.
    recording : AnalyzedRecording or None
        None: it could not be analyzed.
    error : str
        Why not.
    """

    path: Path
    recording: AnalyzedRecording | None
    error: str = ""


@dataclass(frozen=True, eq=False)
class BatchTask:
    """What a worker is sent: paths and settings, no data.

    Attributes
    ----------
    path : Path
        Of the recording.
    settings : mapping
        Fields of `AnalysisSettings` to use in place of the recorded ones.
    """

    path: Path
    settings: Settings

    def run(self) -> BatchOutcome:
        """Analyze the recording; what is wrong with it is an outcome too."""
        try:
            return BatchOutcome(self.path, analyze_recording(self.path, self.settings))
        except RigError as error:
            return BatchOutcome(self.path, None, str(error))
        except MemoryError:
            return BatchOutcome(self.path, None, f"{self.path} needs more memory than there is")


def analyze_batch(
    tasks: Sequence[BatchTask],
    workers: int | None,
    scheduler: str | None,
    report: Report,
    remark: Remark,
) -> list[BatchOutcome]:
    """Analyze recordings, in processes side by side where that is faster.

    Parameters
    ----------
    workers : int or None
        Processes; None: as many as cores, or none but this one for a small batch.
    scheduler : str or None
        Address of a Dask cluster to use instead.
    report : callable
        Called with each recording as it is finished, in any order.
    remark : callable
        Is told in a sentence why it takes longer than it could.

    Returns
    -------
    list of BatchOutcome
        In the order of `tasks`.

    Raises
    ------
    RigError
        If the cluster cannot be used.
    ModuleNotFoundError
        If it needs Dask, and that is not installed.
    """
    if scheduler is not None:
        from impact_rig.analysis.dask_workers import connect_to_workers, run_on_workers

        with connect_to_workers(scheduler) as client:
            return run_on_workers(client, tasks, report)
    count = min(workers or _choose_workers([task.path for task in tasks]), len(tasks))
    if count > 1:
        try:
            from impact_rig.analysis.dask_workers import run_on_workers, start_workers
        except ModuleNotFoundError as error:
            remark(
                f"Python finds no module {error.name!r}, which Dask would bring: the recordings"
                " are analyzed one after the other"
            )
        else:
            with start_workers(count) as client:
                return run_on_workers(client, tasks, report)
    outcomes = []
    for task in tasks:
        outcomes.append(task.run())
        report(task.path)
    return outcomes


def _choose_workers(paths: Sequence[Path]) -> int:
    size = sum(_read_size(path) for path in paths)
    return len(os.sched_getaffinity(0)) if size >= WORTH_WORKERS else 1


def _read_size(path: Path) -> int:
    """Return the size of a recording [byte]; 0 for what cannot be read."""
    try:
        return sum(file.stat().st_size for file in list_files(path))
    except OSError:
        return 0
