"""What survives `kill -9`: every verdict that was published has its hit in the recording."""

import json
import random
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bench.measure import Bench, Figure, at_most, part
from bench.rig_processes import RigProcesses, use_own_domain
from impact_rig.configuration.processes import RECORDING_NAME
from impact_rig.core.errors import FileError
from impact_rig.core.session import Session
from impact_rig.core.setup import RigSetup
from impact_rig.recordings.reader import read_recording

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
    """Kill the recorder and all nodes by turns, at random moments, and read the recordings."""
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
    said = folder / "verdicts"
    with (
        use_own_domain() as environment,
        RigProcesses(environment, folder / "log.txt") as processes,
    ):
        processes.start_listener(said)
        nodes = processes.start_rig(folder, OVERRIDES)
        processes.start_command("campaign", *CAMPAIGN, "--output", str(folder / "results"))
        processes.wait_until(lambda: "{" in said.read_text(), "the rig does not strike")
        time.sleep(wait)
        processes.kill([RECORDER] if recorder_alone else list(nodes))
        time.sleep(LISTENING_TIME)
        # Ctrl-C would make it ask the dead to stop, and wait for their answer.
        processes.kill(["impact-rig campaign"])
    # Fast DDS has something to say there now and then.
    lines = [json.loads(line) for line in said.read_text().splitlines() if line.startswith("{")]
    return {line["record"]: (line["accepted"], line["contact_time"].hex()) for line in lines}


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
