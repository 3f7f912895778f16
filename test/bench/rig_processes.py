"""Nodes as processes of the bench, in a ROS domain of their own, ended by their numbers."""

import contextlib
import functools
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from impact_rig.cli.up import make_words
from impact_rig.configuration.processes import NodeProcess, list_rig_processes
from impact_rig.core.given.errors import RigError
from impact_rig.recordings.source import RUN_NAME, SUFFIX
from impact_rig.testing import use_own_domain

COMMAND_LINE = "impact_rig.cli.main"
NODE = ("-P", "-m", "impact_rig.nodes")
PATIENCE = 60.0  # [s], for what is waited for: nodes have to start first
END_TIMEOUT = 5.0  # [s], for all processes together, when nothing of theirs is needed any more
STOP_TIMEOUT = 15.0  # [s], for a node to close its files and end
LOOK_PERIOD = 0.01  # [s]


class RigProcesses:
    """Processes in a ROS domain of their own, that end with the ``with`` block, whatever ends it.

    Whatever domain the environment names may be that of a real rig: a bench never goes there.

    Parameters
    ----------
    log : Path
        Where they print to.
    """

    def __init__(self, log: Path) -> None:
        self._log = log
        self._domain = contextlib.ExitStack()
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._words: dict[str, Sequence[str]] = {}  # of each process's command

    def __enter__(self) -> Self:
        """Return the processes, none so far."""
        self._domain.enter_context(use_own_domain())
        return self

    def __exit__(self, *_: object) -> None:
        """End them all at once, as Ctrl-C does; what does not end is killed.

        A node that is killed leaves the memory behind that it shared with others.
        """
        for process in self._processes.values():
            process.send_signal(signal.SIGINT)
        deadline = time.monotonic() + END_TIMEOUT
        for process in self._processes.values():
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(max(deadline - time.monotonic(), 0.0))
        self.kill(list(self._processes))
        self._domain.close()

    def start_node(self, name: str, **parameters: Any) -> subprocess.Popen[bytes]:
        """Start a node of the rig with parameters that differ from their defaults."""
        words = make_words(NodeProcess(name, parameters))
        return self.start(name, [sys.executable, *NODE, name, *words])

    def start_rig(
        self, folder: Path, overrides: Mapping[str, Mapping[str, Any]]
    ) -> dict[str, subprocess.Popen[bytes]]:
        """Start all nodes of a rig that records into `folder`; return their processes by name."""
        nodes = list_rig_processes(folder, visualize=False, overrides=overrides)
        return {node.name: self.start_node(node.name, **node.parameters) for node in nodes}

    def restart(self, name: str) -> subprocess.Popen[bytes]:
        """Start a node that has ended once more, with the same parameters."""
        return self.start(name, self._words[name])

    def start_command(self, *words: str, log: Path | None = None) -> subprocess.Popen[bytes]:
        """Start `impact-rig` with some words; it prints to the log, if there is no other."""
        command = [sys.executable, "-m", COMMAND_LINE, *words]
        return self.start(f"impact-rig {words[0]}", command, log)

    def time_command(self, *words: str) -> float:
        """Run `impact-rig` with some words; return its processor time [s]."""
        before = read_processor_time()
        if self.start_command(*words).wait():
            raise RigError(f"{words[0]} has failed: {self.read_log()}")
        return read_processor_time() - before

    def start(
        self, name: str, words: Sequence[str], log: Path | None = None
    ) -> subprocess.Popen[bytes]:
        """Start a process by its command, which `restart` knows by a name."""
        log = log or self._log
        self._words[name] = words
        with log.open("a") as said:
            # A session of their own: Ctrl-C reaches the bench alone, which then ends them.
            self._processes[name] = subprocess.Popen(
                words,
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=said,
                env={**os.environ, "PYTHONUNBUFFERED": "1"},
                start_new_session=True,
            )
        return self._processes[name]

    def wait_until(self, condition: Callable[[], bool], complaint: str) -> None:
        """Wait until something is so; raises `RigError` with complaint and log if it never is."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            if time.monotonic() > deadline:
                raise RigError(f"{complaint}: {self.read_log()}")
            time.sleep(LOOK_PERIOD)

    def kill(self, names: Sequence[str]) -> None:
        """End processes with SIGKILL: they get no chance to do anything."""
        for name in names:
            self._processes[name].kill()
        for name in names:
            self._processes[name].wait()

    def stop(self, name: str) -> None:
        """End a process as Ctrl-C does; raises `RigError` if it does not end well."""
        process = self._processes[name]
        process.send_signal(signal.SIGINT)
        try:
            code = process.wait(STOP_TIMEOUT)
        except subprocess.TimeoutExpired:
            code = None
        if code != 0:
            raise RigError(f"{name} did not end well: {self.read_log()}")

    def read_log(self) -> str:
        """Return the last line that any of them printed."""
        lines = self._log.read_text("utf-8", errors="replace").splitlines()
        return lines[-1] if lines else "nothing was printed"


@dataclass(frozen=True)
class Campaign:
    """A campaign of the virtual rig, run as a user runs it."""

    recording: Path
    began: int  # [ns since the epoch]
    seconds: float  # from the command to its end, the printed tables
    processor_time: float  # of all its processes [s]


@functools.cache
def run_campaign(folder: Path, *words: str, beside: Path | None = None) -> Campaign:
    """Run `impact-rig demo`, the paper's campaign, into a folder that does not exist.

    Parameters
    ----------
    words : str
        Further words of the command.
    beside : Path, optional
        Another checkout, set up, whose command it is.

    Raises
    ------
    RigError
        If the campaign fails, for example for want of ROS 2.
    """
    command = [sys.executable, "-m", COMMAND_LINE]
    if beside is not None:
        command = ["env", *_read_environment(beside), "impact-rig"]
    with RigProcesses(folder.with_suffix(".log")) as processes:
        began, used = time.time_ns(), read_processor_time()
        started = time.perf_counter()
        if processes.start("demo", [*command, "demo", "--output", str(folder), *words]).wait():
            raise RigError(f"no campaign to measure with could be run: {processes.read_log()}")
        seconds, used = time.perf_counter() - started, read_processor_time() - used
        return Campaign(folder / f"{RUN_NAME}{SUFFIX}", began, seconds, used)


def _read_environment(checkout: Path) -> list[str]:
    """Return the variables that a checkout's own `rig.py`, of whichever version, sets."""
    rig = [str(checkout / ".venv/bin/python3"), str(checkout / "launch_scripts/rig.py")]
    return subprocess.check_output([*rig, "exec", "--", "env", "-0"], text=True).split("\0")[:-1]


def read_processor_time() -> float:
    """Return the processor time of all processes that have ended, and theirs [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
