"""What must survive: readers damaged recordings, and verdicts the end of processes."""

import json
import math
import queue
import random
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import wavfile

from bench.campaigns import COMPRESSIONS, compress_anew
from bench.measure import Bench, Figure, at_most, part
from bench.rig_processes import COMMAND_LINE, RigProcesses, listen, use_own_domain
from impact_rig.configuration.processes import RECORDING_NAME
from impact_rig.configuration.rig_file import read_template
from impact_rig.core.errors import FileError, RigError
from impact_rig.core.estimation.paper_method import HammerEstimate
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.session import Session
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import Block
from impact_rig.recordings.formats.measurement import MeasuredChannel, Measurement
from impact_rig.recordings.formats.registry import WRITABLE, write_measurement
from impact_rig.recordings.reader import read_recording
from impact_rig.recordings.recover import recover_recording
from impact_rig.results.campaign import Results
from impact_rig.results.results_file import write_results

VERDICTS = 2
"""In the good recordings [-], our choice: small ones are read soon, and damaged everywhere."""
TIME_LIMIT = 30.0
"""What one damaged file may take, in all ways of reading it [s], our choice: a hundred times as
long as a good one."""
DATA = Path(__file__).parents[1] / "data" / "repeat_shock"
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


@part("fuzz", "Damaged recordings: no hang, no crash, memory bounded", 3.0)
def measure_fuzz(bench: Bench) -> Iterator[Figure]:
    """Spoil small recordings, and read them in every way that there is."""
    original = bench.campaigns.take(1)[0].recording
    good = bench.folder / "good"
    good.mkdir()
    for compression in COMPRESSIONS:
        compress_anew(original, good / f"{compression}.mcap", compression, VERDICTS)
    tally, total = Tally(), bench.extent.mutations
    _read_damaged(bench, good, tally, total)
    others = bench.folder / "others"
    others.mkdir()
    _read_damaged(bench, others, tally, total * write_files(others))
    note = "; ".join(tally.faults[:3])
    yield Figure("hangs, crashes, wild errors", len(tally.faults), "", at_most(0), note)
    yield Figure("damaged recordings", total, note="in each of the first four ways")
    yield Figure("damaged files of each other format", total, note="as `import` reads them")
    for (operation, outcome), number in sorted(tally.outcomes.items()):
        yield Figure(f"{operation}: {outcome}", number)
    yield Figure("most memory of the process", tally.peak, "MiB")


def write_files(folder: Path) -> int:
    """Write a good file of each format; return how many."""
    trace = np.sin(np.arange(2000) / 100) * np.exp(-((np.arange(2000) - 500) ** 2) / 2e3)
    channels = [MeasuredChannel(name, trace, 51_200.0, "m/s^2") for name in ("hammer", "sample")]
    for suffix in WRITABLE:
        write_measurement(folder / f"a{suffix}", Measurement(folder, tuple(channels)))
    np.save(folder / "a.npy", np.stack([np.arange(2000) / 51_200, trace, trace]))
    np.savez_compressed(folder / "a.npz", hammer=trace, dt=1 / 51_200)
    wavfile.write(folder / "a.wav", 51_200, (2e4 * trace).astype(np.int16))
    shutil.copy(DATA / "Test_001_shock.lvm", folder / "a.lvm")
    rows = "\n".join(f"{number / 51_200}\t{value}" for number, value in enumerate(trace))
    (folder / "a.txt").write_text(f"Time (s)\tHammer (m/s^2)\n{rows}\n", "utf-8")
    results = Results(PAPER_SETUP, HammerEstimate(), (SampleEstimate("tin", 3, 1),), ())
    write_results(folder / "a.json", results)
    (folder / "a.toml").write_text(read_template(), "utf-8")
    return len(list(folder.iterdir()))


def _read_damaged(bench: Bench, folder: Path, tally: Tally, total: int) -> None:
    first = last = bench.extent.seed
    while last < first + total:
        last = _run_process(bench, folder, tally, first, last, total)


def _run_process(
    bench: Bench, folder: Path, tally: Tally, first: int, next_seed: int, total: int
) -> int:
    """Read damaged files until all are read or one ends the process; return the next seed."""
    words = ["-m", "bench.damage", str(folder), str(next_seed)]
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


