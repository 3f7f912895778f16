"""Many recordings side by side."""

import threading
from concurrent.futures import ThreadPoolExecutor

from impact_rig.analysis import batch


def test_a_process_analyzes_one_recording_at_a_time(monkeypatch):
    """A worker of a cluster may have several threads, in which GTC is not safe."""
    met, inside = threading.Event(), []

    def look(*_):
        inside.append(len(inside))
        if len(inside) > 1:
            met.set()
        met.wait(0.1)
        inside.pop()

    monkeypatch.setattr(batch, "analyze", look)
    with ThreadPoolExecutor(2) as threads:
        list(threads.map(lambda _: batch._analyze(None, {}), range(2)))
    assert not met.is_set()
