"""What must survive: readers damaged recordings, and verdicts the end of processes."""

import json
import queue
import random
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import wavfile

from bench.measure import Bench, Figure, at_most, part
from bench.rig_processes import COMMAND_LINE, RigProcesses, listen, use_own_domain
from impact_rig.configuration.processes import RECORDING_NAME
from impact_rig.configuration.rig_file import read_template
from impact_rig.core.errors import FileError, RigError
from impact_rig.core.paper_method import HammerEstimate
from impact_rig.core.records import HitLabel
from impact_rig.core.sample import SampleEstimate
from impact_rig.core.session import Session
from impact_rig.core.setup import PAPER_SETUP, RigSetup
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.recordings.formats.measurement import MeasuredChannel, Measurement
from impact_rig.recordings.formats.registry import WRITABLE, write_measurement
from impact_rig.recordings.messages import MessageEncoder
from impact_rig.recordings.qos import OfferedQos
from impact_rig.recordings.reader import read_recording
from impact_rig.recordings.writer import RecordingWriter
from impact_rig.results.campaign import Results
from impact_rig.results.results_file import write_results

TIME = 1_700_000_000_000_000_000
"""Of what is recorded [ns]."""
TIME_LIMIT = 30.0  # [s], for one damaged file: a hundred times as long as a good one
DATA = Path(__file__).parents[1] / "data" / "repeat_shock"
HARMLESS = ("read", "refused")


@part("fuzz", "Damaged files of every format: no hang, no crash, memory bounded", 30.0)
def measure_fuzz(bench: Bench) -> Iterator[Figure]:
    """Spoil small files of every format, and read them in every way that there is."""
    good, others = bench.folder / "good", bench.folder / "others"
    good.mkdir()
    others.mkdir()
    for compression in ("zstd", "lz4", "none"):
        write_recording(good / f"{compression}.mcap", compression)
    total = bench.extent.mutations
    faults = _read_damaged(good, bench.extent.seed, total)
    number = total * write_files(others)
    faults += _read_damaged(others, bench.extent.seed, number)
    note = f"of {total + number}; {'; '.join(faults[:3])}"
    yield Figure("damaged files that hang or crash", len(faults), "", at_most(0), note)


def write_recording(path: Path, compression: str) -> None:
    """Write a recording of two hits."""
    encoder, rig = MessageEncoder(), VirtualRig(PAPER_SETUP, VirtualRigSettings())
    with RecordingWriter(path, compression=compression) as writer:
        channel = writer.add_channel("/setup", encoder.setup_definition, (OfferedQos(),))
        writer.add_message(channel, encoder.encode_setup(PAPER_SETUP, TIME), TIME, TIME)
        channel = writer.add_channel("/acceleration", encoder.block_definition, (OfferedQos(),))
        for record in (1, 2):
            for block in rig.strike(HitLabel("steel large", record, record)).split(1000, 0):
                writer.add_message(channel, encoder.encode_block(block), TIME, TIME)


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


def _read_damaged(folder: Path, first: int, total: int) -> list[str]:
    """Read damaged files until all are read; return what must not happen, by its seed."""
    faults: list[str] = []
    seed, end = first, first + total
    while seed < end:
        command = [sys.executable, "-m", "bench.damage", str(folder), str(seed), str(end - seed)]
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        lines, begun = listen(process), None
        try:
            while text := lines.get(timeout=TIME_LIMIT):
                line = json.loads(text)
                begun = line["seed"]
                for operation, outcome in line.get("outcomes", {}).items():
                    seed = begun + 1
                    if outcome not in HARMLESS:
                        faults.append(f"seed {begun}, {operation}: {outcome}")
            reason = f"the process ended by itself, code {process.wait()}"
        except queue.Empty:
            reason = f"no end within {TIME_LIMIT:g} s"
        finally:
            process.kill()
            process.wait()
        if begun is None:
            raise RigError(f"the process that reads damaged files cannot be run: {reason}")
        if seed <= begun:
            faults.append(f"seed {begun}: {reason}")
            seed = begun + 1
    return faults


CAMPAIGN = ("--impacts", "30", "--attempts", "100")
OVERRIDES: dict[str, dict[str, Any]] = {
    "hammer": {"swing_time": 0.02},
    "accelerometer": {"trigger_timeout": 0.1, "source": "fault_probability = 0.03"},
}
"""Short swings; some hits are bad, as on a real rig."""
LONGEST_WAIT = 3.0  # [s], from the first verdict to the kill: some twenty hits
LISTENING_TIME = 0.5  # [s], for verdicts on their way, which take a millisecond
RECORDER = "recorder"


Verdict = tuple[bool, str]
"""Whether a hit is accepted, and its contact time [s], bit by bit."""


@part("kill", "kill -9 in the middle of campaigns: no published verdict is lost", 10.0)
def measure_kills(bench: Bench) -> Iterator[Figure]:
    """Kill the recorder and all nodes by turns, at random moments, and recover the recordings."""
    dice = random.Random(bench.extent.seed)
    seen = 0
    lost: list[str] = []
    for number in range(bench.extent.kills):
        folder = bench.folder / str(number)
        folder.mkdir()
        verdicts = _run_and_kill(
            folder, recorder_alone=number % 2 == 0, wait=dice.uniform(0.0, LONGEST_WAIT)
        )
        found = _judge(folder / RECORDING_NAME)
        seen += len(verdicts)
        lost += [
            f"kill {number}, record {record}"
            for record, verdict in verdicts.items()
            if verdict != found.get(record)
        ]
    note = f"of {seen} in {bench.extent.kills} kills; {'; '.join(lost[:3])}"
    yield Figure("verdicts that outlived their hit", len(lost), "", at_most(0), note)


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
            said["record"]: (said["accepted"], float(said["contact_time_s"]).hex())
            for said in (first, *observer)
        }


def _judge(path: Path) -> dict[int, Verdict]:
    """Return the verdicts on the hits that a recording has, by record."""
    session: Session | None = None
    found: dict[int, Verdict] = {}
    try:
        for event in read_recording(path).events():
            if isinstance(event, RigSetup):
                session = Session(event)
            elif session is not None:
                for hit in session.feed(event):
                    found[hit.label.record] = (hit.accepted, float(hit.contact_time).hex())
    except FileError:
        # A recorder that was killed at once has written nothing.
        pass
    return found
