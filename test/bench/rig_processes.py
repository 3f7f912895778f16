"""Nodes as processes of the bench, in a ROS domain of their own, ended by their numbers."""

import contextlib
import json
import os
import queue
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from impact_rig.cli.up import make_command
from impact_rig.configuration.processes import NodeProcess, list_rig_processes
from impact_rig.core.errors import RigError

COMMAND_LINE = "impact_rig.cli.main"
OUTSIDE = "bench.outside"
END_TIMEOUT = 5.0
"""How long all of them together may take to end when nothing of theirs is needed any more [s]."""
PATIENCE = 60.0
"""How long a process may take to say what is waited for [s]: nodes have to start first."""
STOP_TIMEOUT = 15.0
"""How long a node may take to close its files and end [s]."""


@contextlib.contextmanager
def use_own_domain() -> Iterator[dict[str, str]]:
    """Lend an environment in which ROS reaches nobody outside of the bench.

    Whatever domain the environment names may be that of a real rig: a bench never goes there.
    """
    from impact_rig.nodes.discovery import reserve_domain

    with reserve_domain() as number:
        yield {
            **os.environ,
            "ROS_DOMAIN_ID": str(number),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "PYTHONUNBUFFERED": "1",
        }


def listen(process: subprocess.Popen[str]) -> "queue.Queue[str]":
    """Return the JSON that a process prints line by line, and an empty text at its end."""
    lines: queue.Queue[str] = queue.Queue()

    def pass_on() -> None:
        if process.stdout is not None:
            for line in process.stdout:
                # Fast DDS has something to say there now and then.
                if line.startswith("{"):
                    lines.put(line)
        lines.put("")

    threading.Thread(target=pass_on, daemon=True).start()
    return lines


class Said:
    """What a process prints, as lines of JSON.

    Parameters
    ----------
    process : Popen
        Which prints to a pipe.
    read_log : callable
        Returns what is known of it if it prints nothing more.

    Attributes
    ----------
    process : Popen
        As given.
    """

    def __init__(self, process: subprocess.Popen[str], read_log: Callable[[], str]) -> None:
        self.process = process
        self._lines = listen(process)
        self._read_log = read_log

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Return what else it prints, until it ends."""
        return map(json.loads, iter(self._lines.get, ""))

    def wait_for(
        self,
        complaint: str,
        is_wanted: Callable[[dict[str, Any]], bool] = lambda _: True,
        patience: float = PATIENCE,
    ) -> dict[str, Any]:
        """Return the next line that is wanted, within `patience` seconds.

        Raises
        ------
        RigError
            If none comes: the complaint, and the log.
        """
        deadline = time.monotonic() + patience
        while True:
            try:
                line = self._lines.get(timeout=max(deadline - time.monotonic(), 0.0))
            except queue.Empty:
                line = ""
            if not line:
                raise RigError(f"{complaint}: {self._read_log()}")
            said: dict[str, Any] = json.loads(line)
            if is_wanted(said):
                return said


class RigProcesses:
    """Processes that end with the ``with`` block, whatever ends it.

    Parameters
    ----------
    environment : mapping
        Theirs.
    log : Path
        Where they print to.
    """

    def __init__(self, environment: Mapping[str, str], log: Path) -> None:
        self._environment = environment
        self._log = log
        self._processes: dict[str, subprocess.Popen[str]] = {}

    def __enter__(self) -> Self:
        """Return the processes, none so far."""
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
        for process in self._processes.values():
            if process.stdout is not None:
                process.stdout.close()

    def start_node(self, name: str, **parameters: Any) -> subprocess.Popen[str]:
        """Start a node of the rig with parameters that differ from their defaults."""
        _, *words = shlex.split(make_command(NodeProcess(name, parameters)))
        return self._start(name, words)

    def start_outside(self, role: str, *arguments: str) -> Said:
        """Start a process of `bench.outside`, and return what it tells."""
        words = [sys.executable, "-m", OUTSIDE, role, *arguments]
        return Said(self._start(f"outside {role}", words, listen=True), self.read_log)

    def start_command(self, *words: str, log: Path | None = None) -> subprocess.Popen[str]:
        """Start `impact-rig` with some words; it prints to the log, if there is no other."""
        return self._start(COMMAND_LINE, [sys.executable, "-m", COMMAND_LINE, *words], log=log)

    def _start(
        self, name: str, words: Sequence[str], *, listen: bool = False, log: Path | None = None
    ) -> subprocess.Popen[str]:
        with (log or self._log).open("a") as said:
            # A session of their own: Ctrl-C reaches the bench alone, which then ends them.
            self._processes[name] = subprocess.Popen(
                words,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE if listen else said,
                stderr=said,
                env=self._environment,
                text=True,
                start_new_session=True,
            )
        return self._processes[name]

    def kill(self, names: Sequence[str]) -> None:
        """End processes with SIGKILL: they get no chance to do anything."""
        for name in names:
            self._processes[name].kill()
        for name in names:
            self._processes[name].wait()

    def stop(self, name: str) -> int:
        """Let a process end as Ctrl-C does, and return its exit code."""
        process = self._processes[name]
        process.send_signal(signal.SIGINT)
        try:
            return process.wait(STOP_TIMEOUT)
        except subprocess.TimeoutExpired:
            process.kill()
            return process.wait()

    def start_rig(
        self, folder: Path, overrides: Mapping[str, Mapping[str, Any]], *, visualize: bool
    ) -> dict[str, subprocess.Popen[str]]:
        """Start all nodes of a rig that records into `folder`; return their processes by name."""
        nodes = list_rig_processes(folder, visualize=visualize, overrides=overrides)
        return {node.name: self.start_node(node.name, **node.parameters) for node in nodes}

    def read_log(self) -> str:
        """Return the last line that any of them printed."""
        lines = self._log.read_text("utf-8", errors="replace").splitlines()
        return lines[-1] if lines else "they said nothing"
