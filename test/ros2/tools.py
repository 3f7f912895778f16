"""The real tools: commands that answer, and programs in terminals."""

import contextlib
import os
import subprocess
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from terminal import Terminal

PATIENCE = 250.0
"""How long anything may take before a test fails [s]; no test waits for it to pass."""
MARK = "IMPACT_RIG_TOOLS_RUN"
"""Variable that all processes of one test run carry, by which orphans are found."""


def list_marked(mark: str) -> list[str]:
    """Return the processes whose environment has this mark, this one left out."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if f"{MARK}={mark}".encode() not in (folder / "environ").read_bytes().split(b"\0"):
                continue
            command = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except OSError:
            continue  # ended meanwhile, or another user's
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

    def run(self, *words: Any, code: int | None = 0, patience: float = PATIENCE) -> str:
        """Run a command, again while it has not discovered its node; return what it printed."""
        deadline = time.monotonic() + PATIENCE
        while True:
            done = subprocess.run(
                list(map(str, words)),
                env=self.environment,
                cwd=self.folder,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                timeout=patience,
                check=False,
            )
            if "Node not found" not in done.stdout or time.monotonic() > deadline:
                break
        assert code is None or done.returncode == code, (
            f"{words}: {done.returncode}\n{done.stdout}"
        )
        return done.stdout

    def call(self, *words: Any) -> str:
        """Call a service; return what it answered.

        Its answer is lost to a command that it has not discovered yet: then it is asked again.
        """
        for patience in (20.0, 60.0):
            with contextlib.suppress(subprocess.TimeoutExpired):
                return self.run("ros2", "service", "call", *words, patience=patience)
        return self.run("ros2", "service", "call", *words)

    def run_until(self, is_enough: Callable[[str], object], *words: Any) -> str:
        """Run a command again and again until its answer is enough; return the answer."""
        deadline = time.monotonic() + PATIENCE
        while not is_enough(text := self.run(*words, code=None)):
            assert time.monotonic() < deadline, f"{words}:\n{text}"
        return text

    def launch(self, folder: Path, swing_file: Path, *words: str) -> Terminal:
        """Start the rig's launch file in a terminal, to record into a folder."""
        return self.start(
            "ros2", "launch", "impact_rig", "rig.launch.py", "visualizer:=false",
            f"output:={folder}", f"params_file:={swing_file}", *words,
        )  # fmt: skip

    def start(self, *words: Any) -> Terminal:
        """Start a program in a terminal; use it in a ``with``."""
        return Terminal(words, self.environment, self.folder)
