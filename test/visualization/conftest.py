"""Reading back what was logged, with Rerun's own reader."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from impact_rig.core.session import Session
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import FloatArray, HitLabel
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.results.flat_estimates import hit_results_from_judged, results_from_session
from impact_rig.results.hit_traces import TraceAssembler
from impact_rig.results.sample_traces import align_hit, sample_traces_from_estimate
from impact_rig.results.traced_campaign import TracedCampaign, TracedHit
from impact_rig.visualization.entities import APPLICATION
from impact_rig.visualization.log import ViewLog

STAMP = 1_700_000_000_123_456_789
"""Start of the campaign [ns since the epoch]."""


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

    def read_rows(self, entity: str) -> list[dict[str, Any]]:
        """Return what an entity has over time, row by row."""
        return [
            row
            for chunk in self.chunks
            if chunk.entity_path == entity and not chunk.is_static
            for row in list_rows(chunk)
        ]

    def find_drawn(self) -> set[str]:
        """Return the entities that have something over time."""
        return {chunk.entity_path for chunk in self.chunks if not chunk.is_static}

    def is_plot(self, entity: str) -> bool:
        """Whether an entity is drawn over time."""
        return any(
            chunk.entity_path == entity
            and any(name.startswith("Series") for name in chunk.to_record_batch().schema.names)
            for chunk in self.chunks
        )

    def find_hidden(self) -> set[str]:
        """Return the entities of which every line or point is hidden."""
        hidden = {
            chunk.entity_path
            for chunk in self.chunks
            if any("visible_series" in name for name in chunk.to_record_batch().schema.names)
        }
        for entity in hidden:
            kind = "Points" if self._has(entity, "SeriesPoints:markers") else "Lines"
            assert not any(self.find_static(entity, f"Series{kind}:visible_series")), entity
        return hidden

    def _has(self, entity: str, component: str) -> bool:
        return any(
            chunk.entity_path == entity and component in chunk.to_record_batch().schema.names
            for chunk in self.chunks
        )

    def quote(self, *parts: str) -> str:
        """Return an entity path as the reader writes it."""
        import rerun

        return str(rerun.new_entity_path(list(parts)))

    def count_blueprints(self) -> int:
        """Return how many layouts were sent."""
        return len(self._reader.blueprints())

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


def trace_campaign(setup: RigSetup, names: Iterable[str], impacts: int) -> TracedCampaign:
    """Strike samples and keep everything there is to see."""
    rig, session, assembler = (
        VirtualRig(setup, VirtualRigSettings(seed=1)),
        Session(setup),
        TraceAssembler(),
    )
    recorded, aligned, record = [], {}, 0
    for name in names:
        for impact in range(1, impacts + 1):
            record += 1
            for block in rig.strike(HitLabel(name, record, impact)).split(5000, STAMP):
                aligned |= {hit.label: align_hit(hit) for hit in session.feed(block)}
                recorded += [hit for hit in [assembler.feed(block)] if hit is not None]
    found = session.estimate_all_without_models()
    judged = {hit.label: hit for hit in (*found.accepted, *found.rejected)}
    samples = [
        sample_traces_from_estimate(estimate, session.find_mean(estimate.name))
        for estimate in found.samples
    ]
    return TracedCampaign(
        results=results_from_session(found, {}),
        samples=tuple(samples),
        hits=tuple(
            TracedHit(
                hit_results_from_judged(judged[hit.label], ()),
                judged[hit.label].stamp,
                hit,
                aligned[hit.label],
            )
            for hit in recorded
        ),
    )


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
def campaign() -> TracedCampaign:
    """Return the paper's campaign, ten hits a sample, with its traces; no model is fitted."""
    return trace_campaign(PAPER_SETUP, PAPER_SETUP.samples.names, impacts=10)