CAMPAIGN = ("--impacts", "30", "--attempts", "100")
OVERRIDES: dict[str, dict[str, Any]] = {
    "hammer": {"swing_time": 0.02},
    "accelerometer": {"trigger_timeout": 0.1, "source": "fault_probability = 0.03"},
}
"""Nobody waits for a simulated swing; some hits are bad, as on a real rig."""
LONGEST_WAIT = 3.0
"""From the first verdict to the kill, at most [s], our choice: some twenty hits."""
LISTENING_TIME = 0.5
"""How long verdicts on their way are still listened to [s], our choice: a message takes less than
a millisecond."""
RECORDER = "recorder"


@dataclass(frozen=True)
class Verdict:
    """What was said of a hit.

    Attributes
    ----------
    accepted : bool
        Whether it goes into the mean.
    contact_time : float
        [s]; NaN: not determined.
    """

    accepted: bool
    contact_time: float

    def is_same(self, other: "Verdict | None") -> bool:
        """Return whether another verdict is this one, bit by bit."""
        if other is None or self.accepted is not other.accepted:
            return False
        both_unknown = math.isnan(self.contact_time) and math.isnan(other.contact_time)
        return both_unknown or self.contact_time == other.contact_time


@part("kill", "kill -9 in the middle of campaigns: no published verdict is lost", 10.0)
def measure_kills(bench: Bench) -> Iterator[Figure]:
    """Kill the recorder and all nodes by turns, at random moments, and recover the recordings."""
    dice = random.Random(bench.extent.seed)
    seen = lost = recovered = 0
    details: list[str] = []
    total = bench.extent.kills
    for number in range(total):
        bench.report(number, total)
        folder = bench.folder / str(number)
        folder.mkdir()
        verdicts = _run_and_kill(
            folder, recorder_alone=number % 2 == 0, wait=dice.uniform(0.0, LONGEST_WAIT)
        )
        found = recover_verdicts(folder / RECORDING_NAME)
        missing = [
            record
            for record, verdict in verdicts.items()
            if not verdict.is_same(found.get(record))
        ]
        if missing:
            details.append(f"kill {number}: records {missing}")
        seen += len(verdicts)
        lost += len(missing)
        recovered += len(found)
    yield Figure("verdicts lost", lost, "", at_most(0), "; ".join(details[:3]))
    yield Figure("verdicts seen by an observer", seen)
    yield Figure("hits recovered", recovered)
    yield Figure("kills", total, note="of the recorder and of all nodes by turns")


def _run_and_kill(folder: Path, *, recorder_alone: bool, wait: float) -> dict[int, Verdict]:
    """Run a campaign, kill processes of the rig, and return the verdicts that were seen."""
    with (
        use_own_domain() as environment,
        RigProcesses(environment, folder / "log.txt") as processes,
    ):
        observer = processes.start_outside("verdicts")
        nodes = processes.start_rig(folder, OVERRIDES, visualize=False)
        processes.start_command(
            "campaign", "--json", *CAMPAIGN, "--output", str(folder / "results")
        )
        first = observer.wait_for("the rig does not strike")
        time.sleep(wait)
        processes.kill([RECORDER] if recorder_alone else list(nodes))
        time.sleep(LISTENING_TIME)
        # Who asked for the campaign would ask it to stop, and wait for the answer of the dead.
        processes.kill(["outside verdicts", COMMAND_LINE])
        return {
            said["record"]: Verdict(said["accepted"], said["contact_time_s"])
            for said in (first, *observer)
        }


def recover_verdicts(path: Path) -> Mapping[int, Verdict]:
    """Recover a recording, and judge the hits in it again.

    Returns
    -------
    mapping of int to Verdict
        By record; empty: nothing could be recovered.
    """
    output = path.with_name("recovered.mcap")
    try:
        recovery = recover_recording(path, output)
        events = read_recording(recovery.output or path).events()
        return _judge(events)
    except FileError:
        return {}


def _judge(events: Iterable[RigSetup | Block]) -> dict[int, Verdict]:
    session: Session | None = None
    found: dict[int, Verdict] = {}
    for event in events:
        if isinstance(event, RigSetup):
            session = Session(event)
        elif session is not None:
            for hit in session.feed(event):
                found[hit.label.record] = Verdict(hit.accepted, hit.contact_time)
    return found
