"""One node as a process: ``python -m impact_rig.nodes hammer --ros-args ...``."""

import os
import signal
import sys
from importlib import import_module
from pathlib import Path
from typing import NoReturn

from impact_rig.configuration.processes import open_closed_streams

NEEDED = {
    "impact_rig_msgs": "build both packages, in the rig's folder `colcon build --base-paths . "
    "msg_config`, and source install/setup.sh",
    "rclpy": "source ROS 2 Jazzy, or start the rig by `launch_scripts/rig.py`",
}
"""Packages that every node needs, and how to get them."""

HELP = """\
usage: ros2 run impact_rig {name} [--ros-args -p PARAMETER:=VALUE ...]

Run the node {name} of the impact rig until a signal stops it. Its parameters, once it runs:
ros2 param describe /{name} PARAMETER"""


def run(name: str) -> NoReturn:
    """Run a node by its name as this process; a signal ends it quietly, even in the imports."""
    code = _run(name)
    sys.stdout.flush()
    sys.stderr.flush()
    # All is closed. Python's own end, and that of the middleware's threads, would take seconds on
    # a busy computer.
    os._exit(code)


def _run(name: str) -> int:
    for number in (signal.SIGINT, signal.SIGTERM):
        # An exception would come out of whichever module is being imported, as a traceback.
        signal.signal(number, lambda *_: os._exit(0))
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})  # a forked node has it blocked
    open_closed_streams()
    if {"-h", "--help"} & set(sys.argv):
        print(HELP.format(name=name))
        return 0
    if name == "visualizer":
        os.nice(10)  # it may be late, the rig may not
        # Rerun would load it, if it is installed, to see whether a text is a table of it.
        sys.modules["pandas"] = None  # type: ignore[assignment]
    try:
        process = import_module("impact_rig.nodes.process")
        module = import_module(f"impact_rig.nodes.{name}")
    except ModuleNotFoundError as error:
        if error.name not in NEEDED:
            raise
        print(f"error: {error.name} is missing: {NEEDED[error.name]}", file=sys.stderr)
        return 1
    return int(process.run_node(getattr(module, f"{name.capitalize()}Node")))


def main() -> NoReturn:
    """Run the node that this program is called after, as `ros2 run` has it."""
    run(Path(sys.argv[0]).name)


if __name__ == "__main__":
    run(sys.argv[1])
