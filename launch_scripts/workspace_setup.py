"""Sets the workspace up: Python environment, ROS 2 wheels, libraries, and both packages."""

import contextlib
import fcntl
import importlib.util
import os
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn, TypeAlias

from workspace import (
    LIBRARIES,
    MESSAGES,
    NODES,
    SetupError,
    Workspace,
    find_stale,
    format_environment,
    make_environment,
)

SHOWN_LINES = 20
"""Last lines of the log that are shown when a step fails: our choice."""
GRACE = 10.0
"""Time an interrupted tool has to end by itself [s]: our choice."""
PERIOD = 10.0
"""Time between two lines of progress where they are not shown on a terminal [s]: our choice."""
LOG_TAIL = 1000  # [byte], more than its last line
SHOWN_LETTERS = 40  # of that line

Command: TypeAlias = list[str | Path]

WHEEL_BUILDER_PATH = re.compile(
    r"/opt/python/cp\d+-cp\d+/"
    r"(?:include/python[\d.]+|lib/python[\d.]+/site-packages/(?P<numpy>numpy/_core/include))"
)
"""Paths of the machine that built the ROS wheels, left in their CMake files."""


def set_up(workspace: Workspace) -> None:
    """Run the steps that are out of date, one process at a time, and stamp each when done.

    Raises
    ------
    SetupError
        If a step fails or something it needs is missing.
    KeyboardInterrupt
        If Ctrl-C or a signal ended it; the next call goes on with the step that was running.
    """
    steps = {
        "python": ("Python environment", _make_python_environment),
        "packages": ("ROS 2 Jazzy, libraries, tools", _install_packages),
        "messages": (f"messages ({MESSAGES})", _build_messages),
        "nodes": (f"nodes ({NODES})", _build_nodes),
    }
    log = workspace.root / "log" / "setup.log"
    with _hold_lock(workspace) as lock, _interruptible():
        stale = find_stale(workspace)
        if not stale:
            return
        _check_machine(workspace, stale)
        log.parent.mkdir(exist_ok=True)
        log.write_text("")
        print(f"setting up {workspace.root}", file=sys.stderr)
        for number, name in enumerate(stale, start=1):
            step = workspace.steps[name]
            step.stamp.unlink(missing_ok=True)
            title, run_step = steps[name]
            runner = _Runner(title, f"{number}/{len(stale)}", log, lock)
            run_step(workspace, runner)
            step.stamp.write_text(step.fingerprint, "ascii")
            runner.finish()


class _Runner:
    """Runs the commands of one step: their output in the log, time and progress on the screen."""

    def __init__(
        self, title: str, position: str, log: Path, lock: int, period: float = PERIOD
    ) -> None:
        self._title = title
        self._label = f"  {position} {title:<34}"
        self._log = log
        self._lock = lock
        self._period = period  # [s] between two lines of progress, but on a terminal
        self._is_terminal = sys.stderr.isatty()
        self._start = self._shown = time.monotonic()
        self._show_progress()

    def run(self, command: Command, environment: dict[str, str], folder: Path) -> None:
        """Run a command; raise `SetupError` with the last lines of its output if it fails."""
        code = self.try_to_run(command, environment, folder)
        if code:
            lines = self._log.read_text("utf-8", errors="replace").splitlines()[-SHOWN_LINES:]
            print("\n" + "\n".join(f"    {line}" for line in lines), file=sys.stderr)
            raise SetupError(
                f"{self._title}: failed (`{Path(command[0]).name}` ended with code {code}): the"
                f" whole output is in {self._log}."
            )

    def try_to_run(self, command: Command, environment: dict[str, str], folder: Path) -> int:
        """Run a command; return its exit code."""
        with self._log.open("ab") as output:
            output.write(f"$ {' '.join(map(str, command))}\n".encode())
            output.flush()
            process = subprocess.Popen(
                command,
                env=environment,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                pass_fds=[self._lock],  # the lock is held as long as the command lives
            )
        try:
            while process.poll() is None:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(timeout=0.5)
                self._show_progress()
        except KeyboardInterrupt:
            _end_group(process)
            raise
        return process.returncode

    def finish(self) -> None:
        """Show the time the step took."""
        self._show("\n")

    def _show_progress(self) -> None:
        """Show the time, and what the tool said last: ``[12/157] Building …``."""
        if not self._is_terminal and time.monotonic() < self._shown + self._period:
            return
        with self._log.open("rb") as log:
            log.seek(max(self._log.stat().st_size - LOG_TAIL, 0))
            said = log.read().decode("utf-8", errors="replace").split("\n")
        last = next((line.strip() for line in reversed(said) if line.strip()), "")
        self._show("" if self._is_terminal else "\n", last[:SHOWN_LETTERS])

    def _show(self, end: str, said: str = "") -> None:
        self._shown = time.monotonic()
        line = f"{self._label} {self._shown - self._start:6.1f} s  {said}"
        if self._is_terminal:
            line = f"\r{line}\x1b[K"  # to the end of the line: what was longer before
        print(line.rstrip(), end=end, file=sys.stderr, flush=True)


