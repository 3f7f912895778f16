"""Workspaces of a test's own, in which nothing has been set up."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import workspace
from workspace import Workspace

ROOT = Path(__file__).resolve().parent.parent.parent
PATIENCE = 60.0
"""How long a command may take before the test fails [s]."""


@pytest.fixture
def copy(tmp_path):
    """Return a copy of all that the set-up looks at, on a machine without ROS 2."""
    for name in ("launch_scripts", "msg_config"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("setup.py", "package.xml"):
        shutil.copy(ROOT / name, tmp_path)
    return Workspace(tmp_path, is_ros_installed=False)


@pytest.fixture
def fresh(copy):
    """Return a copy in which every step claims to be done."""
    for step in copy.steps.values():
        step.stamp.parent.mkdir(parents=True, exist_ok=True)
        step.stamp.write_text(step.fingerprint)
    return copy


@pytest.fixture
def environment():
    """Return the environment of a terminal in which no ROS 2 is sourced."""
    return {name: value for name, value in os.environ.items() if name != "ROS_DISTRO"}


@pytest.fixture
def start_rig(copy, environment):
    """Return a function that starts the copy's rig.py."""
    if workspace.find_wheel_problem():
        pytest.skip("ROS 2 has no wheels for this machine")

    def start(*arguments, **variables):
        return subprocess.Popen(
            [sys.executable, str(copy.root / "launch_scripts" / "rig.py"), *arguments],
            env={**environment, **variables},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    return start


@pytest.fixture
def run_rig(start_rig):
    """Return a function that runs the copy's rig.py to its end."""

    def run(*arguments, **variables):
        process = start_rig(*arguments, **variables)
        output, errors = process.communicate(timeout=PATIENCE)
        return SimpleNamespace(code=process.returncode, output=output, errors=errors)

    return run
