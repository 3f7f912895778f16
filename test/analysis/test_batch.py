"""Many recordings side by side."""

from impact_rig.analysis import batch


def test_a_process_analyzes_one_recording_at_a_time(monkeypatch, tmp_path):
    """A worker of a cluster may have several threads, in which GTC is not safe."""
    is_alone = []

    def look(*_):
        is_alone.append(batch._ANALYZING.locked())

    monkeypatch.setattr(batch, "read_recording", look)
    monkeypatch.setattr(batch, "analyze", look)
    batch._analyze(tmp_path, {})
    assert is_alone == [True, True]
    assert not batch._ANALYZING.locked()
