"""Replay a recording, and estimate and show it again: ``ros2 launch impact_rig replay.launch.py``.

``ros2 launch impact_rig replay.launch.py --show-args`` lists the arguments.
"""

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
    Shutdown,
)
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node, PushRosNamespace

from impact_rig.cli.rig_options import RIG_OPTIONS
from impact_rig.configuration.parameters import check_parameter_file
from impact_rig.configuration.processes import (
    WINDOW,
    choose_view,
    make_viewer_parameters,
    split_names,
)
from impact_rig.recordings.source import find_recordings

NAMES = ("rate", "loop", "visualizer", "viewer", "namespace", "params_file")
ARGUMENTS = (
    DeclareLaunchArgument(
        "file", description="Path of the recording: an .mcap file, or the folder of a run"
    ),
    *(DeclareLaunchArgument(name, **RIG_OPTIONS[name].argument) for name in NAMES),
    DeclareLaunchArgument(
        "view",
        default_value="",
        description="Write the view into this .rrd file; with neither this nor viewer: a window",
    ),
    DeclareLaunchArgument(
        "exit_when_done",
        default_value="false",
        choices=["true", "false"],
        description="End all nodes at the end of the recording",
    ),
)


def generate_launch_description() -> LaunchDescription:
    """Return the arguments, and the nodes they ask for."""
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=make_replay)])


def make_replay(context: LaunchContext) -> list[Action]:
    """Return the replayer, an estimator, and a visualizer where it can be had."""

    def read(name: str) -> Any:
        text = LaunchConfiguration(name).perform(context)
        return RIG_OPTIONS[name].read(name, text) if name in NAMES else text

    actions: list[Action] = []
    listeners: dict[str, dict[str, Any]] = {"estimator": {}}
    executables = Path(get_package_prefix("impact_rig"), "lib", "impact_rig")
    if choose_view(read("visualizer"), executables / "visualizer"):
        listeners["visualizer"] = choose_destination(read("viewer"), read("view"))
    elif read("visualizer") == "auto":
        actions.append(LogInfo(msg="rerun-sdk is not installed: the replay goes without the view"))
    path = Path(read("file")).expanduser()
    find_recordings(path)  # refuses what is none before a node starts
    replayer = {
        "file": str(path.resolve()),
        **{name: read(name) for name in ("rate", "loop") if read(name) is not None},
        "required_subscribers": ", ".join(listeners),
        "exit_when_done": read("exit_when_done") == "true",
    }
    params_file = read("params_file") and str(Path(read("params_file")).expanduser())
    if params_file:
        check_parameter_file(Path(params_file))
    actions += [
        make_node(name, parameters, params_file)
        for name, parameters in {**listeners, "replayer": replayer}.items()
    ]
    if read("namespace"):
        actions = [GroupAction([PushRosNamespace(read("namespace")), *actions])]
    return actions


def choose_destination(viewer: str, view: str) -> dict[str, Any]:
    """Return the visualizer's parameters: file and viewers, or a window if nothing is chosen."""
    viewers = split_names(viewer)
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
