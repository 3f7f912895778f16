"""Many recordings, analyzed side by side by Dask: each gives the numbers that it gives alone."""

import contextlib
import logging
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING

from impact_rig import __version__
from impact_rig.analysis.analyze import Analysis, Settings, analyze
from impact_rig.core.errors import RigError
from impact_rig.recordings.run import Run

if TYPE_CHECKING:
    from distributed import Client

WORTH_WORKERS = 1_000_000
"""Size of all recordings together [byte] from which more processes are worth the second that they
take to start, measured: a core analyzes this much in 0.3 s to 3 s."""
LOOPBACK = "127.0.0.1"
"""Workers of this host are for this host."""
CONNECT_TIMEOUT = 5.0
"""How long a cluster may take to answer [s], our choice: one that is there answers at once."""
_ANALYZING = threading.Lock()
"""One recording at a time in a process: GTC is not safe in threads, and a worker of a
cluster may have several."""

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
        Processes; None: as many as cores, or none but this one for a small batch or without Dask.
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
    size = sum(run.size for run in runs)
    is_worth = size >= WORTH_WORKERS and find_spec("distributed") is not None
    cores = len(os.sched_getaffinity(0)) if is_worth else 1
    count = min(workers or cores, len(runs))
    if scheduler is None and count == 1:
        outcomes = []
        for run in runs:
            outcomes.append(_analyze(run, settings))
            report()
        return outcomes
    with connect_to_workers(scheduler) if scheduler else start_workers(count) as client:
        return run_on_workers(client, runs, settings, report)


@contextlib.contextmanager
def start_workers(count: int) -> "Iterator[Client]":
    """Start processes of one thread each on this host; stop them at the end of the block."""
    from distributed import Client, LocalCluster

    with _keep_interrupts():
        cluster = LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            memory_limit=0,
            host=LOOPBACK,
            dashboard_address=None,
            silence_logs=logging.CRITICAL,
        )
    with cluster, Client(cluster, set_as_default=False) as client:
        yield client


@contextlib.contextmanager
def _keep_interrupts() -> Iterator[None]:
    """Let the threads and processes that start in the block leave Ctrl-C to this thread."""
    resource_tracker.ensure_running()  # it would lift the mask when it is started
    previous = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, previous)


@contextlib.contextmanager
def connect_to_workers(address: str) -> "Iterator[Client]":
    """Use a cluster that is already there.

    Raises
    ------
    RigError
        If nothing answers there, or its workers have another version of this software.
    """
    from distributed import Client

    try:
        client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
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
    from distributed import as_completed

    futures = {client.submit(_analyze, run, settings, pure=False): run for run in runs}
    found: dict[Run, Analysis | RigError] = {}
    for future in as_completed(futures, loop=client.loop):
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
        with _ANALYZING:
            return analyze(run, settings)
    except RigError as error:
        return error
    except MemoryError:
        return RigError(f"{run.path} needs more memory than there is")
