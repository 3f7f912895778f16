"""``impact-rig up``: start the nodes of a rig, which run and end together."""

import contextlib
import io
import json
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from queue import SimpleQueue
from typing import IO, Any

import click

from impact_rig.cli import options
from impact_rig.configuration.node_claim import check_free, join_names
from impact_rig.configuration.processes import (
    LAUNCHER,
    LOG_NAME,
    MEASURING,
    NOTICES,
    RECORDING_NAME,
    SOURCE,
    NodeProcess,
    Notice,
    choose_run_folder,
    list_rig_processes,
    make_run_folder,
    parse_parameters,
    read_notice,
)
from impact_rig.configuration.rig_file import RigFile, read_template
from impact_rig.core.given.errors import RigError
from impact_rig.devices.drivers import read_driver_name
from impact_rig.present.console import print_warning

OPEN_FILES = 100  # that a process of a rig may need: three times what they were seen to have
END_TIMEOUT = 10.0  # [s] in which a node ends after SIGTERM; then it is killed
RIG = "rig"  # who says what no node does
PAGE_NODE = "page"
COLOURS = ("cyan", "yellow", "green", "magenta", "red", "blue", "bright_cyan", "white")


def make_words(process: NodeProcess, namespace: str = "") -> list[str]:
    """Return the words that ROS gets of one node."""
    words = ["--ros-args", "-r", f"__node:={process.name}"]
    if namespace:
        words += ["-r", f"__ns:=/{namespace.strip('/')}"]
    for name, value in process.parameters.items():
        # JSON is YAML: texts are quoted, true and false are lower case.
        words += ["-p", f"{name}:={json.dumps(value)}"]
    return words


def check_computer() -> None:
    """Check once what each node needs.

    Raises
    ------
    ModuleNotFoundError
        If ROS 2 or the rig's messages are not installed.
    RigError
        If this process, or a node, may not open as many files as a rig needs.
    """
    for name in ("rclpy", "impact_rig_msgs"):
        if find_spec(name) is None:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    allowed, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    if most != resource.RLIM_INFINITY and most < OPEN_FILES:
        raise RigError(
            f"at most {most} files may be open here, and a rig needs {OPEN_FILES}: raise the"
            " limit, as by `ulimit -n 1024`"
        )
    if allowed != resource.RLIM_INFINITY:
        resource.setrlimit(resource.RLIMIT_NOFILE, (max(allowed, OPEN_FILES), most))


class RunningNodes:
    """Nodes as processes that start and end together; one thread prints all their output.

    Parameters
    ----------
    outputs : IO of str
        Get each line of a node, with time and node in front.
    on_page : callable, optional
        Gets the name of a node that serves a web page, and its address.
    """

    def __init__(
        self, *outputs: IO[str], on_page: Callable[[str, str], None] = lambda *_: None
    ) -> None:
        check_computer()
        self._outputs = outputs
        self._on_page = on_page
        self.is_ending = False  # since one of them has ended
        self._names: set[str] = set()  # of nodes that have not ended
        self._numbers: dict[str, int] = {}  # of their processes
        self._group = 0  # of all these, and of the one that forked them; 0: there is none
        self._colours: dict[str, str] = {}
        # A node's name with a line, or with its exit code; without a name: a request to stop.
        self._events: SimpleQueue[tuple[str, bytes | int]] = SimpleQueue()

    def stop(self, *_: object) -> None:
        """Let `run` end all nodes; from any thread or signal handler."""
        self._events.put(("", 0))

    def stop_by_signals(self) -> None:
        """Let Ctrl-C, SIGTERM and a closed terminal end the nodes."""
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self.stop)

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
        self._names = {*starting}
        self._colours = dict(zip(sorted(starting), COLOURS, strict=False))
        code: int | None = None  # None: nothing has ended yet
        killer = threading.Timer(END_TIMEOUT, self._kill)
        try:
            self._start({process.name: make_words(process, namespace) for process in processes})
            while self._names:
                name, said = self._events.get()
                if isinstance(said, bytes):
                    if self._is_active_by(name, said) and name in starting:
                        starting.remove(name)
                        if not starting:
                            self._print(RIG, ready)
                    continue
                self._names.discard(name)
                is_served = name != PAGE_NODE or name not in starting
                if code is None and is_served and self._goes_on_without(name):
                    self._print(RIG, f"{name} has ended ({said}): the rig goes on without it")
                    if starting == {name}:
                        self._print(RIG, ready)
                    starting.discard(name)
                elif code is None:
                    code = said
                    if name:
                        self._print(RIG, f"{name} has ended ({said}): the rig ends")
                        self.is_ending = True
                    self._send(signal.SIGTERM)
                    killer.start()
        finally:
            killer.cancel()
            # No armed hammer may stay behind.
            self._send(signal.SIGKILL)
        return code or 0

    def _start(self, words: Mapping[str, Sequence[str]]) -> None:
        """Start the process that forks the nodes, and follow what all of them print."""
        pipes = {name: os.pipe() for name in words}
        job = {name: (pipes[name][1], words[name]) for name in words}
        # -P: the working folder is not on the path; it may have a numpy.py.
        command = [sys.executable, "-P", "-m", "impact_rig.nodes.together", json.dumps(job)]
        try:
            forking = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env={
                    **os.environ,
                    "PYTHONUNBUFFERED": "1",
                    LAUNCHER: str(os.getpid()),
                    NOTICES: "1",
                },
                pass_fds=[output for output, _ in job.values()],
                start_new_session=True,  # Ctrl-C reaches this process alone, which stops them
            )
        except OSError as error:
            raise RigError(f"the nodes cannot be started: {error.strerror}") from None
        self._group = forking.pid
        codes: dict[str, SimpleQueue[int]] = {name: SimpleQueue() for name in words}

        def follow(name: str, reader: int) -> None:
            with open(reader, "rb") as lines:
                for line in lines:
                    self._events.put((name, line))
            self._events.put((name, codes[name].get()))

        def watch() -> None:
            for line in forking.stdout or ():
                notice, value = read_notice(line.decode()) or (None, "")
                name, _, number = value.partition(" ")
                if notice is Notice.ENDED:
                    del self._numbers[name]
                    codes[name].put(int(number))
                    continue
                if notice is Notice.STARTED:
                    self._numbers[name] = int(number)
                told = f"{name} started (pid={int(number)})".encode() if notice else line
                self._events.put((RIG, told))
            # It has ended last, or was killed.
            for queue in codes.values():
                queue.put(-signal.SIGKILL)
            self._events.put((RIG, forking.wait()))

        threading.Thread(target=watch, daemon=True).start()
        for name, (reader, writer) in pipes.items():
            os.close(writer)
            threading.Thread(target=follow, args=(name, reader), daemon=True).start()

    def _is_active_by(self, name: str, line: bytes) -> bool:
        """Print a line, or take the notice in it; return whether it says that a node is active."""
        text = line.decode(errors="replace").rstrip("\n")
        found = read_notice(text)
        if found is None:
            self._print(name, text)
        elif found[0] is Notice.PAGE:
            self._on_page(name, found[1])
        return found is not None and found[0] is Notice.ACTIVE

    def _goes_on_without(self, name: str) -> bool:
        """Return whether a node that has ended ends no rig, and others are left."""
        return name not in (*MEASURING, RIG, "") and bool(self._names)

    def _send(self, number: int) -> None:
        if self._group:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._group, number)

    def _kill(self) -> None:
        """Kill the nodes; the process that forked them goes on, and tells their ends."""
        for number in list(self._numbers.values()):
            with contextlib.suppress(ProcessLookupError):
                os.kill(number, signal.SIGKILL)

    def _print(self, name: str, text: str) -> None:
        prefix = f"{time.strftime('%H:%M:%S')} {name:{max(map(len, self._colours))}} | "
        for output in self._outputs:
            try:
                click.echo(click.style(prefix, self._colours.get(name)) + text, output)
            except OSError as error:
                # The nodes run on, and what follows goes nowhere: this error comes once.
                os.dup2(os.open(os.devnull, os.O_WRONLY), output.fileno())
                print_warning(f"the nodes' output is lost: {error.strerror}")


