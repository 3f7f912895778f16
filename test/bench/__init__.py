"""Measures what is claimed of this software, each figure beside its goal."""

import os
from pathlib import Path

from impact_rig.configuration.processes import use_one_thread

use_one_thread()  # as the rig's own programs do

_PATHS = (str(Path(__file__).resolve().parents[1]), os.environ.get("PYTHONPATH", ""))
# The processes that it starts find its modules, too.
os.environ["PYTHONPATH"] = os.pathsep.join(path for path in _PATHS if path)

PARTS = {
    "model": ("model", "The model beside an integrator"),
    "law": ("model", "The contact law of one hit"),
    "write": ("recording", "Writing serialised messages, beside mcap.writer"),
    "demo": ("running", "The paper's campaign on the virtual rig, start to tables"),
    "latency": ("running", "From release command to published verdict and estimate"),
    "stop": ("running", "The command to stop a campaign's hammer, to its answer"),
    "commands": ("running", "What commands take, with a recording of 120 hits"),
    "headless": ("running", "A test's rig, and three hits of one sample"),
    "memory": ("running", "What the estimator keeps of a hit"),
    "page": ("page", "The page at the rig in a browser: a stop, and its load"),
    "read": ("recording", "Reading a recording, beside mcap.reader doing nothing"),
    "growth": ("recording", "The time that a hit takes, late in a long series"),
    "stream": ("stream", "The running stream through three processes, two channels"),
    "fuzz": ("damage", "Damaged files of every format: no hang, no crash, memory bounded"),
    "faults": ("faults", "A fault in each campaign: no hit lost or double, all told"),
    "clone": ("running", "From a fresh clone to the tables"),
    "study": ("study", "The estimators where the truth is known; asked is what chance leaves"),
}
"""The module of this package with `measure_<name>`, and the title of each part, in the order in
which they run: the quiet ones first."""
