"""Nodes as processes, which start and end together."""

import contextlib
import itertools
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from queue import SimpleQueue
from typing import IO

import click

from impact_rig.configuration.processes import ACTIVE, LAUNCHER, NodeProcess
from impact_rig.present.terminal.console import print_warning

END_TIMEOUT = 10.0
"""Time limit for a node to end after SIGTERM [s]; then it is killed."""
COLOURS = ("cyan", "yellow", "green", "magenta", "red", "blue", "bright_cyan")
"""Of the nodes' names at a terminal."""


def make_command(process: NodeProcess, namespace: str = "") -> list[str]:
    """Return the command that starts one node."""
    # -P: the working folder is not on the path; it may have a numpy.py.
    words = [sys.executable, "-P", "-m", "impact_rig.nodes", process.name, "--ros-args"]
    words += ["-r", f"__node:={process.name}"]
    if namespace:
        words += ["-r", f"__ns:=/{namespace.strip('/')}"]
    for name, value in process.parameters.items():
        # JSON is YAML: texts are quoted, true and false are lower case.
        words += ["-p", f"{name}:={json.dumps(value)}"]
    return words


class RunningNodes:
    """Nodes as processes that start and end together; one thread prints all their output.

    Parameters
    ----------
    output : IO of str
        Gets each line of a node, with time and node in front.
    on_line : callable, optional
        Gets each line, too.
    """

    def __init__(self, output: IO[str], on_line: Callable[[str], None] = lambda _: None) -> None:
        self._output = output
        self._on_line = on_line
        self._nodes: dict[str, subprocess.Popen[bytes]] = {}  # those that have not ended
        self._colours: dict[str, str] = {}
        # A node's name with a line, or with b"" at its end; without a name: a request to stop.
        self._events: SimpleQueue[tuple[str, bytes]] = SimpleQueue()

    def stop(self, *_: object) -> None:
        """Let `run` end all nodes; from any thread or signal handler."""
        self._events.put(("", b""))

    def run(
        self,
        processes: Sequence[NodeProcess],
        namespace: str = "",
        ready: str = "all nodes are active",
    ) -> int:
        """Run nodes until `stop` is called, or one of them ends; say `ready` when all are active.

        Returns 0 after `stop`; else the exit code of the node that ended first.
        """
        starting = {process.name for process in processes}
        self._colours = dict(zip(sorted(starting), COLOURS, strict=False))
        code: int | None = None  # None: nothing has ended yet
        killer = threading.Timer(END_TIMEOUT, self._send, (signal.SIGKILL,))
        try:
            for process in processes:
                self._start(process.name, make_command(process, namespace))
            while self._nodes:
                name, line = self._events.get()
                if line:
                    text = line.decode(errors="replace").rstrip("\n")
                    self._print(name, text)
                    self._on_line(text)
                    if name in starting and ACTIVE in text:
                        starting.remove(name)
                        if not starting:
                            self._print("rig", ready)
                    continue
                ended = self._nodes.pop(name).wait() if name else 0
                if code is None:
                    code = ended
                    self._send(signal.SIGTERM)
                    killer.start()
        finally:
            killer.cancel()
            # No armed hammer may stay behind.
            self._send(signal.SIGKILL)
        return code or 0

    def _start(self, name: str, command: Sequence[str]) -> None:
        # In new sessions: Ctrl-C reaches this process alone, which stops them.
        node = self._nodes[name] = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env={**os.environ, "PYTHONUNBUFFERED": "1", LAUNCHER: str(os.getpid())},
            start_new_session=True,
        )
        self._print("rig", f"{name} started (pid={node.pid})")

        def follow() -> None:
            for line in itertools.chain(node.stdout or (), [b""]):
                self._events.put((name, line))

        threading.Thread(target=follow, daemon=True).start()

    def _send(self, number: int) -> None:
        for node in list(self._nodes.values()):
            with contextlib.suppress(ProcessLookupError):
                os.killpg(node.pid, number)

    def _print(self, name: str, text: str) -> None:
        prefix = f"{time.strftime('%H:%M:%S')} {name:{max(map(len, self._colours))}} | "
        try:
            click.echo(click.style(prefix, self._colours.get(name)) + text, self._output)
        except OSError as error:
            # The nodes run on, and what follows goes nowhere: this error comes once.
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._output.fileno())
            if isinstance(error, BrokenPipeError):  # the reader has ended
                self.stop()
            else:
                where = error.filename or self._output.name
                print_warning(f"the nodes' output is lost: {where}: {error.strerror}")