def _make_python_environment(workspace: Workspace, runner: _Runner) -> None:
    command: Command = [sys.executable, "-m", "venv", "--clear"]
    if workspace.is_ros_installed:
        command.append("--system-site-packages")
    environment = dict(os.environ)
    base_python = Path(
        sys.base_prefix, "bin", f"python{sys.version_info[0]}.{sys.version_info[1]}"
    )
    if base_python.exists():  # not the .venv's own, which is about to be emptied
        command[0] = base_python
    runner.run([*command, workspace.venv], environment, workspace.root)
    pip = _choose_pip(workspace, workspace.get_requirements("installer"))
    runner.run(pip, environment, workspace.root)


def _install_packages(workspace: Workspace, runner: _Runner) -> None:
    """Install by uv, which takes seconds; where uv fails, by pip, which has other settings."""
    files = [*workspace.get_requirements(*LIBRARIES), *workspace.build_requirements]
    uv: Command = [workspace.venv / "bin" / "uv", "pip", "install", "--python", workspace.python]
    # All of them: an interrupted call may have left parts of one. That downloads all of them
    # again, so that a cache would only grow, by 1.5 GB each time.
    uv += ["--reinstall", "--no-cache", "--no-deps", "--require-hashes", *_name_files(files)]
    environment = {"UV_HTTP_TIMEOUT": "60", **os.environ}
    if runner.try_to_run(uv, environment, workspace.root):
        pip = _choose_pip(workspace, files)
        runner.run([*pip, "--force-reinstall"], dict(os.environ), workspace.root)
    if not workspace.is_ros_installed:
        _mend_wheels(workspace)


def _choose_pip(workspace: Workspace, files: list[Path]) -> Command:
    """Return the command by which pip installs what these files name, and nothing else."""
    command: Command = [workspace.python, "-m", "pip", "install", "--no-deps", "--require-hashes"]
    command += ["--no-input", "--disable-pip-version-check", "--progress-bar", "off"]
    return [*command, *_name_files(files)]


def _name_files(files: list[Path]) -> Command:
    return [word for path in files for word in ("--requirement", path)]


def _mend_wheels(workspace: Workspace) -> None:
    """Replace the paths of the machine that built the wheels by this machine's."""
    python_headers = sysconfig.get_path("include")

    def localize(match: re.Match[str]) -> str:
        return str(workspace.site_packages / match["numpy"]) if match["numpy"] else python_headers

    for path in (workspace.venv / "share").rglob("*.cmake"):
        text = path.read_text("utf-8")
        mended = WHEEL_BUILDER_PATH.sub(localize, text)
        if mended != text:
            path.write_text(mended, "utf-8")


def _build_messages(workspace: Workspace, runner: _Runner) -> None:
    shutil.rmtree(workspace.get_prefix(MESSAGES), ignore_errors=True)
    has_ninja = shutil.which("ninja", path=make_environment(workspace, os.environ)["PATH"])
    options = ["--cmake-args", "-DBUILD_TESTING=OFF", *(["-GNinja"] if has_ninja else [])]
    options.append(f"-DPython3_EXECUTABLE={workspace.python}")
    if not workspace.is_ros_installed:
        options.append("-DONLY_PYTHON=ON")
    # Elsewhere: CMake reads paths of messages as ASCII, and this folder's may hold any letter.
    with tempfile.TemporaryDirectory(prefix="impact_rig_") as folder:
        source = shutil.copytree(workspace.root / "msg_config", Path(folder, "source"))
        _build(workspace, runner, MESSAGES, source, Path(folder, "build"), options)


