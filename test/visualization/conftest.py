"""Reading back what was logged, with Rerun's own reader."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from impact_rig.core.signals.record import FloatArray


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

        self._reader = rerun.chunk.RrdReader(str(path))
        self.chunks = self._reader.stream().to_chunks()

    @property
    def entities(self) -> set[str]:
        return {chunk.entity_path for chunk in self.chunks}

    def find_static(self, entity: str, component: str) -> Any:
        """Return what a static component says last: its list of values."""
        found = [
            (row["rerun.controls.RowId"], row[component])
            for chunk in self.chunks
            if chunk.entity_path == entity and chunk.is_static
            for row in list_rows(chunk)
            if row.get(component) is not None
        ]
        assert found, f"{entity} has no {component}"
        return max(found)[1]

    def find_traces(self, entity: str) -> tuple[FloatArray, FloatArray]:
        """Return time [s], shape (n,), and scalars, shape (n, columns), of an entity."""
        batches = [
            chunk.to_record_batch()
            for chunk in self.chunks
            if chunk.entity_path == entity and not chunk.is_static
        ]
        times = np.concatenate(
            [np.asarray(b.column("hit_time").cast("int64").to_numpy()) for b in batches]
        )
        rows = [row for b in batches for row in b.column("Scalars:scalars").to_pylist()]
        return times / 1e9, np.array(rows, dtype=float)

    def read_log(self) -> list[dict[str, Any]]:
        """Return the lines of the log."""
        return [
            row for chunk in self.chunks if chunk.entity_path == "/log" for row in list_rows(chunk)
        ]

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
