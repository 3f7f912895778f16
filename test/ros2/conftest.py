"""Rigs started by `ros2 launch`, in a ROS domain of the test run's own."""

import os
import shutil
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from terminal import Terminal

from impact_rig.nodes.discovery import reserve_domain

from .tools import MARK, Tools, list_marked

PATIENCE = 30.0
"""How long what has been stopped may take to end [s], our choice."""

NODES = {f"/bench/{n}" for n in ("accelerometer", "campaign", "estimator", "hammer", "recorder")}
SWING = "/**/hammer: {ros__parameters: {swing_time: 0.2}}\n"
"""Parameter file: a fast hammer; faster ones outrun `ros2 bag record` on a busy machine, as its
queue of ten messages holds two hits."""


collect_ignore = ["outside"]
"""Packages of other people, whose tests colcon runs."""


@dataclass(frozen=True)
class LaunchedRig:
    """A rig that `ros2 launch` has started.

    Attributes
    ----------
    terminal : Terminal
        Of `ros2 launch`.
    folder : Path
        Of the run.
    """

    terminal: Terminal
    folder: Path


@pytest.fixture(scope="session", autouse=True)
def _real_tools() -> None:
    """Leave everything here out where there is no ROS 2 that has the rig."""
    if shutil.which("ros2") is None:
        pytest.skip("no ROS 2 Jazzy is sourced: test/README.md says how these tests are run")
    try:
        get_package_prefix("impact_rig")
        get_package_prefix("launch_ros")
    except (PackageNotFoundError, LookupError) as error:
        pytest.skip(f"ROS 2 is sourced without a package that these tests need: {error}")


@contextmanager
def open_tools(folder: Path) -> Iterator[Tools]:
    """Yield tools in a ROS domain of their own; at the end nothing that they started is left."""
    mark = uuid.uuid4().hex
    with reserve_domain() as domain:
        environment = {
            **os.environ,
            MARK: mark,
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "PYTHONUNBUFFERED": "1",
            "COLUMNS": "200",
        }
        tools = Tools(environment, folder)
        yield tools
        tools.run("ros2", "daemon", "stop")
        # The daemon answers that it stops, and ends a moment later.
        deadline = time.monotonic() + PATIENCE
        while list_marked(mark) and time.monotonic() < deadline:
            time.sleep(0.1)
        assert list_marked(mark) == []


@pytest.fixture(scope="session")
def tools(_real_tools: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tools]:
    """Return the tools in the domain that all tests of this process share."""
    with open_tools(tmp_path_factory.mktemp("tools")) as tools:
        yield tools


@pytest.fixture(scope="module")
def own_tools(_real_tools: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tools]:
    """Return tools in a domain of one file of tests."""
    with open_tools(tmp_path_factory.mktemp("outside")) as tools:
        yield tools


@pytest.fixture(scope="session")
def swing_file(tools: Tools) -> Path:
    """Return a parameter file that lets the hammer swing fast."""
    path = tools.folder / "swing.yaml"
    path.write_text(SWING)
    return path


@pytest.fixture(scope="session")
def rig(tools: Tools, swing_file: Path) -> Iterator[LaunchedRig]:
    """Return a rig in namespace `bench`, all of whose nodes are found with their services."""
    folder = tools.folder / "bench"
    with tools.launch(folder, swing_file, "namespace:=bench", "seed:=7") as terminal:
        terminal.wait_for("recording to ")
        # A node is listed a moment before its services, by which its life cycle is known.
        tools.run_until(lambda text: set(text.split()) >= NODES, "ros2", "lifecycle", "nodes")
        tools.run_until(lambda text: "/bench/campaign/run" in text, "ros2", "action", "list")
        yield LaunchedRig(terminal, folder)
        assert terminal.interrupt() == 0, terminal.text
        assert "Traceback" not in terminal.text
        # Launch says so of a process that failed.
        assert "exit code" not in terminal.text, terminal.text[-5000:]


@dataclass(frozen=True)
class Bags:
    """What two recorders have kept of one campaign.

    Attributes
    ----------
    ours, theirs : Path
        File of the rig's recorder, and folder of `ros2 bag record`.
    results : str
        What the campaign found, JSON.
    """

    ours: Path
    theirs: Path
    results: str


@pytest.fixture(scope="session")
def bags(_real_tools: None, swing_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Bags:
    """Return a campaign recorded by the rig and by `ros2 bag record -a`, in their own domain."""
    parent = tmp_path_factory.mktemp("bags")
    folder, theirs = parent / "recorded", parent / "theirs"
    with (
        open_tools(parent) as tools,
        tools.start("ros2", "bag", "record", "-a", "-s", "mcap", "-o", theirs) as recorder,
        tools.launch(folder, swing_file) as launch,
    ):
        launch.wait_for("recording to ")
        recorder.wait_for("Subscribed to topic '/acceleration'")
        recorder.wait_for("Subscribed to topic '/setup'")
        recorder.wait_for("Subscribed to topic '/impact'")
        tools.run(
            "impact-rig", "campaign", "--sample", "aluminium large", "--sample", "steel small",
            "--impacts", "3",
        )  # fmt: skip
        assert launch.interrupt() == 0, launch.text
        assert recorder.interrupt() == 0, recorder.text
    return Bags(folder / "session.mcap", theirs, (folder / "results.json").read_text("utf-8"))
