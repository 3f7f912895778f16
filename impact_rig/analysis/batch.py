"""Many recordings, analyzed side by side: each gives the numbers that it gives alone."""

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import TYPE_CHECKING

from impact_rig.analysis.analyze import Analysis, Settings, analyze
from impact_rig.configuration.processes import compute_alone
from impact_rig.core.given.errors import RigError
from impact_rig.recordings.run import Run
from impact_rig.version import __version__

if TYPE_CHECKING:
    from distributed import Client

WORTH_WORKERS = 1_000_000
"""Size of all recordings together [byte] from which more processes are worth the second that they
take to start, measured: a core analyzes this much in 0.3 s to 3 s."""
LOOPBACK = "127.0.0.1"
"""Where workers on this computer listen: no other computer reaches them."""
CONNECT_TIMEOUT = 5.0
"""How long a cluster may take to answer [s], our choice: one that is there answers at once."""
Report = Callable[[], None]
"""Called after each run."""


def analyze_batch(
    runs: Sequence[Run],
    settings: Settings,
    workers: int | None,
    scheduler: str | None,
    report: Report,
) -> list[Analysis | RigError]:
    """Analyze runs, in processes side by side where that is faster.

    Parameters
    ----------
    settings : mapping
        Fields of `AnalysisSettings` to use in place of the recorded ones.
    workers : int or None
        Processes; None: as many as cores, or none but this one for a small batch.
    scheduler : str or None
        Address of a Dask cluster to use instead.
    report : callable
        Called after each run.

    Returns
    -------
    list of Analysis or RigError
        What came of each, in the order of `runs`.

    Raises
    ------
    RigError
        If the cluster cannot be used.
    """
    if scheduler is not None:
        with connect_to_workers(scheduler) as client:
            return run_on_workers(client, runs, settings, report)
    is_worth = sum(run.size for run in runs) >= WORTH_WORKERS
    count = min(workers or (count_cores() if is_worth else 1), len(runs))
    if count > 1:
        return run_in_processes(count, runs, settings, report)
    outcomes = []
    for run in runs:
        outcomes.append(_analyze(run, settings))
        report()
    return outcomes


def count_cores() -> int:
    """Return how many cores this process may use, or has where the system does not say."""
    is_told = hasattr(os, "sched_getaffinity")
    return len(os.sched_getaffinity(0)) if is_told else os.cpu_count() or 1


def run_in_processes(
    count: int, runs: Sequence[Run], settings: Settings, report: Report
) -> list[Analysis | RigError]:
    """Analyze runs in processes of this host; return what came of them, in their order."""
    # A server that has imported all once forks the processes, also from a program with threads.
    is_forked = "forkserver" in multiprocessing.get_all_start_methods()
    context = multiprocessing.get_context("forkserver" if is_forked else "spawn")
    context.set_forkserver_preload([__name__])
    # Ctrl-C, which a terminal sends to all processes, ends each without a word.
    pool = ProcessPoolExecutor(count, context, signal.signal, (signal.SIGINT, signal.SIG_DFL))
    try:
        futures = [pool.submit(_analyze, run, settings) for run in runs]
        for _ in as_completed(futures):
            report()
    finally:
        pool.shutdown(cancel_futures=True)
    outcomes: list[Analysis | RigError] = []
    for run, future in zip(runs, futures, strict=True):
        try:
            outcomes.append(future.result())
        except BrokenProcessPool:
            outcomes.append(
                RigError(
                    f"{run.path} was left out when the system ended a process, perhaps for want of"
                    " memory: analyze it again, with --workers 1"
                )
            )
    return outcomes


@contextlib.contextmanager
def connect_to_workers(address: str, timeout: float = CONNECT_TIMEOUT) -> "Iterator[Client]":
    """Use a cluster that is already there.

    Raises
    ------
    RigError
        If nothing answers there, or its workers have another version of this software.
    """
    from distributed import Client

    try:
        client = Client(address, timeout=timeout, set_as_default=False)
    except (OSError, ValueError) as error:
        raise RigError(
            f"no Dask scheduler answers at {address!r}: {error}; give the address that it"
            f" prints when it starts, like tcp://{LOOPBACK}:8786"
        ) from None
    with client:
        # As text: a worker cannot be sent a function which it cannot import.
        asked = "__import__('impact_rig').__version__"
        for worker, version in client.run(eval, asked, on_error="return").items():
            if version != __version__:
                raise RigError(
                    f"the Dask worker {worker} has not impact_rig {__version__} but {version!r}:"
                    " install the same version on every worker"
                )
        yield client


def run_on_workers(
    client: "Client", runs: Sequence[Run], settings: Settings, report: Report
) -> list[Analysis | RigError]:
    """Analyze runs on workers; return what came of them, in their order."""
    from distributed import as_completed as as_they_come

    futures = {client.submit(_analyze, run, settings, pure=False): run for run in runs}
    found: dict[Run, Analysis | RigError] = {}
    for future in as_they_come(futures, loop=client.loop):
        run = futures[future]
        try:
            found[run] = future.result()
        except Exception as error:  # noqa: BLE001 - of Dask, for example of a worker that was killed
            found[run] = RigError(f"{run.path}: {type(error).__name__}: {error}")
        report()
    return [found[run] for run in runs]


def _analyze(run: Run, settings: Settings) -> Analysis | RigError:
    """Analyze one run; return its error if it cannot be analyzed."""
    try:
        with compute_alone():  # a worker of a cluster may have several threads
            return analyze(run, settings)
    except RigError as error:
        return error
    except MemoryError:
        return RigError(f"{run.path} needs more memory than there is")
