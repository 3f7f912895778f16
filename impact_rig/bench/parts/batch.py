"""Many recordings on two Dask workers, beside one."""

import os
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from impact_rig.analysis.batch_task import BatchTask
from impact_rig.analysis.settings_changes import SettingsChanges
from impact_rig.bench.figures import Figure, at_least
from impact_rig.bench.part import Bench, Part
from impact_rig.bench.recordings import compress_anew
from impact_rig.core.errors import RigError

VERDICTS = 15
"""In each recording [-], our choice."""
RECORDINGS = 8
"""In one batch [-]: four for each of two workers."""
REPEATS = 3
"""Batches on each cluster [-], our choice: one takes up to ten seconds."""
SMALLEST_GAIN = 1.7
"""Speed of two workers over that of one [-], as asked for."""
WORKERS = (1, 2)


def measure(bench: Bench) -> tuple[Figure, ...]:
    """Time the same batch on one and on two workers that have been at work before."""
    from impact_rig.analysis.dask_workers import start_workers

    if len(os.sched_getaffinity(0)) < WORKERS[-1]:
        raise RigError("two workers are measured on two cores, and there is only one")
    whole = bench.campaigns.take(1)[0].recording
    path = compress_anew(whole, bench.folder / "part.mcap", "zstd", VERDICTS)
    times: dict[int, list[float]] = {count: [] for count in WORKERS}
    starts: dict[int, float] = {}
    with ExitStack() as stack:
        clients = {}
        for count in WORKERS:
            started = time.perf_counter()
            clients[count] = stack.enter_context(start_workers(count))
            # Each worker imports what it needs with its first recordings.
            _analyze(clients[count], path, 2 * count)
            starts[count] = time.perf_counter() - started
        for turn in range(REPEATS):
            bench.report(turn, REPEATS)
            # By turns, so that other work on the machine meets both.
            for count, client in clients.items():
                started = time.perf_counter()
                _analyze(client, path, RECORDINGS)
                times[count].append(time.perf_counter() - started)
    one, two = (times[count] for count in WORKERS)
    return (
        Figure(
            "speed of two workers over one",
            tuple(slow / fast for slow, fast in zip(one, two, strict=True)),
            goal=at_least(SMALLEST_GAIN),
            note=f"{RECORDINGS} recordings of {VERDICTS} hits, workers warm",
        ),
        Figure("one recording on one worker", tuple(item / RECORDINGS for item in one), "s"),
        Figure(
            "start of two workers",
            (starts[WORKERS[-1]],),
            "s",
            note="with their first recordings",
        ),
    )


def _analyze(client: Any, path: Path, count: int) -> None:
    from impact_rig.analysis.dask_workers import run_on_workers

    tasks = [BatchTask(path, SettingsChanges()) for _ in range(count)]
    for outcome in run_on_workers(client, tasks, lambda _: None):
        if outcome.recording is None:
            raise RigError(outcome.error)


PART = Part("batch", "Many recordings on two Dask workers, beside one", measure, 15.0)
