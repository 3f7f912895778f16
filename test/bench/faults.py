"""What a campaign makes of a fault in its middle: it pauses with the reason, and has every hit."""

import json
import random
import re
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from bench.measure import Bench, Figure
from bench.rig_processes import RigProcesses
from impact_rig.analysis.analyze import analyze
from impact_rig.recordings.new_file import choose_free
from impact_rig.recordings.run import Run
from impact_rig.results.results_file import results_to_json
from impact_rig.results.wire import format_json

SAMPLES = ("steel small", "brass small")
IMPACTS = 3
CAMPAIGN = ("--impacts", str(IMPACTS), *(word for name in SAMPLES for word in ("--sample", name)))
OVERRIDES = {"hammer": {"swing_time": 0.2}}
"""The fault should meet every part of a hit, and swings are most of it."""
LONGEST_WAIT = 1.5  # [s], from the campaign's first word to the fault: what six hits take
LONGEST_CAMPAIGN = 150.0  # [s]: a freeze of 30 s, and all that is waited for after it
A_RIG = 10  # campaigns on one rig, which lives through their faults one after the other
SIGNALS = {"kill -9": signal.SIGKILL, "SIGTERM": signal.SIGTERM}
"""What ends a node, which is started again then."""
FREEZES = {"frozen for 1 s": 1.0, "frozen for 5 s": 5.0, "frozen for 30 s": 30.0}  # [s]
POWER_CUT = "power cut"
"""All processes at once, `kill -9`: every third campaign. The nodes are started again."""
LOOK_PERIOD = 0.5  # [s], of looking whether a person has to arm the hammer
COMMAND = "impact-rig campaign"
NOTHING_YET = "holds no campaign that could go on"
_ARM = "then arm"
_BARE_PAUSE = re.compile(r"^paused:\s*$", re.MULTILINE)


class FaultyRig:
    """A rig one of whose nodes has a fault in every campaign.

    Parameters
    ----------
    processes : RigProcesses
        Which it is started in.
    folder : Path
        Of its recording.
    """

    def __init__(self, processes: RigProcesses, folder: Path) -> None:
        self._processes = processes
        self._folder = folder
        self._running = processes.start_rig(folder, OVERRIDES)
        self.nodes = list(self._running)

    def run(self, fault: str, node: str, wait: float) -> str:
        """Run a campaign with a fault; return what was wrong, empty: nothing."""
        output = choose_free(self._folder / "results")
        log = choose_free(self._folder / "campaign.log")
        deadline = time.monotonic() + LONGEST_CAMPAIGN
        command = self._processes.start_command(
            "campaign", *CAMPAIGN, "--output", str(output), log=log
        )
        self._processes.wait_until(
            lambda: "sample 1 of" in log.read_text() or command.poll() is not None,
            "the campaign does not begin",
        )
        time.sleep(wait)
        if fault == POWER_CUT:
            self._processes.kill([*self._running, COMMAND])
            self._running = {name: self._processes.restart(name) for name in self.nodes}
        else:
            self._inflict(fault, node)
        code = self._attend(command, log, deadline)
        if code:  # ended with a reason: the one command goes on
            command = self._processes.start_command(
                "campaign", "--resume", str(self._folder), "--output", str(output), log=log
            )
            code = self._attend(command, log, deadline)
        text = log.read_text()
        if code is None:
            self._processes.kill([COMMAND])
        if fault == POWER_CUT and NOTHING_YET in text:
            return ""  # it came before the first release, and that is said
        if code != 0:
            return f"code {code}, None is no end in time: {text.strip()[-300:]}"
        if _BARE_PAUSE.search(text):
            return "a pause without a reason"
        return self._compare(output)

    def _attend(self, command: subprocess.Popen[bytes], log: Path, deadline: float) -> int | None:
        """Arm the hammer when the campaign waits for that; return the exit code, None: no end."""
        while command.poll() is None and time.monotonic() < deadline:
            if _ARM in log.read_text().rpartition("paused:")[2]:
                self._processes.start_command("hammer", "arm").wait()
            time.sleep(LOOK_PERIOD)
        return command.poll()

    def _inflict(self, fault: str, node: str) -> None:
        process = self._running[node]
        if fault in FREEZES:
            process.send_signal(signal.SIGSTOP)
            time.sleep(FREEZES[fault])
            process.send_signal(signal.SIGCONT)
        else:
            process.send_signal(SIGNALS[fault])
            process.wait()
            self._running[node] = self._processes.restart(node)

    def _compare(self, output: Path) -> str:
        """Return what is missing or double in the results, or not in the recordings."""
        written = (output / "results.json").read_text()
        hits = json.loads(written)["hits"]
        accepted = Counter(hit["sample"] for hit in hits if hit["accepted"])
        if missing := Counter(dict.fromkeys(SAMPLES, IMPACTS)) - accepted:
            return f"missing {dict(missing)}"
        records = Counter(hit["record"] for hit in hits)
        if max(records.values()) > 1:
            return f"a record counts twice: {records}"
        analyzed = analyze(Run(self._folder)).campaigns[-1].results
        if format_json(results_to_json(analyzed)) != written:
            return "analyze does not say the same of the run"
        return ""


def measure_faults(bench: Bench) -> Iterator[Figure]:
    """Run short campaigns, and in each of them let a random node have a random fault."""
    dice = random.Random(bench.extent.seed)
    wrong: list[str] = []
    total = bench.extent.kills
    for first in range(0, total, A_RIG):
        folder = bench.folder / f"faults{first}"
        folder.mkdir()
        with RigProcesses(folder / "log.txt") as processes:
            rig = FaultyRig(processes, folder)
            for number in range(first, min(first + A_RIG, total)):
                fault, node = dice.choice([*SIGNALS, *FREEZES]), dice.choice(rig.nodes)
                if number % 3 == 2:
                    fault, node = POWER_CUT, "all"
                wait = dice.uniform(0.0, LONGEST_WAIT)
                if complaint := rig.run(fault, node, wait):
                    wrong.append(f"{number}, {node} {fault} after {wait:.2f} s: {complaint}")
    note = "; ".join([f"of {total}", *wrong])
    yield Figure("campaigns that lost, doubled or did not explain", len(wrong), note=note, most=0)
