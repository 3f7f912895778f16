"""The part `view`: both sides log the same traces, and commands are timed to their file."""

import numpy as np
import pytest

from bench import view
from impact_rig.analysis.recording_analysis import analyze_recording

HITS, CHANNELS = 3, 2
"""Of the recording."""


def test_the_view_is_compared_with_bare_calls_and_commands_are_timed(bench, monkeypatch):
    called: list[tuple[str, str]] = []

    def run(name, recording, output):
        assert recording.exists()
        called.append((name, output.suffix))
        return 1.5

    monkeypatch.setattr(view, "time_command", run)
    logged, ratio, size, command, report = view.measure_view(bench)
    assert called == [("view", ".rrd")] * view.VIEWS + [("report", ".html")]
    assert logged.name == f"{HITS} hits logged into a file"
    assert logged.note.startswith(f"{2 * CHANNELS * HITS} traces of up to 5000 points")
    goals = [str(figure.goal) for figure in (logged, size, command)]
    assert goals == ["at most 0.3", "at most 15", "at most 2"]
    assert ratio.goal is report.goal is None
    assert 0.01 < size.median < 15.0


def test_bare_calls_write_the_traces_of_every_hit(recording, tmp_path):
    rerun = pytest.importorskip("rerun")
    traced = analyze_recording(recording, keep_traces=True, with_models=False).campaigns
    traces = view.gather_traces(traced)
    view.write_bare(tmp_path / "bare.rrd", traces)
    found: dict[str, list[float]] = {}
    for chunk in rerun.chunk.RrdReader(str(tmp_path / "bare.rrd")).stream().to_chunks():
        batch = chunk.to_record_batch()
        if "Scalars:scalars" in batch.schema.names:
            rows = batch.column("Scalars:scalars").to_pylist()
            found.setdefault(chunk.entity_path, []).extend(row[0] for row in rows)
    assert set(found) == {f"/{entity}" for entity, *_ in traces}
    for entity, moments, values in traces:
        assert moments.shape == values.shape
        assert found[f"/{entity}"] == pytest.approx(values)
    recorded = traced[0].hits[0].recorded.values
    np.testing.assert_array_equal(traces[0][2], recorded[:, 0])
