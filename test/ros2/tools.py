"""The real tools: commands that answer, and programs at a terminal of their own."""

import fcntl
import os
import pty
import re
import signal
import subprocess
import termios
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

PATIENCE = 100.0
"""How long anything may take before a test fails [s]; no test waits for it to pass."""
ESCAPE = re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]")
MARK = "IMPACT_RIG_TOOLS_RUN"
"""Variable that all processes of one test run carry, by which orphans are found."""


def take_terminal() -> None:
    """Hear Ctrl-C of the terminal that is standard input."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


def list_marked(mark: str) -> list[str]:
    """Return the processes whose environment has this mark, this one left out."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if f"{MARK}={mark}".encode() not in (folder / "environ").read_bytes().split(b"\0"):
                continue
            command = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except OSError:
            continue  # ended meanwhile, or somebody else's
        if command and folder.name != str(os.getpid()):
            found.append(f"{folder.name}: {command}")
    return found


class Tools:
    """Commands of one ROS domain.

    Parameters
    ----------
    environment : mapping
        Variables of all commands.
    folder : Path
        Where they run.
    """

    def __init__(self, environment: Mapping[str, str], folder: Path) -> None:
        self.environment = environment
        self.folder = folder

    def run(self, *words: Any, code: int | None = 0) -> str:
        """Run a command to its end; return what it printed."""
        done = subprocess.run(
            list(map(str, words)),
            env=self.environment,
            cwd=self.folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=PATIENCE,
            check=False,
        )
        assert code is None or done.returncode == code, (
            f"{words}: {done.returncode}\n{done.stdout}"
        )
        return done.stdout

    def run_until(self, is_enough: Callable[[str], bool], *words: Any) -> str:
        """Run a command again and again until its answer is enough; return the answer."""
        deadline = time.monotonic() + PATIENCE
        while not is_enough(text := self.run(*words, code=None)):
            assert time.monotonic() < deadline, f"{words}:\n{text}"
        return text

    def start(self, *words: Any) -> "Terminal":
        """Start a program at a terminal of its own; use it in a ``with``."""
        return Terminal(list(map(str, words)), self.environment, self.folder)


class Terminal:
    """A program at a terminal, which hears Ctrl-C as a person's does."""

    def __init__(self, words: list[str], environment: Mapping[str, str], folder: Path) -> None:
        self._name = " ".join(words)
        self._text = ""
        self._changed = threading.Condition()
        self._has_ended = False
        self._master, slave = pty.openpty()
        self._process = subprocess.Popen(
            words,
            env=environment,
            cwd=folder,
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
            preexec_fn=take_terminal,  # noqa: PLW1509 - nothing else can give it the terminal
        )
        os.close(slave)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if self._process.poll() is None:
                self.press_control_c()
                self.wait()
        finally:
            if self._process.poll() is None:
                os.killpg(self._process.pid, signal.SIGKILL)
                self._process.wait()
            os.close(self._master)

    @property
    def text(self) -> str:
        """What it has printed so far, without colours."""
        with self._changed:
            return self._text

    def press_control_c(self) -> None:
        """Send what the key sends: the terminal interrupts all of its foreground processes."""
        os.write(self._master, b"\x03")

    def wait_for(self, pattern: str) -> str:
        """Wait until it has printed a text; return the text."""
        with self._changed:
            while not (match := re.search(pattern, self._text)):
                assert not self._has_ended, f"{self._name} ended:\n{self._text}"
                assert self._changed.wait(PATIENCE), f"{self._name}: no {pattern}:\n{self._text}"
            return match[0]

    def wait(self) -> int:
        """Wait for the end; return the exit code."""
        try:
            code = self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"{self._name} does not end:\n{self.text}") from None
        self._reader.join(PATIENCE)
        return code

    def interrupt(self) -> int:
        """Press Ctrl-C, and wait for the end; return the exit code."""
        self.press_control_c()
        return self.wait()

    def _read(self) -> None:
        try:
            while data := os.read(self._master, 65536):
                with self._changed:
                    text = data.decode("utf-8", "replace").replace("\r", "")
                    self._text += ESCAPE.sub("", text)
                    self._changed.notify_all()
        except OSError:
            pass  # the last process at the terminal has ended
        with self._changed:
            self._has_ended = True
            self._changed.notify_all()
