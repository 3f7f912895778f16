"""Measures what is claimed of this software, each figure beside its goal."""

import os
from pathlib import Path

_PATHS = (str(Path(__file__).resolve().parents[1]), os.environ.get("PYTHONPATH", ""))
# The processes that it starts find its modules, too.
os.environ["PYTHONPATH"] = os.pathsep.join(path for path in _PATHS if path)

PARTS = {
    "model": "model",
    "identification": "model",
    "law": "model",
    "write": "recording",
    "demo": "running",
    "latency": "running",
    "stop": "running",
    "read": "recording",
    "stream": "stream",
    "fuzz": "damage",
    "faults": "faults",
    "study": "study",
}
"""Parts and the modules of this package that measure them, in the order in which they run: the
quiet ones first."""
