"""``impact-rig up``: start the nodes of a rig."""

import json
import os
import shlex
import signal
import sys
import threading
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import IO

import click
from honcho.manager import Manager
from honcho.printer import Message, Printer

from impact_rig.cli import options
from impact_rig.configuration import run as run_folder
from impact_rig.configuration.node_claim import check_free, join_names
from impact_rig.configuration.processes import (
    ACTIVE,
    LAUNCHER,
    LOG_NAME,
    RECORDING_NAME,
    NodeProcess,
    list_rig_processes,
)
from impact_rig.configuration.rig_file import (
    RigFile,
    list_rig_warnings,
    load_rig_file,
    read_template,
)
from impact_rig.core.errors import RigError
from impact_rig.devices.drivers import VIRTUAL, read_driver_name
from impact_rig.present.terminal.console import print_warning

STOPPED_BY_REQUEST = (0, 128 + signal.SIGINT, 128 + signal.SIGTERM)
"""Exit codes of a rig that was stopped on purpose."""
STANDARD_INPUT, STANDARD_ERROR = 0, 2
RETRY_PERIOD = 0.1
"""Delay before a stop during the start is tried again [s]."""


class _Manager(Manager):
    """Honcho's manager, which can be stopped while it starts its processes."""

    def terminate(self) -> None:
        # A process without a known number gets no signal.
        if self._all_started():
            super().terminate()
        else:
            retry = threading.Timer(RETRY_PERIOD, os.kill, (os.getpid(), signal.SIGTERM))
            retry.daemon = True
            retry.start()


class _DirectOutput:
    """Writes text straight to a file descriptor.

    Honcho prints from its signal handler too, and a buffered stream must not be entered twice.
    """

    def __init__(self, stream: IO[str]) -> None:
        stream.flush()
        self._descriptor = stream.fileno()
        self._is_terminal = stream.isatty()
        self._is_broken = False
        self._name = stream.name if isinstance(stream.name, str) else "standard output"

    def write(self, text: str) -> int:
        rest = text.encode(errors="replace")
        try:
            while rest:
                rest = rest[os.write(self._descriptor, rest) :]
        except OSError as error:
            # Raised, it would keep the manager from ending the nodes.
            if not self._is_broken:
                self._is_broken = True
                if isinstance(error, BrokenPipeError):  # the reader has ended
                    os.kill(os.getpid(), signal.SIGTERM)
                else:
                    lost = f"warning: the nodes' output is lost: {self._name}: {error.strerror}\n"
                    os.write(STANDARD_ERROR, lost.encode())
        return len(text)

    def flush(self) -> None:
        pass

    def isatty(self) -> bool:
        return self._is_terminal


class _Printer(Printer):
    """Honcho's printer, which also says when every node has become active."""

    def __init__(self, output: IO[str], nodes: Iterable[str], ready: str) -> None:
        direct = _DirectOutput(output)
        super().__init__(direct, colour=direct.isatty())
        self._starting = set(nodes)
        self._ready = ready

    def write(self, message: Message) -> None:
        super().write(message)
        if message.name in self._starting and ACTIVE.encode() in message.data:
            self._starting.remove(message.name)
            if not self._starting:
                super().write(message._replace(name="rig", data=self._ready))


