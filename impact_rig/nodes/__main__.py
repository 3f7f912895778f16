"""One node as a process: ``python -m impact_rig.nodes hammer --ros-args ...``."""

import os
import signal
import sys
from functools import partial
from importlib import import_module

from impact_rig.configuration.processes import open_closed_streams


def run(name: str) -> int:
    """Run a node by its name; a signal ends it quietly, even during the imports."""
    for number in (signal.SIGINT, signal.SIGTERM):
        # An exception would come out of whichever module is being imported, as a traceback.
        signal.signal(number, lambda *_: os._exit(0))
    open_closed_streams()
    return int(import_module(f"impact_rig.nodes.{name}").main())


accelerometer = partial(run, "accelerometer")
campaign = partial(run, "campaign")
estimator = partial(run, "estimator")
hammer = partial(run, "hammer")
recorder = partial(run, "recorder")
replayer = partial(run, "replayer")
visualizer = partial(run, "visualizer")

if __name__ == "__main__":
    raise SystemExit(run(sys.argv[1]))
