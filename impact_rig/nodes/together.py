"""Nodes that start together: ``python -m impact_rig.nodes.together JOB``, as `RunningNodes` does.

One process imports what all of them share, then forks each node: no process imports it again. ROS
is not imported before, since its libraries start threads, which no fork survives.
"""

import gc
import inspect
import json
import os
import signal
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from impact_rig.configuration.processes import Notice, notify
from impact_rig.nodes.__main__ import run

SHARED = (
    "ament_index_python.packages",
    "asyncio",
    "concurrent.futures.thread",
    "diagnostic_msgs.msg",
    "impact_rig.core.session",
    "impact_rig.devices.virtual.drivers",
    "impact_rig.recordings.scan",
    "impact_rig.status.states",
    "impact_rig_msgs.action",
    "impact_rig_msgs.msg",
    "impact_rig_msgs.srv",
    "lifecycle_msgs.msg",
    "lifecycle_msgs.srv",
    "rcl_interfaces.msg",
    "rcl_interfaces.srv",
    "rosgraph_msgs.msg",
    "rosidl_generator_py",
    "service_msgs.msg",
    "std_msgs.msg",
    "std_srvs.srv",
    "type_description_interfaces.msg",
    "type_description_interfaces.srv",
    "yaml",
)
"""What nearly every node imports, and nothing that starts a thread."""
FOR_HITS = "scipy.optimize"
"""What the first hit needs of estimator and virtual rig."""


def fork_nodes(nodes: Mapping[str, Any]) -> None:
    """Fork nodes, tell the number of each process, and its exit code when it ends.

    By a node's name: the descriptor that it prints to, and the words of its command line.
    """
    # From here on a request to stop is for the nodes, which share this process group; in each it
    # waits until the node can take it.
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    names = {}
    for name, (output, words) in nodes.items():
        number = os.fork()
        if not number:
            os.dup2(output, 1)
            os.dup2(output, 2)
            for other, _ in nodes.values():
                os.close(other)
            sys.argv[1:] = words
            Path("/proc/self/comm").write_text(name, "ascii")  # as `ps` and `top` show it
            run(name)
        names[number] = name
        notify(Notice.STARTED, f"{name} {number}")
    if signal.SIGTERM in signal.sigpending():
        os.killpg(0, signal.SIGTERM)  # which those have missed that have been forked since
    for output, _ in nodes.values():
        os.close(output)
    while names:
        number, status = os.wait()
        notify(Notice.ENDED, f"{names.pop(number)} {os.waitstatus_to_exitcode(status)}")


if __name__ == "__main__":
    job = json.loads(sys.argv[1])
    for module in (*SHARED, *[FOR_HITS] * bool({"accelerometer", "estimator"} & job.keys())):
        import_module(module)
    # The first line of a log looks for its module among all of them.
    inspect.getmodule(fork_nodes.__code__)
    gc.freeze()  # what is there stays shared: no search for garbage touches it
    fork_nodes(job)