def make_command(process: NodeProcess, namespace: str = "") -> str:
    """Return the shell command that starts one node."""
    # -P: the working folder is not on the path; it may have a numpy.py.
    words = [sys.executable, "-P", "-m", "impact_rig.nodes", process.name, "--ros-args"]
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
    ready: str,
    namespace: str = "",
    stop_with_input: bool = False,
) -> int:
    """Run nodes side by side until a signal, or until one of them ends.

    Their output goes to `output`, each line with its node's name. When all are active, the line
    `ready` follows. With `stop_with_input` the end of standard input stops them, too: the process
    at its other end may be killed.

    Returns 0 after a stop on purpose; else the exit code of the node that ended first.
    """
    processes = list(processes)
    manager = _Manager(_Printer(output, (process.name for process in processes), ready))
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", LAUNCHER: str(os.getpid())}
    for process in processes:
        manager.add_process(process.name, make_command(process, namespace), env=environment)
    if stop_with_input:
        threading.Thread(target=_stop_at_end_of_input, daemon=True).start()
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        signal.signal(signal.SIGHUP, lambda *_: os.kill(os.getpid(), signal.SIGTERM))
    try:
        manager.loop()
    except BaseException:
        # No armed hammer may stay behind.
        manager.kill()
        raise
    code = manager.returncode
    return 0 if code in STOPPED_BY_REQUEST else int(code or 1)


def _stop_at_end_of_input() -> None:
    # Not through sys.stdin, whose lock the nodes' processes would inherit while it is held.
    while os.read(STANDARD_INPUT, 1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)


def run(
    rig_file: Path | None,
    plant: str | None,
    seed: int | None,
    faults: float | None,
    continuous: bool,
    output: Path | None,
    resume: Path | None,
    record_stream: bool,
    notes: str,
    network: bool,
    namespace: str,
    visualizer: bool,
    viewer: tuple[str, ...],
    only: tuple[str, ...],
    settings: tuple[str, ...],
    template: bool,
    stop_with_input: bool,
    log_file: Path | None,
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    if template:
        click.echo(read_template(), nl=False)
        return
    rig = load_rig_file(rig_file)
    for warning in list_rig_warnings(rig.setup):
        print_warning(warning)
    overrides = run_folder.parse_settings(settings)
    source = run_folder.make_virtual_source(plant=plant, seed=seed, faults=faults)
    source |= overrides.pop(run_folder.SOURCE, {})
    folder = resume or run_folder.choose_run_folder(output)
    options.set_discovery(network=network)
    processes = list_rig_processes(
        folder.resolve(),
        rig_file=str(rig_file.resolve()) if rig_file else "",
        source=source,
        swing=rig.hammer,
        continuous=continuous,
        record_stream=record_stream,
        notes=notes,
        visualize=visualizer,
        viewers=viewer,
        overrides=overrides,
        only=only,
    )
    check_free(join_names(namespace, (process.name for process in processes)))
    is_written = any("output" in process.parameters for process in processes)
    if is_written and resume is None:
        run_folder.make_run_folder(folder)
    log = log_file.open("w", encoding="utf-8") if log_file else sys.stdout
    is_recorded = any(process.name == "recorder" for process in processes)
    recorded = folder / RECORDING_NAME if is_recorded else None
    code = run_nodes(
        processes,
        log,
        ready=describe_ready(rig, recorded, namespace=namespace, only=only),
        namespace=namespace,
        stop_with_input=stop_with_input,
    )
    if recorded and recorded.exists():
        click.echo(f"recording: {recorded}")
    if code:
        where = log_file or "above"
        raise RigError(f"a node has ended, and with it the rig: see {where} ({LOG_NAME})")


def describe_ready(
    rig: RigFile, recording: Path | None, *, namespace: str = "", only: Sequence[str] = ()
) -> str:
    """Return the line that ends the start: which rig, where it records, the next command.

    `recording` is None where nothing is recorded here; `only` names the nodes that this computer
    has started, or is empty for all.
    """
    holder, source = read_driver_name(rig.holder), read_driver_name(rig.source)
    name = "the virtual rig"
    if (holder, source) != (VIRTUAL, VIRTUAL):
        name = f"the rig (hammer: {holder}, accelerometers: {source})"
    who = f"{', '.join(only)} of {name}" if only else name
    where = f"recording to {recording}" if recording else "recording nothing here"
    option = f" --namespace {namespace}" if namespace else ""
    return f"ready: {who}, {where}; in another terminal: impact-rig campaign{option}"
