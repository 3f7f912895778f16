"""A program in a terminal: what it prints, what is typed, Ctrl-C, and its end."""

import codecs
import contextlib
import fcntl
import os
import pty
import re
import signal
import struct
import subprocess
import termios
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

PATIENCE = 100.0
"""How long anything may take before a test fails [s]; no test waits for it to pass."""
ESCAPE = re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]")


def run_program(words: Sequence[Any], **options: Any) -> subprocess.CompletedProcess[str]:
    """Run a program to its end; return what it printed, and its exit code."""
    return subprocess.run(
        list(map(str, words)),
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
        **options,
    )


def make_colourful() -> dict[str, str]:
    """Return this environment for a terminal with colours, whose width programs ask for."""
    left_out = ("COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR")
    kept = {name: value for name, value in os.environ.items() if name not in left_out}
    return {**kept, "TERM": "xterm-256color"}


def _take_terminal() -> None:
    """Receive Ctrl-C of the terminal that is standard input."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


class Terminal:
    """A program in a terminal of its size; use it in a ``with``, which ends the program.

    Parameters
    ----------
    words : sequence
        The command.
    environment : mapping
        All of its variables; None: those of this process.
    folder : Path
        Where it runs.
    columns : int
        Width of the terminal.
    """

    def __init__(
        self,
        words: Sequence[Any],
        environment: Mapping[str, str] | None = None,
        folder: Path | None = None,
        columns: int = 1000,
    ) -> None:
        self._words = list(map(str, words))
        self.raw = ""
        self._changed = threading.Condition()
        self._has_ended = False
        self._master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
        self.process = subprocess.Popen(
            self._words,
            env=environment,
            cwd=folder,
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
            preexec_fn=_take_terminal,  # noqa: PLW1509 - nothing else can give it the terminal
        )
        os.close(slave)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            if self.process.poll() is None:
                self.interrupt()
        finally:
            if self.process.poll() is None:
                os.killpg(self.process.pid, signal.SIGKILL)
                self.process.wait()
            os.close(self._master)

    @property
    def text(self) -> str:
        """What it has printed so far, without escapes."""
        return ESCAPE.sub("", self.raw).replace("\r\n", "\n")

    def write(self, text: str) -> None:
        """Type something."""
        os.write(self._master, text.encode())

    def wait_for(self, pattern: str, start: int = 0) -> int:
        """Wait until a pattern is in the text, from `start` on; return where it ends."""
        with self._changed:
            while not (match := re.compile(pattern).search(self.text, start)):
                assert not self._has_ended, f"{self._words} ended:\n{self.text}"
                assert self._changed.wait(PATIENCE), f"{self._words}: no {pattern}:\n{self.text}"
            return match.end()

    def wait(self) -> int:
        """Wait for the end; return the exit code."""
        try:
            code = self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"{self._words} does not end:\n{self.text}") from None
        self._reader.join(PATIENCE)
        return code

    def interrupt(self) -> int:
        """Press Ctrl-C, which all programs in the terminal receive; return the exit code."""
        self.write("\x03")
        return self.wait()

    def _read(self) -> None:
        decoder = codecs.getincrementaldecoder("utf-8")("replace")
        with contextlib.suppress(OSError):  # the last program in the terminal has ended
            while data := os.read(self._master, 65536):
                with self._changed:
                    self.raw += decoder.decode(data)
                    self._changed.notify_all()
        with self._changed:
            self._has_ended = True
            self._changed.notify_all()
