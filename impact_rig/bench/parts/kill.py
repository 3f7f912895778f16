"""Processes killed in the middle of campaigns: every verdict that was published is recovered."""

import json
import math
import queue
import random
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from impact_rig.bench.figures import Figure, at_most
from impact_rig.bench.part import Bench, Part
from impact_rig.bench.rig_processes import COMMAND_LINE, RigProcesses, use_own_domain
from impact_rig.configuration.processes import RECORDING_NAME
from impact_rig.core.errors import FileError, RigError
from impact_rig.core.session import Session
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import Block
from impact_rig.recording.reading.mcap_reader import read_recording
from impact_rig.recording.recovery.recovery import recover_recording

CAMPAIGN = ("--impacts", "30", "--attempts", "100")
OVERRIDES = {
    "hammer": {"swing_time": 0.02},
    "accelerometer": {"trigger_timeout": 0.1, "fault_probability": 0.03},
}
"""Nobody waits for a simulated swing; some hits are bad, as on a real rig."""
START_TIMEOUT = 60.0
"""How long a rig may take to its first verdict [s]."""
LONGEST_WAIT = 3.0
"""From the first verdict to the kill, at most [s], our choice: some twenty hits."""
AFTERMATH = 0.5
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


def measure(bench: Bench) -> tuple[Figure, ...]:
    """Kill the recorder and all nodes by turns, at random moments, and recover the recordings."""
    dice = random.Random(bench.extent.seed)  # noqa: S311 - the moments are no secret
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
    return (
        Figure("verdicts lost", (float(lost),), goal=at_most(0), note="; ".join(details[:3])),
        Figure("verdicts seen by an observer", (float(seen),)),
        Figure("hits recovered", (float(recovered),)),
        Figure("kills", (float(total),), note="of the recorder and of all nodes by turns"),
    )


def _run_and_kill(folder: Path, *, recorder_alone: bool, wait: float) -> dict[int, Verdict]:
    """Run a campaign, kill processes of the rig, and return the verdicts that were seen."""
    with (
        use_own_domain() as environment,
        RigProcesses(environment, folder / "log.txt") as processes,
    ):
        observer, lines = processes.start_observer()
        nodes = processes.start_rig(folder, OVERRIDES, visualize=False)
        processes.start_campaign(*CAMPAIGN, "--output", str(folder / "results"))
        try:
            first = lines.get(timeout=START_TIMEOUT)
        except queue.Empty:
            raise RigError(f"the rig does not strike: {processes.read_log()}") from None
        time.sleep(wait)
        processes.kill([RECORDER] if recorder_alone else list(nodes))
        time.sleep(AFTERMATH)
        # Who asked for the campaign would ask it to stop, and wait for the answer of the dead.
        processes.kill([observer, COMMAND_LINE])
        return dict(map(_parse_verdict, [first, *iter(lines.get, "")]))


def _parse_verdict(line: str) -> tuple[int, Verdict]:
    content = json.loads(line)
    return content["record"], Verdict(content["accepted"], content["contact_time_s"])


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


PART = Part(
    "kill", "kill -9 in the middle of campaigns: no published verdict is lost", measure, 10.0
)
