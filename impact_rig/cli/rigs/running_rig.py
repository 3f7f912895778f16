"""A rig of one's own for the length of a command: `impact-rig up` in the background."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from impact_rig.configuration.processes import LOG_NAME
from impact_rig.core.errors import RigError

STOP_TIMEOUT = 15.0
"""How long the nodes may take to close their files and end [s]."""
LOOK_PERIOD = 0.05
"""How often the log is looked at [s]."""
SHOWN_LOG_LINES = 15
"""How much of the log is shown when the rig ends by itself."""


class RunningRig:
    """The background process that holds the nodes.

    Parameters
    ----------
    process : subprocess.Popen
        Of `impact-rig up`.
    log : Path
        What the nodes print.
    """

    def __init__(self, process: subprocess.Popen[bytes], log: Path) -> None:
        self._process = process
        self._log = log

    def check(self) -> None:
        """Raise `RigError`, with the end of the log, if the rig has ended by itself."""
        if self._process.poll() is None:
            return
        lines = self._log.read_text("utf-8", errors="replace").splitlines()[-SHOWN_LOG_LINES:]
        raise RigError("\n".join([f"the rig ended by itself; the end of {self._log}:", *lines]))

    def find_line(self, part: str, timeout: float) -> str:
        """Wait for a text in the log; return it and the rest of its line, or that it never came.

        Parameters
        ----------
        part : str
            Of the log.
        timeout : float
            [s]
        """
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            self.check()
            _, found, rest = self._log.read_text("utf-8", errors="replace").partition(part)
            line, ended, _ = rest.partition("\n")
            if found and ended:
                return part + line
            time.sleep(LOOK_PERIOD)
        return f"{part}: see {self._log}"


@contextlib.contextmanager
def run_rig(folder: Path, arguments: Sequence[str]) -> Iterator[RunningRig]:
    """Start a rig, and stop it at the end of the ``with`` block, whatever ends it.

    Parameters
    ----------
    folder : Path
        Of the run.
    arguments : sequence of str
        For `impact-rig up`, the folder apart.
    """
    log = folder / LOG_NAME
    # A session of its own: Ctrl-C reaches this process alone, which then stops the rig. Its
    # standard input ends when this process does, however it ends.
    process = subprocess.Popen(
        [
            sys.executable, "-m", "impact_rig.cli.main", "up", "--output", str(folder),
            "--stop-with-input", "--log-file", str(log), *arguments,
        ],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip
    try:
        yield RunningRig(process, log)
    finally:
        previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
        process.terminate()
        try:
            process.wait(STOP_TIMEOUT)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        signal.signal(signal.SIGINT, previous)


@contextlib.contextmanager
def use_private_domain() -> Iterator[None]:
    """Take an unused ROS domain for the length of the block, unless the environment names one.

    A demonstration must never reach the hammer of a rig that is up on the same network.
    """
    if "ROS_DOMAIN_ID" in os.environ:
        yield
        return
    from impact_rig.nodes.domain import reserve_domain

    with reserve_domain() as number:
        os.environ["ROS_DOMAIN_ID"] = str(number)
        try:
            yield
        finally:
            del os.environ["ROS_DOMAIN_ID"]
