"""Many recordings side by side."""

from impact_rig.analysis import batch


def test_a_process_analyzes_one_recording_at_a_time(monkeypatch):
    """A worker of a cluster may have several threads, in which GTC is not safe."""
    is_alone = []

    def look(*_):
        is_alone.append(batch._ANALYZING.locked())

    monkeypatch.setattr(batch, "analyze", look)
    batch._analyze(None, {})
    assert is_alone == [True]
    assert not batch._ANALYZING.locked()
