"""Commands in a terminal of a given size: what a person would see of them."""

import contextlib
import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import termios
import time
from collections.abc import Callable, Iterator, Sequence

from rich.cells import cell_len

PATIENCE = 120.0
"""How long anything may take before a test fails [s]."""
ESCAPE = re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]")
SHOW_CURSOR, HIDE_CURSOR = "\x1b[?25h", "\x1b[?25l"


class Terminal:
    """A command at work in a terminal.

    Parameters
    ----------
    words : sequence of str
        The command.
    columns : int
        Width of the terminal.
    environment : mapping
        Replaces variables; None takes one away.
    """

    def __init__(self, words: Sequence[str], columns: int, **environment: str | None) -> None:
        self._master, slave = pty.openpty()
        self._slave = slave
        self.resize(columns)
        variables = {**os.environ, "TERM": "xterm-256color", **environment}
        for name in ("COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR"):
            variables.setdefault(name, None)
        if "COLUMNS" not in environment:
            variables["COLUMNS"] = None
        self.process = subprocess.Popen(
            list(words),
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
            env={name: value for name, value in variables.items() if value is not None},
        )
        self.raw = ""

    def resize(self, columns: int) -> None:
        """Make the terminal wider or narrower; programs ask for its size themselves."""
        size = struct.pack("HHHH", 40, columns, 0, 0)
        fcntl.ioctl(self._master, termios.TIOCSWINSZ, size)

    def write(self, text: str) -> None:
        """Type something."""
        os.write(self._master, text.encode())

    def read_until(self, is_enough: Callable[[str], bool]) -> None:
        """Read on until the raw text is enough."""
        deadline = time.monotonic() + PATIENCE
        while not is_enough(self.raw):
            assert time.monotonic() < deadline, self.raw
            self._read(0.1)

    def finish(self) -> int:
        """Read to the end of the command, and return its exit code."""
        deadline = time.monotonic() + PATIENCE
        while self.process.poll() is None:
            assert time.monotonic() < deadline, self.raw
            self._read(0.1)
        while self._read(0.0):
            pass
        return self.process.returncode

    def close(self) -> None:
        """Leave nothing behind."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        os.close(self._slave)
        os.close(self._master)

    def _read(self, timeout: float) -> bool:
        if not select.select([self._master], [], [], timeout)[0]:
            return False
        # A letter may come in two pieces: surrogates join again.
        piece = os.read(self._master, 65536).decode("utf-8", "surrogateescape")
        self.raw = (
            (self.raw + piece)
            .encode("utf-8", "surrogateescape")
            .decode("utf-8", "surrogateescape")
        )
        return True

    @property
    def text(self) -> str:
        """What was written, without the escapes."""
        return ESCAPE.sub("", self.raw).replace("\r\n", "\n")


@contextlib.contextmanager
def open_terminal(
    words: Sequence[str], columns: int = 80, **environment: str | None
) -> Iterator[Terminal]:
    """Start a command in a terminal, and end it with the block."""
    terminal = Terminal(words, columns, **environment)
    try:
        yield terminal
    finally:
        terminal.close()


def find_widest(text: str) -> int:
    """Return the width of the widest line, in cells."""
    return max(cell_len(line) for part in text.split("\n") for line in part.split("\r"))