def _build_nodes(workspace: Workspace, runner: _Runner) -> None:
    shutil.rmtree(workspace.root / "build" / NODES, ignore_errors=True)
    shutil.rmtree(workspace.get_prefix(NODES), ignore_errors=True)
    build = workspace.root / "build"
    _build(workspace, runner, NODES, workspace.root, build, ["--symlink-install"])
    workspace.shell_environment.write_text(format_environment(workspace), "utf-8")
    if " " in str(workspace.python):
        # No kernel finds an interpreter whose path holds a blank; PATH does.
        for script in (workspace.get_prefix(NODES) / "lib" / NODES).iterdir():
            _, code = script.read_text("utf-8").split("\n", 1)
            script.write_text(f"#!/usr/bin/env python3\n{code}", "utf-8")


def _build(
    workspace: Workspace,
    runner: _Runner,
    package: str,
    source: Path,
    build: Path,
    options: list[str],
) -> None:
    environment = make_environment(workspace, os.environ)
    # Without it colcon limits the load, and ninja then compiles one file at a time.
    environment.setdefault("MAKEFLAGS", f"-j{os.cpu_count() or 1}")
    colcon = "import sys; from colcon_core.command import main; sys.exit(main())"
    command: Command = [workspace.python, "-c", colcon, "build", "--base-paths", source]
    command += ["--build-base", build, "--packages-select", package]
    command += ["--event-handlers", "console_direct+", *options]
    runner.run(command, environment, workspace.root)


def _check_machine(workspace: Workspace, stale: list[str]) -> None:
    """Refuse before anything is downloaded if something is missing that pip cannot install."""
    if "python" in stale and importlib.util.find_spec("ensurepip") is None:
        raise SetupError(
            f"{sys.executable} cannot make Python environments (no `ensurepip`): install it, on "
            "Debian and Ubuntu with `sudo apt install python3-venv`."
        )
    if "python" in stale and workspace.is_ros_installed:
        _check_rclpy()
    if "messages" in stale:
        _check_compilers()


def _check_rclpy() -> None:
    check = [sys.executable, "-c", "import rclpy"]
    if subprocess.run(check, capture_output=True, check=False).returncode:
        raise SetupError(
            f"ROS 2 Jazzy is sourced, but {sys.executable} cannot import its rclpy: run rig.py "
            "with the Python of that installation, /usr/bin/python3 on Ubuntu, or use a terminal "
            "without ROS 2 (Jazzy then comes as Python wheels)."
        )


def _check_compilers() -> None:
    for language, variable, names in (
        ("C++", "CXX", ("c++", "g++", "clang++")),
        ("C", "CC", ("cc", "gcc", "clang")),
    ):
        if not os.environ.get(variable) and not any(map(shutil.which, names)):
            raise SetupError(
                f"the rig's ROS 2 messages are compiled here, and no {language} compiler is on "
                "PATH: install one, on Debian and Ubuntu with `sudo apt install build-essential`, "
                "on Fedora with `sudo dnf install gcc-c++`."
            )
    header = Path(sysconfig.get_path("include"), "Python.h")
    if not header.exists():
        raise SetupError(
            f"the rig's ROS 2 messages are compiled here, and {header} is missing: install "
            "Python's headers, on Debian and Ubuntu with `sudo apt install python3-dev`."
        )


@contextlib.contextmanager
def _hold_lock(workspace: Workspace) -> Iterator[int]:
    """Keep a second set-up of the same workspace waiting; the lock is on a file that is there."""
    lock = os.open(workspace.root / "setup.py", os.O_RDONLY)
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print(f"waiting: {workspace.root} is being set up by another call", file=sys.stderr)
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield lock
    finally:
        os.close(lock)


@contextlib.contextmanager
def _interruptible() -> Iterator[None]:
    """Let a request to terminate, or a terminal that is closed, end the set-up like Ctrl-C."""

    def interrupt(_signal: int, _frame: object) -> NoReturn:
        raise KeyboardInterrupt

    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    for number, handler in before.items():
        if handler != signal.SIG_IGN:  # what nohup asked for
            signal.signal(number, interrupt)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _end_group(process: subprocess.Popen[bytes]) -> None:
    """End a command and all that it started."""
    os.killpg(process.pid, signal.SIGINT)
    try:
        process.wait(timeout=GRACE)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