def show_page(node: str, links: str, *, err: bool = False) -> None:
    """Say where a page is, to the person at the terminal alone: its link may have a token."""
    first, *others = links.split(" ")
    name = "page" if node == PAGE_NODE else "view"
    click.echo(f"the {name} is at {' or '.join((first, *others))}", err=err)
    if "?" in first and find_spec("segno"):
        import segno

        drawn = io.StringIO()
        segno.make(first, error="l").terminal(drawn, compact=True)
        click.echo(drawn.getvalue(), err=err)


def run(
    rig_file: Path | None,
    output: Path | None,
    resume: Path | None,
    network: bool,
    namespace: str,
    only: tuple[str, ...],
    settings: tuple[str, ...],
    template: bool,
    **chosen: Any,
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    if template:
        click.echo(read_template(), nl=False)
        return
    overrides = parse_parameters(settings)
    source = {**{key: chosen.pop(key) for key in options.SOURCE_KEYS}, **overrides.pop(SOURCE, {})}
    if resume is None:
        rig = options.load_rig(rig_file)
    else:
        from impact_rig.analysis.resuming import find_rig_of_run

        found = find_rig_of_run(resume, rig_file, source)
        rig, source = options.load_rig(found.rig.path), {**found.source}
        chosen["continuous"] |= found.is_continuous
    check_computer()
    folder = resume or choose_run_folder(output)
    options.set_discovery(network=network)
    processes = list_rig_processes(
        folder.resolve(), rig=rig, source=source, overrides=overrides, only=only, **chosen
    )
    names = {process.name for process in processes}
    check_free(join_names(namespace, names))
    log = Path(os.devnull)
    if names & {"recorder", "visualizer"}:
        log = folder / LOG_NAME
        if resume is None:
            make_run_folder(folder)
    # A run that goes on has several recordings.
    recorded = resume or folder / RECORDING_NAME if "recorder" in names else None
    with log.open("a", encoding="utf-8") as written:
        nodes = RunningNodes(sys.stdout, written, on_page=show_page)
        nodes.stop_by_signals()
        code = nodes.run(processes, namespace, describe_ready(rig, recorded, namespace))
    if recorded and recorded.exists():
        click.echo(f"recording: {recorded}")
    if code:
        raise RigError("a node has ended, so the rig has stopped: see above")


def describe_ready(rig: RigFile, recording: Path | None, namespace: str = "") -> str:
    """Return the line that ends the start: which rig, where it records, the next command.

    `recording` is None where nothing is recorded here.
    """
    holder, source = read_driver_name(rig.holder), read_driver_name(rig.source)
    where = f"recording to {recording}" if recording else "recording nothing here"
    option = f" --namespace {namespace}" if namespace else ""
    return (
        f"ready: hammer {holder}, accelerometers {source}, {where};"
        f" in another terminal: impact-rig campaign{option}"
    )
