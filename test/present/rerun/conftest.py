"""Rerun's own reader reads back what was logged; destinations and viewers end after each test."""

import operator
import subprocess
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from impact_rig.core.given.records import FloatArray
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.present.rerun.delivery import LiveView
from impact_rig.present.rerun.entities import APPLICATION
from impact_rig.present.rerun.view_log import ViewLog
from impact_rig.present.rerun.viewers import find_viewer
from impact_rig.results.traces import TracedCampaign

from ..conftest import Trace
from .onlookers import fail, list_listeners, wait_until

Rows = defaultdict[str, list[dict[str, Any]]]
"""Rows by entity."""


def list_rows(chunk: Any) -> list[dict[str, Any]]:
    """Return a chunk row by row, times in nanoseconds."""
    batch = chunk.to_record_batch()
    columns = {}
    for name, column in zip(batch.schema.names, batch.columns, strict=True):
        is_time = str(column.type).startswith(("timestamp", "duration"))
        columns[name] = (column.cast("int64") if is_time else column).to_pylist()
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


class Recording:
    """An .rrd file, read as the viewer reads it."""

    def __init__(self, path: Path) -> None:
        import rerun

        self.size = path.stat().st_size
        self._reader = rerun.chunk.RrdReader(str(path))
        self._static: Rows = defaultdict(list)
        self._timed: Rows = defaultdict(list)
        for chunk in self._reader.stream().to_chunks():
            rows = self._static if chunk.is_static else self._timed
            rows[chunk.entity_path] += list_rows(chunk)

    @property
    def entities(self) -> set[str]:
        return {*self._static, *self._timed}

    def find_static(self, entity: str, component: str) -> Any:
        """Return what a static component says last: its list of values."""
        rows = [row for row in self._static.get(entity, []) if row.get(component) is not None]
        assert rows, f"{entity} has no {component}"
        return max(rows, key=operator.itemgetter("rerun.controls.RowId"))[component]

    def find_traces(self, entity: str) -> tuple[FloatArray, FloatArray]:
        """Return time [s], shape (n,), and scalars, shape (n, columns), of an entity."""
        rows = self._timed.get(entity, [])
        values = np.array([row["Scalars:scalars"] for row in rows], dtype=float)
        return np.array([row["hit_time"] for row in rows]) / 1e9, values

    def read_rows(self, entity: str) -> list[dict[str, Any]]:
        """Return what an entity has over time, row by row."""
        return self._timed.get(entity, [])

    def find_plots(self, component: str = "") -> set[str]:
        """Return the entities that are drawn over time, or those of them with a component."""
        return {
            entity
            for entity, rows in self._static.items()
            if any(name.startswith("Series") and component in name for row in rows for name in row)
        }

    def find_hidden(self) -> set[str]:
        """Return the entities of which every line or point is hidden."""
        set_by_hand, points = self.find_plots("visible_series"), self.find_plots("markers")
        kinds = {item: "Points" if item in points else "Lines" for item in set_by_hand}
        return {
            item
            for item, kind in kinds.items()
            if not any(self.find_static(item, f"Series{kind}:visible_series"))
        }

    def read_blueprint(self) -> list[dict[str, Any]]:
        """Return every row of the blueprint that the viewer takes."""
        (entry,) = self._reader.blueprints()
        return [
            row
            for chunk in self._reader.stream(store=entry).to_chunks()
            for row in list_rows(chunk)
        ]


@pytest.fixture
def read_recording() -> type[Recording]:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    return Recording


@pytest.fixture
def record(
    tmp_path: Path, write_view: Callable[..., None], read_recording: type[Recording]
) -> Callable[..., Recording]:
    """Return a function that logs things into a file and reads it back."""

    def run(*works: Callable[[ViewLog], None]) -> Recording:
        path = tmp_path / "view.rrd"
        write_view(path, *works)
        return read_recording(path)

    return run


def _write_view(path: Path, *works: Callable[[ViewLog], None]) -> None:
    """Log things into a file."""
    import rerun

    stream = rerun.RecordingStream(APPLICATION)
    stream.set_sinks(rerun.FileSink(str(path)))
    log = ViewLog(stream)
    for work in works:
        work(log)
    stream.flush()
    stream.disconnect()


@pytest.fixture(scope="session")
def write_view() -> Callable[..., None]:
    """Return the function that logs things into a file: a path, then what to do with the log."""
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    return _write_view


@pytest.fixture(scope="session")
def campaign(trace: Trace) -> TracedCampaign:
    """Return the paper's campaign, two hits a sample, with its traces."""
    return trace((name, impact) for name in PAPER_SETUP.samples.names for impact in (1, 2))


@pytest.fixture
def open_view():
    """Return a function that opens a live view, which is closed at the end."""
    opened = []

    def run(*, announce=fail, notify=fail, **plan):
        opened.append(LiveView(**plan, announce=announce, notify=notify))
        return opened[-1]

    yield run
    for view in opened:
        view.close()
    # A server goes after its stream: none is to be found by the next test.
    own = psutil.Process()
    wait_until(lambda: all(item.status != psutil.CONN_LISTEN for item in own.net_connections()))


@pytest.fixture
def start():
    """Return a function that starts Rerun's program and returns once a port of it is open."""
    processes = []

    def run(port, *arguments):
        process = subprocess.Popen(
            [find_viewer(), "--bind", "127.0.0.1", "--port", str(port), *map(str, arguments)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        processes.append(process)

        def is_open():
            assert process.poll() is None
            return any(item.laddr.port == port for item in list_listeners(process.pid))

        wait_until(is_open)
        return process

    yield run
    for process in processes:
        process.kill()
        process.wait()


@pytest.fixture
def viewer(start):
    """Return a function that starts what a viewer has of a network, without its windows."""
    return lambda port: start(port, "--serve-grpc")
