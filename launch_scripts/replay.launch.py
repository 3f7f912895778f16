"""Replay a recording, and estimate and show it again: ``ros2 launch impact_rig replay.launch.py``.

``ros2 launch impact_rig replay.launch.py --show-args`` lists the arguments.
"""

from pathlib import Path
from typing import Any

from launch import LaunchContext, LaunchDescription
from launch.action import Action
from launch.actions import (
    DeclareLaunchArgument,
    GroupAction,
    OpaqueFunction,
    SetEnvironmentVariable,
    Shutdown,
)
from launch.substitutions import EnvironmentVariable, LaunchConfiguration
from launch_ros.actions import Node, PushRosNamespace

from impact_rig.core.errors import ParameterError

SWITCH = ["true", "false"]
ARGUMENTS = (
    DeclareLaunchArgument("file", description="path of the recording (.mcap)"),
    DeclareLaunchArgument(
        "rate",
        default_value="1.0",
        description="speed, part of the original's; 0: as fast as the nodes take it",
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
        description="address of a Rerun viewer that runs, rerun+http://HOST:9876/proxy; empty:"
        " open one on this host",
    ),
    DeclareLaunchArgument(
        "view",
        default_value="",
        description="write the view into this .rrd file, and open no viewer",
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

    listeners: dict[str, dict[str, Any]] = {}
    if read("estimator") == "true":
        listeners["estimator"] = {}
    if read("visualizer") == "true":
        listeners["visualizer"] = choose_destination(read("viewer"), read("view"))
    replayer = {
        "file": str(Path(read("file")).expanduser().resolve()),
        "rate": read_rate(read("rate")),
        # Without its own estimator, it replays the results of the recording.
        "topics": "inputs" if "estimator" in listeners else "all",
        "required_subscribers": ", ".join(listeners),
        "exit_when_done": read("exit_when_done") == "true",
    }
    actions: list[Action] = [
        make_node(name, parameters, read("params_file"))
        for name, parameters in {**listeners, "replayer": replayer}.items()
    ]
    if read("namespace"):
        actions = [GroupAction([PushRosNamespace(read("namespace")), *actions])]
    variable = "ROS_AUTOMATIC_DISCOVERY_RANGE"
    discovery = EnvironmentVariable(variable, default_value="LOCALHOST")
    return [SetEnvironmentVariable(variable, discovery), *actions]


def choose_destination(viewer: str, view: str) -> dict[str, Any]:
    """Return the visualizer's parameters: file, running viewer, or one of its own."""
    if view:
        return {"output": str(Path(view).expanduser().resolve())}
    return {"connect": viewer} if viewer else {"spawn": True}


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


def read_rate(text: str) -> float:
    """Return the speed of the replay."""
    try:
        return float(text)
    except ValueError:
        raise ParameterError(f"rate:={text}: it must be a number") from None
