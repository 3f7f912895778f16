"""Viewers as processes: those that outlive us, and those that end with us."""

import os
import subprocess
import sys

import psutil
import pytest

from impact_rig.core.errors import RigError
from impact_rig.present.rerun import viewer_program as program

from .onlookers import PATIENCE, wait_until

SLEEP = "import time; time.sleep(600)"
HOST = """
import sys
from pathlib import Path
from impact_rig.present.rerun import viewer_program as program
program.find_viewer = lambda: Path(sys.executable)
process = program.{start}(["-c", {code!r}])
print(process.pid, flush=True)
sys.stdin.read()
"""


@pytest.fixture
def start_host():
    """Return a function that has another process start a viewer; return both."""
    pairs = []

    def run(start):
        host = subprocess.Popen(
            [sys.executable, "-c", HOST.format(start=start, code=SLEEP)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        launcher = psutil.Process(int(host.stdout.readline()))
        wait_until(launcher.children)
        pairs.append((host, launcher, *launcher.children()))
        return pairs[-1]

    yield run
    for host, *others in pairs:
        for process in others:
            if process.is_running():
                process.kill()
        host.kill()
        host.communicate()


def test_a_server_ends_with_its_host_however_that_ends_and_a_viewer_outlives_it(start_host):
    host, launcher, server = start_host("start_server")
    other, _, viewer = start_host("start_viewer")
    for process in (host, other):
        process.kill()
        process.wait()
    gone, _ = psutil.wait_procs([launcher, server], PATIENCE)

    assert len(gone) == 2
    assert viewer.is_running()
    assert os.getsid(viewer.pid) != os.getsid(0)


def test_what_a_viewer_leaves_is_removed_when_it_has_ended(tmp_path, monkeypatch):
    waste = tmp_path / "waste"
    waste.mkdir()
    (waste / "view.rrd").write_bytes(b"RRF")
    monkeypatch.setattr(program, "find_viewer", lambda: sys.executable)
    process = program.start_viewer(["-c", "import sys; sys.exit(3)"], waste=waste)

    assert process.wait(PATIENCE) == 3
    assert not waste.exists()


def test_a_viewer_that_is_not_installed_is_named(monkeypatch):
    monkeypatch.setattr(program.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(RigError, match="pip install rerun-sdk"):
        program.find_viewer()
