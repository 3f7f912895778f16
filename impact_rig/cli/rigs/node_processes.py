"""The rig's nodes as processes of this host, started and stopped by honcho."""

import json
import os
import shlex
import signal
import sys
import threading
from collections.abc import Iterable
from typing import IO

from honcho.manager import Manager
from honcho.printer import Printer

from impact_rig.configuration.processes import NodeProcess

STOPPED_BY_REQUEST = (0, 128 + signal.SIGINT, 128 + signal.SIGTERM)
"""Exit codes of a rig that was told to stop."""
STANDARD_INPUT = 0
RETRY_PERIOD = 0.1
"""How soon a stop is tried again that came while the processes were still starting [s]."""


class _Manager(Manager):
    """Honcho's manager, which may also be stopped while it still starts its processes."""

    def terminate(self) -> None:
        # A process that has not reported its number yet cannot be signalled.
        if self._all_started():
            super().terminate()
        else:
            retry = threading.Timer(RETRY_PERIOD, os.kill, (os.getpid(), signal.SIGTERM))
            retry.daemon = True
            retry.start()


class _DirectOutput:
    """Text straight to a file descriptor.

    Honcho prints from its signal handler too, and a buffered stream breaks when it is entered
    again in the middle of a line.
    """

    def __init__(self, stream: IO[str]) -> None:
        stream.flush()
        self._descriptor = stream.fileno()
        self._is_terminal = stream.isatty()

    def write(self, text: str) -> int:
        rest = text.encode(errors="replace")
        while rest:
            rest = rest[os.write(self._descriptor, rest) :]
        return len(text)

    def flush(self) -> None:
        pass

    def isatty(self) -> bool:
        return self._is_terminal


def make_command(process: NodeProcess, namespace: str = "") -> str:
    """Return the shell command that starts one node."""
    words = [sys.executable, "-m", f"impact_rig.nodes.{process.name}", "--ros-args"]
    words += ["-r", f"__node:={process.name}"]
    if namespace:
        words += ["-r", f"__ns:=/{namespace.strip('/')}"]
    for name, value in process.parameters.items():
        # JSON is YAML: texts are quoted, true and false are lower case.
        words += ["-p", f"{name}:={json.dumps(value)}"]
    return "exec " + shlex.join(words)


def run_nodes(
    processes: Iterable[NodeProcess],
    output: IO[str],
    *,
    namespace: str = "",
    stop_with_input: bool = False,
) -> int:
    """Run nodes side by side until told to stop, or until one of them ends.

    Parameters
    ----------
    processes : iterable of NodeProcess
        What to start.
    output : text file
        Where their output goes, each line with its node's name.
    namespace : str
        Of the rig.
    stop_with_input : bool
        Stop when standard input ends: whoever holds the other end may die without a word.

    Returns
    -------
    int
        0 after a stop that was asked for; else the exit code of the node that ended first.
    """
    manager = _Manager(Printer(_DirectOutput(output), colour=output.isatty()))
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    for process in processes:
        manager.add_process(process.name, make_command(process, namespace), env=environment)
    if stop_with_input:
        threading.Thread(target=_stop_at_end_of_input, daemon=True).start()
    try:
        manager.loop()
    except BaseException:
        # Whatever stopped the manager must not leave a hammer armed behind.
        manager.kill()
        raise
    code = manager.returncode
    return 0 if code in STOPPED_BY_REQUEST else int(code or 1)


def _stop_at_end_of_input() -> None:
    # Not through sys.stdin, whose lock the nodes' processes would inherit while it is held.
    while os.read(STANDARD_INPUT, 1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)
