"""Start the nodes of a rig, each its own process: ``ros2 launch impact_rig rig.launch.py``.

``ros2 launch impact_rig rig.launch.py --show-args`` lists the arguments. The processes are those
of ``impact-rig up``; names are relative, so that the rig can be remapped and put in a namespace.
"""

import os
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_prefix
from launch import LaunchContext, LaunchDescription
from launch.action import Action
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    GroupAction,
    OpaqueFunction,
    SetEnvironmentVariable,
    Shutdown,
)
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node, PushRosNamespace
from launch_ros.utilities import make_namespace_absolute, prefix_namespace

from impact_rig.analysis.resuming import find_rig_of_run
from impact_rig.cli.rig_options import RIG_OPTIONS
from impact_rig.configuration.node_claim import check_free, join_names
from impact_rig.configuration.parameters import check_parameter_file
from impact_rig.configuration.processes import (
    LAUNCHER,
    MEASURING,
    NodeProcess,
    choose_run_folder,
    choose_view,
    list_rig_processes,
    make_network_variables,
    make_run_folder,
    split_names,
)
from impact_rig.configuration.rig_file import load_rig_file

NAMES = (
    "rig_file", "impacts", "plant", "seed", "faults", "continuous", "output", "resume",
    "visualizer", "page", "viewer", "only", "namespace", "respawn", "params_file", "network",
)  # fmt: skip
ARGUMENTS = [DeclareLaunchArgument(name, **RIG_OPTIONS[name].argument) for name in NAMES]


def generate_launch_description() -> LaunchDescription:
    """Return the arguments, and the rig they make."""
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=make_rig)])


def make_rig(context: LaunchContext) -> list[Action]:
    """Return the rig's nodes, and the campaign if one is to be run at once."""

    def read(name: str) -> Any:
        return RIG_OPTIONS[name].read(name, LaunchConfiguration(name).perform(context))

    rig = load_rig_file(read("rig_file"))
    is_continuous = read("continuous")
    source = {
        "plant": read("plant") or None,
        "seed": read("seed"),
        "fault_probability": read("faults"),
    }
    if read("resume"):
        found = find_rig_of_run(Path(read("resume")), rig.path, source)
        rig, source = found.rig, {**found.source}
        is_continuous |= found.is_continuous
    executables = Path(get_package_prefix("impact_rig"), "lib", "impact_rig")
    given = read("resume") or read("output")
    folder = choose_run_folder(Path(given) if given else None)
    processes = list_rig_processes(
        folder.resolve(),
        rig=rig,
        source=source,
        continuous=is_continuous,
        visualize=choose_view(read("visualizer"), executables / "visualizer"),
        page=read("page"),
        viewers=split_names(read("viewer")),
        only=split_names(read("only")),
    )
    namespace = find_namespace(context)
    check_free(join_names(namespace, (process.name for process in processes)))
    params_file = read("params_file") and str(Path(read("params_file")).expanduser())
    if params_file:
        check_parameter_file(Path(params_file))
    is_written = any("output" in process.parameters for process in processes)
    if is_written and not read("resume"):
        make_run_folder(folder)
    respawn = read("respawn")
    actions = [make_node(process, params_file, respawn=respawn) for process in processes]
    if read("namespace"):
        actions = [GroupAction([PushRosNamespace(read("namespace")), *actions])]
    if impacts := read("impacts"):
        actions.append(make_campaign(impacts, read("resume"), namespace))
    variables = make_network_variables(os.environ, network=read("network"))
    variables[LAUNCHER] = str(os.getpid())
    return [*(SetEnvironmentVariable(*item) for item in variables.items()), *actions]


def find_namespace(context: LaunchContext) -> str:
    """Return the rig's whole namespace: the argument, in what other launch files have pushed."""
    pushed = context.launch_configurations.get("ros_namespace")
    argument = LaunchConfiguration("namespace").perform(context)
    return make_namespace_absolute(prefix_namespace(pushed, argument or None)) or ""


def make_node(process: NodeProcess, params_file: str, *, respawn: bool) -> Action:
    """Return one node of the rig; it is started again when it ends, or the rig ends with it."""
    ends_rig = process.name in MEASURING and not respawn
    parameters: list[Any] = [params_file] if params_file else []
    if process.parameters:
        parameters.append(dict(process.parameters))
    return Node(
        package="impact_rig",
        executable=process.name,
        name=process.name,
        parameters=parameters,
        output="both",
        emulate_tty=True,
        sigterm_timeout="20",  # launch's own 5 s go by while a slow disk takes a recording
        respawn=respawn,
        respawn_delay=1.0,
        on_exit=Shutdown(reason=f"{process.name} ended") if ends_rig else None,
    )


def make_campaign(impacts: int, resume: str, namespace: str) -> Action:
    """Return the command that runs a campaign, or goes on with one; the rig ends with it."""
    wanted = ["--resume", resume] if resume else ["--impacts", str(impacts)]
    command = ["impact-rig", "campaign", *wanted, "--wait", "1 min"]  # its nodes start with it
    if namespace:
        command += ["--namespace", namespace]
    return ExecuteProcess(
        cmd=command, output="screen", on_exit=Shutdown(reason="the campaign ended")
    )
