"""Replay a recording, and estimate and show it again: ``ros2 launch impact_rig replay.launch.py``.

``ros2 launch impact_rig replay.launch.py --show-args`` lists the arguments.
"""

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_prefix
from launch import LaunchContext, LaunchDescription
from launch.action import Action
from launch.actions import (
    DeclareLaunchArgument,
    GroupAction,
    LogInfo,
    OpaqueFunction,
    SetEnvironmentVariable,
    Shutdown,
)
from launch.substitutions import EnvironmentVariable, LaunchConfiguration
from launch_ros.actions import Node, PushRosNamespace

from impact_rig.configuration.processes import WINDOW, make_viewer_parameters
from impact_rig.core.errors import ParameterError

SWITCH = ["true", "false"]
ARGUMENTS = (
    DeclareLaunchArgument(
        "file",
        description="path of the recording: an .mcap file, a folder as rosbag2 writes it, or that"
        " of a run",
    ),
    DeclareLaunchArgument(
        "rate",
        default_value="1.0",
        description="speed, part of the original's; 0: as fast as the nodes take it",
    ),
    DeclareLaunchArgument(
        "start", default_value="0.0", description="from here, since the recording's start [s]"
    ),
    DeclareLaunchArgument(
        "end",
        default_value="0.0",
        description="up to here, since the recording's start [s]; 0: to its end",
    ),
    DeclareLaunchArgument(
        "loop", default_value="1", description="how often, a whole number; 0: without end"
    ),
    DeclareLaunchArgument(
        "samples", default_value="", description="only the hits of these, by commas; empty: all"
    ),
    DeclareLaunchArgument(
        "hits",
        default_value="",
        description="only these hits, beside `samples`, by commas: record number, SAMPLE/IMPACT or"
        " SAMPLE/IMPACT.ATTEMPT; empty: all",
    ),
    DeclareLaunchArgument(
        "start_paused",
        default_value="false",
        choices=SWITCH,
        description="wait for the services replayer/resume or replayer/step",
    ),
    DeclareLaunchArgument(
        "publish_clock",
        default_value="0.0",
        description="how often /clock is published [Hz], for nodes that use simulated time; 0: not"
        " at all",
    ),
    DeclareLaunchArgument(
        "estimator", default_value="true", choices=SWITCH, description="estimate everything anew"
    ),
    DeclareLaunchArgument(
        "visualizer",
        default_value="true",
        choices=SWITCH,
        description="show model and measurement in Rerun",
    ),
    DeclareLaunchArgument(
        "viewer",
        default_value="",
        description="where to show it, by commas: spawn (a window), web (a web page, the log says"
        " where), the address of a Rerun viewer that runs, rerun+http://HOST:9876/proxy; empty:"
        " spawn, unless `view` names a file",
    ),
    DeclareLaunchArgument(
        "view", default_value="", description="write the view into this .rrd file"
    ),
    DeclareLaunchArgument(
        "exit_when_done",
        default_value="false",
        choices=SWITCH,
        description="end all nodes at the end of the recording",
    ),
    DeclareLaunchArgument("namespace", default_value="", description="ROS namespace to replay in"),
    DeclareLaunchArgument(
        "params_file",
        default_value="",
        description="YAML file with ROS parameters of the nodes; the other arguments go before it",
    ),
)


def generate_launch_description() -> LaunchDescription:
    """Return the arguments, and the nodes they ask for."""
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=make_replay)])


def make_replay(context: LaunchContext) -> list[Action]:
    """Return the replayer and those that listen to it."""

    def read(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    actions: list[Action] = []
    listeners: dict[str, dict[str, Any]] = {}
    if read("estimator") == "true":
        listeners["estimator"] = {}
    if read("visualizer") == "true" and not is_rerun_installed():
        text = "rerun-sdk is not installed: the replay goes on without the view"
        actions.append(LogInfo(msg=f"warning: {text} (visualizer:=false says so beforehand)"))
    elif read("visualizer") == "true":
        listeners["visualizer"] = choose_destination(read("viewer"), read("view"))
    replayer = {
        "file": str(Path(read("file")).expanduser().resolve()),
        "rate": read_number("rate", read("rate"), float),
        "start": read_number("start", read("start"), float),
        "end": read_number("end", read("end"), float),
        "loop": read_number("loop", read("loop"), int),
        "samples": split_names(read("samples")),
        "hits": split_names(read("hits")),
        "start_paused": read("start_paused") == "true",
        "publish_clock": read_number("publish_clock", read("publish_clock"), float),
        # Without its own estimator, it replays the results of the recording.
        "topics": "inputs" if "estimator" in listeners else "all",
        "required_subscribers": ", ".join(listeners),
        "exit_when_done": read("exit_when_done") == "true",
    }
    actions += [
        make_node(name, parameters, read("params_file"))
        for name, parameters in {**listeners, "replayer": replayer}.items()
    ]
    if read("namespace"):
        actions = [GroupAction([PushRosNamespace(read("namespace")), *actions])]
    variable = "ROS_AUTOMATIC_DISCOVERY_RANGE"
    discovery = EnvironmentVariable(variable, default_value="LOCALHOST")
    return [SetEnvironmentVariable(variable, discovery), *actions]


def is_rerun_installed() -> bool:
    """Return whether the Python that runs the nodes, which may be another one, has rerun-sdk."""
    visualizer = Path(get_package_prefix("impact_rig"), "lib", "impact_rig", "visualizer")
    interpreter = visualizer.read_text("utf-8").splitlines()[0].removeprefix("#!").split()
    search = "import importlib.util, sys; sys.exit(importlib.util.find_spec('rerun') is None)"
    return subprocess.run([*interpreter, "-c", search], check=False).returncode == 0


def choose_destination(viewer: str, view: str) -> dict[str, Any]:
    """Return the visualizer's parameters: file and viewers, or a window if nothing is chosen."""
    viewers = [name for name in split_names(viewer) if name]
    file = {"output": str(Path(view).expanduser().resolve())} if view else {}
    return {**file, **make_viewer_parameters(viewers or ([] if view else [WINDOW]))}


def make_node(name: str, values: dict[str, Any], params_file: str) -> Action:
    """Return one node; all end when it does."""
    parameters: list[Any] = [params_file] if params_file else []
    if values:
        parameters.append(values)
    return Node(
        package="impact_rig",
        executable=name,
        name=name,
        parameters=parameters,
        output="both",
        emulate_tty=True,
        on_exit=Shutdown(reason=f"{name} ended"),
    )


def split_names(text: str) -> list[str]:
    """Return names that stand between commas; ROS knows no empty list of texts."""
    return [name.strip() for name in text.split(",")]


def read_number(name: str, text: str, kind: Callable[[str], float | int]) -> float | int:
    """Return an argument as a number."""
    try:
        return kind(text)
    except ValueError:
        wanted = "a whole number" if kind is int else "a number"
        raise ParameterError(f"{name}:={text}: it must be {wanted}") from None
