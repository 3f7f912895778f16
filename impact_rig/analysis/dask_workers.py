"""Processes that analyze recordings side by side, through Dask: on this host or on a cluster."""

import contextlib
import logging
import os
import signal
import tempfile
from collections.abc import Callable, Iterator, Sequence
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

import dask
import distributed
from distributed import Client, LocalCluster, as_completed
from distributed.comm.addressing import get_address_host_port
from distributed.scheduler import KilledWorker

from impact_rig import __version__
from impact_rig.analysis.batch import BatchOutcome, BatchTask
from impact_rig.core.errors import RigError

LOOPBACK = "127.0.0.1"
"""Workers of this host are for this host."""
CONNECT_TIMEOUT = 5.0
"""How long a cluster may take to answer [s], our choice: one that is there answers at once."""
READ_VERSION = "__import__('impact_rig').__version__"
"""What a worker is asked first."""
ONE_TASK_EACH = {
    # A worker that dies takes no waiting recording with it, only the one that it was at.
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.scheduler.allowed-failures": 0,
    # Results are small: nothing needs to be spilled, and a worker that pauses waits for ever.
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
}
"""Settings of workers on this host."""


@contextlib.contextmanager
def start_workers(count: int) -> Iterator[Client]:
    """Start processes with one thread each on this host; stop them at the end of the block.

    Parameters
    ----------
    count : int
        Processes.

    Yields
    ------
    Client
        For `run_on_workers`.
    """
    _silence_dask()
    with contextlib.ExitStack() as stack:
        stack.enter_context(dask.config.set(ONE_TASK_EACH))
        folder = stack.enter_context(
            tempfile.TemporaryDirectory(prefix="impact_rig_", ignore_cleanup_errors=True)
        )
        with _keep_interrupts():
            cluster = stack.enter_context(
                LocalCluster(
                    n_workers=count,
                    threads_per_worker=1,
                    processes=True,
                    host=LOOPBACK,
                    dashboard_address=None,
                    scheduler_kwargs={"dashboard_address": f"{LOOPBACK}:0"},
                    local_directory=folder,
                    silence_logs=logging.CRITICAL,
                )
            )
        client = stack.enter_context(Client(cluster, set_as_default=False))
        try:
            yield client
        except BaseException:
            # Nobody waits for what they were at.
            for process in [nanny.pid for nanny in cluster.workers.values() if nanny.pid]:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
            raise


def _silence_dask() -> None:
    """Let Dask print nothing here any more: what goes wrong is told in our words.

    For good, since its threads still have something to say when everything is closed.
    """
    for handler in logging.getLogger(distributed.__name__).handlers:
        handler.setLevel(logging.CRITICAL)


@contextlib.contextmanager
def _keep_interrupts() -> Iterator[None]:
    """Let the threads and processes that start in the block leave Ctrl-C to this thread.

    They inherit the mask, and so do processes that replace others later.
    """
    resource_tracker.ensure_running()  # it would lift the mask when it is started
    previous = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, previous)


@contextlib.contextmanager
def connect_to_workers(address: str) -> Iterator[Client]:
    """Use a cluster that is already there.

    Parameters
    ----------
    address : str
        Of its scheduler, as Dask prints it.

    Yields
    ------
    Client
        For `run_on_workers`.

    Raises
    ------
    RigError
        If nobody answers there, or its workers cannot analyze recordings.
    """
    _silence_dask()
    try:
        get_address_host_port(address)
        client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise RigError(
            f"no Dask scheduler answers at {address!r}: {error}; give the address that it"
            f" prints when it starts, like tcp://{LOOPBACK}:8786"
        ) from None
    with client:
        _check_workers(client, address)
        yield client


def run_on_workers(
    client: Client, tasks: Sequence[BatchTask], report: Callable[[Path], None]
) -> list[BatchOutcome]:
    """Run tasks on workers; one that dies costs no other recording.

    Parameters
    ----------
    report : callable
        Called with each recording as it is finished.

    Returns
    -------
    list of BatchOutcome
        In the order of `tasks`.

    Raises
    ------
    RigError
        If the scheduler goes away.
    """
    outcomes = _run_together(client, tasks)
    found: dict[BatchTask, BatchOutcome] = {}
    lost: list[BatchTask] = []
    for task, outcome in outcomes:
        if outcome is None:
            lost.append(task)
            continue
        found[task] = outcome
        report(task.path)
    # Perhaps the memory was short for several at once, or another recording killed the worker.
    for task in lost:
        ((_, outcome),) = _run_together(client, [task])
        found[task] = outcome or BatchOutcome(
            task.path,
            None,
            f"{task.path} killed the process that analyzed it, perhaps for want of memory",
        )
        report(task.path)
    return [found[task] for task in tasks]


def _run_together(
    client: Client, tasks: Sequence[BatchTask]
) -> Iterator[tuple[BatchTask, BatchOutcome | None]]:
    """Yield tasks as they are finished, with None in place of what killed its worker."""
    # Names of their own: the outcome of an earlier run is not taken for that of this one.
    futures = {client.submit(type(task).run, task, pure=False): task for task in tasks}
    for future in as_completed(futures, loop=client.loop):
        task = futures[future]
        if future.cancelled():
            raise RigError("the Dask scheduler has gone: what was not finished is lost")
        error = future.exception()
        if error is None:
            yield task, future.result()
        elif isinstance(error, KilledWorker):
            yield task, None
        else:
            reason = f"{type(error).__name__}: {error}"
            yield task, BatchOutcome(task.path, None, f"{task.path}: {reason}")


def _check_workers(client: Client, address: str) -> None:
    """Refuse a cluster without workers, or one whose workers would give other numbers."""
    try:
        client.wait_for_workers(1, timeout=CONNECT_TIMEOUT)
    except TimeoutError:
        raise RigError(
            f"the Dask scheduler at {address} has no workers: start some with `dask worker"
            f" {address}`"
        ) from None
    # As text: a worker that is sent a function which it cannot import falls silent.
    versions: dict[str, Any] = client.run(eval, READ_VERSION, on_error="return")
    for worker, version in versions.items():
        if version != __version__:
            raise RigError(
                f"the Dask worker {worker} has not impact_rig {__version__} but {version!r}:"
                " install the same version on every worker"
            )
