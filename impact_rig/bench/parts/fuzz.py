"""Damaged recordings: reading them never hangs, crashes or takes more memory than is bounded."""

import json
import queue
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from impact_rig.bench.figures import Figure, at_most
from impact_rig.bench.part import Bench, Part
from impact_rig.bench.recordings import COMPRESSIONS, compress_anew
from impact_rig.bench.rig_processes import listen
from impact_rig.core.errors import RigError

VERDICTS = 2
"""In the good recordings [-], our choice: small ones are read soon, and damaged everywhere."""
TIME_LIMIT = 20.0
"""What one damaged recording may take, in all ways of reading it [s], our choice: a hundred times
as long as a good one."""
HARMLESS = ("read", "refused")
MEBI = 1024.0
"""KiB to MiB."""


@dataclass
class Tally:
    """What came of the damaged recordings.

    Attributes
    ----------
    outcomes : Counter
        How often each way of reading ended how.
    faults : list of str
        What must not happen, by the seed that makes it happen.
    peak : float
        Most memory of a process [MiB].
    """

    outcomes: Counter[tuple[str, str]] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    peak: float = 0.0

    def add(self, line: dict[str, Any]) -> None:
        """Take what the process said of one recording."""
        self.peak = max(self.peak, line["peak_kib"] / MEBI)
        for operation, outcome in line["outcomes"].items():
            self.outcomes[operation, outcome if outcome in HARMLESS else "fault"] += 1
            if outcome not in HARMLESS:
                self.faults.append(f"seed {line['seed']}, {operation}: {outcome}")


def measure(bench: Bench) -> tuple[Figure, ...]:
    """Spoil small recordings, and read them in every way that there is."""
    original = bench.campaigns.take(1)[0].recording
    good = bench.folder / "good"
    good.mkdir()
    for compression in COMPRESSIONS:
        compress_anew(original, good / f"{compression}.mcap", compression, VERDICTS)
    tally, total = Tally(), bench.extent.mutations
    first = last = bench.extent.seed
    while last < first + total:
        last = _run_process(bench, good, tally, first, last)
    ways = sorted(tally.outcomes)
    return (
        Figure(
            "hangs, crashes, wild errors",
            (float(len(tally.faults)),),
            goal=at_most(0),
            note="; ".join(tally.faults[:3]),
        ),
        Figure("damaged recordings", (float(total),), note="in each of these ways"),
        *(
            Figure(f"{operation}: {outcome}", (float(tally.outcomes[operation, outcome]),))
            for operation, outcome in ways
        ),
        Figure("most memory of the process", (tally.peak,), "MiB"),
    )


def _run_process(bench: Bench, folder: Path, tally: Tally, first: int, next_seed: int) -> int:
    """Read damaged recordings until all are read or one ends the process; return the next seed."""
    total = bench.extent.mutations
    words = ["-m", "impact_rig.bench.fuzz_process", str(folder), str(next_seed)]
    process = subprocess.Popen(
        [sys.executable, *words, str(first + total - next_seed)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    lines = listen(process)
    begun = None
    try:
        while text := lines.get(timeout=TIME_LIMIT):
            line = json.loads(text)
            if "outcomes" not in line:
                begun = line["seed"]
                continue
            tally.add(line)
            next_seed, begun = line["seed"] + 1, None
            bench.report(next_seed - first, total)
        reason = f"the process ended by itself, code {process.wait()}"
    except queue.Empty:
        reason = f"no end within {TIME_LIMIT:g} s"
    finally:
        process.kill()
        process.wait()
    if next_seed == first + total:
        return next_seed
    if begun is None:
        raise RigError(f"the process that reads damaged recordings cannot be run: {reason}")
    tally.faults.append(f"seed {begun}: {reason}")
    return int(begun) + 1


PART = Part("fuzz", "Damaged recordings: no hang, no crash, memory bounded", measure, 3.0)
