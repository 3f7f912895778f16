"""`impact-rig doctor` on this very installation."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

MODULE = (sys.executable, "-m", "impact_rig.cli.main", "doctor")


def call(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*MODULE, *words],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env={**os.environ, **environment},
    )


@pytest.fixture(scope="module")
def report() -> subprocess.CompletedProcess[str]:
    """Return what it says here."""
    return call("--json")


def test_this_installation_is_healthy(report: subprocess.CompletedProcess[str]) -> None:
    content = json.loads(report.stdout)
    faults = [item for item in content["findings"] if item["status"] == "fault"]
    assert faults == []
    assert content["healthy"]
    assert report.returncode == 0


def test_two_processes_really_talk(report: subprocess.CompletedProcess[str]) -> None:
    found = {item["name"]: item for item in json.loads(report.stdout)["findings"]}
    assert found["two processes"]["text"].startswith("hear each other")
    assert found["middleware"]["text"].startswith("rmw_")


def test_a_middleware_that_is_not_there_is_found_before_a_node_is_started() -> None:
    done = call(RMW_IMPLEMENTATION="rmw_of_nobody")
    assert done.returncode == 1
    assert "Traceback" not in done.stdout + done.stderr
    text = " ".join(done.stdout.split())
    assert "rmw_of_nobody" in text
    assert "RMW_IMPLEMENTATION must name an installed one" in text


def test_without_ros_it_says_so_and_still_reports_the_rest(tmp_path: Path) -> None:
    # Only this package and the libraries of the command line: no ROS on the path.
    (tmp_path / "rclpy.py").write_text("raise ModuleNotFoundError(name='rclpy')")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    done = call(PYTHONPATH=path)
    assert done.returncode == 1
    assert "Traceback" not in done.stdout + done.stderr
    for name in ("numpy", "disk", "shared memory"):
        assert name in done.stdout
