"""A node of yours is the accelerometer: it publishes samples, the driver `topic` reads them."""

import subprocess
import sys
from pathlib import Path

from impact_rig.testing import run_rig

BENCH = Path(__file__).parents[2] / "test/ros2/outside/bench_accelerometer"
NODE = [sys.executable, "-c", "from samples import main; main()"]

with (
    run_rig(BENCH / "bench.toml") as rig,
    subprocess.Popen(NODE, cwd=BENCH / "bench_accelerometer") as node,
):
    print(rig.campaign("rubber", impacts=2))
    node.terminate()
