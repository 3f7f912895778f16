"""From the command to stop to a hammer that nothing lets go any more, in a running campaign."""

import json
import queue
import time
from collections.abc import Sequence

from impact_rig.bench.figures import Figure, at_most
from impact_rig.bench.part import Bench, Part
from impact_rig.bench.rig_processes import (
    COMMAND_LINE,
    RigProcesses,
    listen,
    use_own_domain,
)
from impact_rig.core.errors import RigError

STOPS = 5
"""Of each kind, by turns [-], our choice: each takes half a second."""
LONGEST = 1.0
"""From the command's start to the disarmed hammer [s], as the README says."""
PATIENCE = 60.0
"""How long the hammer may take to say what comes next [s]."""
SAMPLE = "steel small"
HITS = "10000"
"""More than are struck meanwhile."""
CAMPAIGN = "impact_rig.bench.campaign_process"
WATCH = "impact_rig.bench.hammer_process"
KINDS: dict[str, tuple[str, Sequence[str]]] = {
    "impact-rig hammer stop": (COMMAND_LINE, ("hammer", "stop")),
    "bare rclpy": ("impact_rig.bench.bare_stop_process", ()),
}
"""Modules that stop the hammer, with their arguments."""


def measure(bench: Bench) -> tuple[Figure, ...]:
    """Stop a campaign again and again, by the command and by rclpy alone."""
    delays: dict[str, list[float]] = {name: [] for name in KINDS}
    with (
        use_own_domain() as environment,
        RigProcesses(environment, bench.folder / "log.txt") as processes,
    ):
        processes.start_rig(bench.folder, {}, visualize=False)
        states = listen(processes.start_module(WATCH, listen=True))
        processes.start_module(CAMPAIGN, (SAMPLE, HITS))
        for turn in range(STOPS):
            for number, (name, (module, arguments)) in enumerate(KINDS.items()):
                bench.report(len(KINDS) * turn + number, len(KINDS) * STOPS)
                await_state(states, "released", processes)
                started = time.time()
                stopper = processes.start_module(module, arguments)
                delays[name].append(await_state(states, "stopped", processes) - started)
                if stopper.wait():
                    raise RigError(f"{name} has failed: {processes.read_log()}")
    ours, bare = delays.values()
    return (
        Figure(
            "impact-rig hammer stop, to the disarmed hammer",
            tuple(ours),
            "s",
            at_most(LONGEST),
            note="a campaign runs; from the start of the command's process to the stamp of the"
            " hammer's state",
        ),
        Figure("a process with rclpy alone", tuple(bare), "s", note="by turns with it"),
    )


def await_state(states: "queue.Queue[str]", wanted: str, processes: RigProcesses) -> float:
    """Wait until the hammer says that it is "released" or "stopped"; return since when [s].

    Raises
    ------
    RigError
        If it does not.
    """
    deadline = time.monotonic() + PATIENCE
    while True:
        try:
            line = states.get(timeout=max(deadline - time.monotonic(), 0.0))
        except queue.Empty:
            line = ""
        if not line:
            raise RigError(f"the hammer is not {wanted}: {processes.read_log()}")
        state = json.loads(line)
        if state[wanted]:
            return float(state["time"])


PART = Part("stop", "From the command to stop to the disarmed hammer", measure, 12.0)
