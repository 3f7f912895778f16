"""Many recordings side by side."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

from impact_rig.analysis import batch


def test_a_process_analyzes_one_recording_at_a_time(monkeypatch, tmp_path):
    """A worker of a cluster may have several threads, in which GTC is not safe."""
    running = threading.Semaphore(1)
    overlaps = []

    def read(path):
        overlaps.append(not running.acquire(blocking=False))
        time.sleep(0.01)
        return path

    def analyze(path, settings):
        running.release()
        return path, settings

    monkeypatch.setattr(batch, "read_recording", read)
    monkeypatch.setattr(batch, "analyze", analyze)
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda _: batch._analyze(tmp_path, {}), range(8)))
    assert overlaps == [False] * 8
