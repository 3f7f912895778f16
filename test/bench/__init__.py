"""Measures what is claimed of this software, each figure beside its peer or its goal."""

import os
from pathlib import Path

_PATHS = (str(Path(__file__).resolve().parents[1]), os.environ.get("PYTHONPATH", ""))
# Its processes find its modules, too.
os.environ["PYTHONPATH"] = os.pathsep.join(path for path in _PATHS if path)

PARTS = {
    "start": "running",
    "model": "model",
    "hit": "model",
    "identification": "identification",
    "series": "memory",
    "write": "recording",
    "demo": "running",
    "latency": "running",
    "stop": "running",
    "devices": "devices",
    "read": "recording",
    "view": "view",
    "stream": "stream",
    "memory": "memory",
    "batch": "recording",
    "fuzz": "survival",
    "kill": "survival",
    "faults": "faults",
}
"""Parts and the modules of this package that measure them, in the order in which they run: the
quiet ones first."""
