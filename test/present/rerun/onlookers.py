"""What tests of destinations show, and what they see of viewers and their sockets."""

import contextlib
import socket
import threading
import time
from dataclasses import replace

import numpy as np
import psutil

from impact_rig.core.signals.record import HitLabel
from impact_rig.results.hit_traces import HitTraces

PATIENCE = 20.0
NOISE = HitTraces(
    HitLabel("steel small"),
    np.arange(5000) / 2.5e6,
    np.random.default_rng(1).standard_normal((5000, 2)).astype(np.float32),
)


def fail(text):
    raise AssertionError(text)


def show_noise(destination, record=1):
    hit = replace(NOISE, label=HitLabel("steel small", record))
    destination.put(lambda log: log.log_hit(hit), hit.values.nbytes)


def find_free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_until(condition):
    deadline = time.monotonic() + PATIENCE
    pause = threading.Event()
    while not condition():
        assert time.monotonic() < deadline, "it never came true"
        pause.wait(0.01)


class Notices:
    """Keeps what it is told, and waits for it."""

    def __init__(self):
        self.texts = []

    def __call__(self, text):
        self.texts.append(text)

    def wait_for(self, part):
        wait_until(lambda: any(part in text for text in self.texts))


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
