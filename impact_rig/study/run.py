"""Runs the units of a study over the cores, and goes on where an earlier run was stopped."""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from typing import Any

from impact_rig.core.errors import RigError
from impact_rig.study.cases import Configuration, Part
from impact_rig.study.folder import StudyFolder
from impact_rig.study.units import Unit, plan_units, run_unit

THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
)
"""What the linear algebra libraries read when they are loaded."""

Report = Callable[[int, int], None]
"""Takes finished and all campaigns."""


def run_units(
    configuration: Configuration, folder: StudyFolder, jobs: int, report: Report
) -> None:
    """Do what is missing in the folder.

    Numbers do not depend on `jobs`: every campaign has random numbers of its own, and even a
    single job runs in a process of its own, where linear algebra has one thread.

    Parameters
    ----------
    configuration : Configuration
        What is asked.
    folder : StudyFolder
        Takes each unit as it is finished.
    jobs : int
        Processes.
    report : callable
        Is called with the finished and all campaigns, at the start and after each unit.

    Raises
    ------
    KeyboardInterrupt
        After the units that were running are kept.
    RigError
        If a process was killed.
    """
    units = plan_units(configuration)
    total = sum(unit.count for unit in units)
    done = sum(unit.count for unit in units if unit.name in folder.finished)
    report(done, total)
    missing = [unit for unit in units if unit.name not in folder.finished]
    # Times are measured when nothing else runs.
    together = [unit for unit in missing if unit.part is not Part.SPEED]
    alone = [unit for unit in missing if unit.part is Part.SPEED]
    if not missing:
        return
    with _start_pool(min(jobs, max(len(together), 1))) as pool:
        for batch in (together, *([unit] for unit in alone)):
            futures = {pool.submit(run_unit, unit, configuration.seed): unit for unit in batch}
            try:
                for future in as_completed(futures):
                    unit = futures[future]
                    folder.keep(unit.name, future.result())
                    done += unit.count
                    report(done, total)
            except BaseException as error:
                pool.shutdown(wait=True, cancel_futures=True)
                _keep_what_is_finished(futures, folder)
                if isinstance(error, BrokenProcessPool):
                    raise RigError(
                        "a process of the study was killed, perhaps for want of memory: the same"
                        " command with the same --output goes on"
                    ) from None
                raise


def _keep_what_is_finished(
    futures: dict[Future[dict[str, Any]], Unit], folder: StudyFolder
) -> None:
    for future, unit in futures.items():
        is_lost = not future.done() or future.cancelled() or future.exception() is not None
        if not is_lost and unit.name not in folder.finished:
            folder.keep(unit.name, future.result())


@contextmanager
def _start_pool(jobs: int) -> Iterator[ProcessPoolExecutor]:
    """Start fresh processes: libraries load in them with one thread each."""
    before = {name: os.environ.get(name) for name in THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    try:
        with ProcessPoolExecutor(
            jobs, mp_context=get_context("spawn"), initializer=_start_worker
        ) as pool:
            yield pool
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _start_worker() -> None:
    """Leave Ctrl-C to the parent, and end when the parent is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
