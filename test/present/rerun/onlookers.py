"""What tests of the live view show, and what they see of viewers and their sockets."""

import contextlib
import threading
import time
from dataclasses import replace

import numpy as np
import psutil

from impact_rig.core.given.records import HitLabel
from impact_rig.results.traces import HitTraces

PATIENCE = 20.0
NOISE = HitTraces(
    HitLabel("steel small"),
    np.arange(5000) / 2.5e6,
    np.random.default_rng(1).standard_normal((5000, 2)).astype(np.float32),
)


def fail(text):
    raise AssertionError(text)


def show_noise(view, record=1):
    view.log.log_hit(replace(NOISE, label=HitLabel("steel small", record)))


def wait_until(condition):
    deadline = time.monotonic() + PATIENCE
    pause = threading.Event()
    while not condition():
        assert time.monotonic() < deadline, "it never came true"
        pause.wait(0.01)


def has_hit(read_recording, path):
    """Return whether the first hit has come to a file that is being written."""
    with contextlib.suppress(OSError, RuntimeError, ValueError):
        return "/hits/1" in read_recording(path).entities
    return False


def list_listeners(pid):
    """Return the sockets that a process and those below it listen on."""
    process = psutil.Process(pid)
    return [
        item
        for each in (process, *process.children(recursive=True))
        for item in each.net_connections("inet")
        if item.status == psutil.CONN_LISTEN
    ]
