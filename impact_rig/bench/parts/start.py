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
    nodes = [process.name for process in list_rig_processes(bench.folder)]
    figures = []
    for number, name in enumerate(nodes):
        bench.report(number, len(nodes))
        words = ("-c", f"import impact_rig.nodes.{name}")
        run_python(words)
        figures.append(Figure(f"{name}, its imports", (run_python(words),), "s"))
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


PART = Part("start", "Start of the command line and of each node", measure, 7.0)
