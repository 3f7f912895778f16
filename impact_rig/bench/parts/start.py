"""How long the command line and the nodes take until they can do anything."""

import importlib.util
import subprocess
import sys
import time
from collections.abc import Sequence

from impact_rig.bench.figures import Figure, at_most
from impact_rig.bench.part import Bench, Part
from impact_rig.configuration.processes import list_rig_processes

LONGEST_HELP = 0.3
"""Of `impact-rig --help` [s], as asked for."""
IMPORTS = 2
"""Starts of each node, by turns [-], our choice: half a second each, and no goal."""
EMPTY = ("-c", "pass")
HELP = ("-m", "impact_rig.cli.main", "--help")


def measure(bench: Bench) -> tuple[Figure, ...]:
    """Time processes that end as soon as they have imported what they need."""
    if importlib.util.find_spec("rclpy") is None:
        raise ModuleNotFoundError("the nodes need rclpy", name="rclpy")
    helps, empties = [], []
    run_python(HELP)
    for _ in range(bench.extent.repeats):
        helps.append(run_python(HELP))
        empties.append(run_python(EMPTY))
    imports = {
        process.name: ("-c", f"import impact_rig.nodes.{process.name}")
        for process in list_rig_processes(bench.folder)
    }
    # Once all together: whoever comes first reads the files that the others need, too.
    run_python(("-c", "; ".join(statement for _, statement in imports.values())))
    times: dict[str, list[float]] = {name: [] for name in imports}
    for turn in range(IMPORTS):
        bench.report(turn, IMPORTS)
        for name, words in imports.items():
            times[name].append(run_python(words))
    figures = [Figure(f"{name}, its imports", tuple(found), "s") for name, found in times.items()]
    return (
        Figure("impact-rig --help", tuple(helps), "s", at_most(LONGEST_HELP)),
        Figure("python -c pass", tuple(empties), "s", note="in turns with it"),
        *figures,
    )


def run_python(words: Sequence[str]) -> float:
    """Run Python with arguments, and return how long that took [s]."""
    started = time.perf_counter()
    subprocess.run([sys.executable, *words], stdout=subprocess.DEVNULL, check=True)
    return time.perf_counter() - started


PART = Part("start", "Start of the command line and of each node", measure, 10.0)
