"""Processes of a rig and of its bench, with what they print, ended by their numbers."""

import codecs
import contextlib
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from typing import Any, Self

PATIENCE = 60.0
"""How long anything may take before a test fails [s]; no test waits for it to pass."""
COMMAND_LINE = "impact_rig.cli.main"


class TalkingProcess:
    """A Python module as a process that is told lines, and talks; use it in a ``with``."""

    def __init__(
        self,
        module: str,
        *arguments: Any,
        environment: dict[str, str],
        prefix: Sequence[str] = (),
    ) -> None:
        self._name = f"{module} {' '.join(map(str, arguments))}"
        self._output = ""
        self._changed = threading.Condition()
        self._has_ended = False
        self._process = subprocess.Popen(
            [*prefix, sys.executable, "-m", module, *map(str, arguments)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=environment,
            bufsize=0,
            start_new_session=True,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def output(self) -> str:
        """What it has printed so far."""
        with self._changed:
            return self._output

    def tell(self, line: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n".encode())

    def wait_for(self, pattern: str, start: int = 0) -> int:
        """Wait for a text; return where it ends.

        Parameters
        ----------
        pattern : str
            Regular expression.
        start : int
            Where to look from.
        """
        with self._changed:
            while not (match := re.compile(pattern).search(self._output, start)):
                assert not self._has_ended, f"{self._name} ended: {self._output[-2000:]}"
                assert self._changed.wait(PATIENCE), f"{self._name}: {self._output[-2000:]}"
            return match.end()

    def wait(self) -> int:
        """Wait for the end; return the exit code."""
        code = self._process.wait(PATIENCE)
        self._reader.join(PATIENCE)
        return code

    def stop(self) -> int:
        """End it as Ctrl-C does; return the exit code."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
        try:
            return self.wait()
        except subprocess.TimeoutExpired:
            self._process.kill()
            raise
        finally:
            for stream in (self._process.stdin, self._process.stdout):
                if stream is not None:
                    with contextlib.suppress(OSError):
                        stream.close()

    def _read(self) -> None:
        assert self._process.stdout is not None
        decoder = codecs.getincrementaldecoder("utf-8")(errors="replace")
        with contextlib.suppress(ValueError, OSError):
            while data := os.read(self._process.stdout.fileno(), 65536):
                with self._changed:
                    self._output += decoder.decode(data)
                    self._changed.notify_all()
        with self._changed:
            self._has_ended = True
            self._changed.notify_all()
