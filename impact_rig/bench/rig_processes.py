"""Nodes as processes of the bench, in a ROS domain of their own, ended by their numbers."""

import contextlib
import os
import queue
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from impact_rig.cli.rigs.node_processes import make_command
from impact_rig.configuration.processes import NodeProcess, list_rig_processes

COMMAND_LINE = "impact_rig.cli.main"
OBSERVER = "impact_rig.bench.observer_process"
END_TIMEOUT = 5.0
"""How long all of them together may take to end when nothing of theirs is needed any more [s]."""
STOP_TIMEOUT = 15.0
"""How long a node may take to close its files and end [s]."""


@contextlib.contextmanager
def use_own_domain() -> Iterator[dict[str, str]]:
    """Lend an environment in which ROS reaches nobody outside of the bench.

    Whatever domain the environment names may be that of a real rig: a bench never goes there.
    """
    from impact_rig.nodes.domain import reserve_domain

    with reserve_domain() as number:
        yield {
            **os.environ,
            "ROS_DOMAIN_ID": str(number),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "PYTHONUNBUFFERED": "1",
        }


def listen(process: subprocess.Popen[str]) -> "queue.Queue[str]":
    """Return the lines that a process prints as they come, and an empty text at its end."""
    lines: queue.Queue[str] = queue.Queue()

    def pass_on() -> None:
        if process.stdout is not None:
            for line in process.stdout:
                lines.put(line)
        lines.put("")

    threading.Thread(target=pass_on, daemon=True).start()
    return lines


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
        self._environment = dict(environment)
        self._log = log
        self._processes: dict[str, subprocess.Popen[str]] = {}

    def __enter__(self) -> Self:
        """Return the processes, none so far."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
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

    def start_module(
        self, name: str, arguments: Sequence[str] = (), *, listen: bool = False
    ) -> subprocess.Popen[str]:
        """Start a module of this package; what it prints can be read if we `listen`."""
        return self._start(name, [sys.executable, "-m", name, *arguments], listen=listen)

    def _start(
        self, name: str, words: Sequence[str], *, listen: bool = False
    ) -> subprocess.Popen[str]:
        with self._log.open("a") as log:
            # A session of their own: Ctrl-C reaches the bench alone, which then ends them.
            self._processes[name] = subprocess.Popen(
                words,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE if listen else log,
                stderr=log,
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

    def start_campaign(self, *options: str) -> subprocess.Popen[str]:
        """Start a campaign on the rig, by the command line, which gives up if the rig does."""
        return self.start_module(COMMAND_LINE, ["campaign", "--json", *options])

    def start_observer(self) -> tuple[str, "queue.Queue[str]"]:
        """Start who sees the verdicts; return its name, and the lines of JSON that it prints."""
        return OBSERVER, listen(self.start_module(OBSERVER, listen=True))

    def read_log(self) -> str:
        """Return the last line that any of them printed."""
        lines = self._log.read_text("utf-8", errors="replace").splitlines()
        return lines[-1] if lines else "they said nothing"
