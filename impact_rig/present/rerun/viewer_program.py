"""Rerun's viewer as a program of this host: a window of its own, or a page for browsers.

Called as a module, it runs the viewer for somebody who does not wait for it.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

from impact_rig.core.errors import DeviceError, RigError

SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")
"""Variables that name a screen, where there is no other way to have one."""
STOP_TIMEOUT = 3.0
"""How long a viewer may take to end when it is told to [s], our choice."""


def check_screen() -> None:
    """Require a screen for a viewer's window.

    Raises
    ------
    DeviceError
        If there is none.
    """
    if sys.platform == "linux" and not any(os.environ.get(name) for name in SCREENS):
        raise DeviceError(
            f"no screen for a viewer (neither {SCREENS[0]} nor {SCREENS[1]} is set): write the"
            " view to a file, serve it as a web page, or connect to a viewer elsewhere"
        )


def find_viewer() -> Path:
    """Return the viewer's program.

    Raises
    ------
    RigError
        If it is not installed.
    """
    spec = importlib.util.find_spec("rerun_cli")
    if spec is not None and spec.origin is not None:
        folder = Path(spec.origin).parent
        for name in ("rerun", "rerun.exe", "Rerun.app/Contents/MacOS/Rerun"):
            if (folder / name).is_file():
                return folder / name
    raise RigError(
        "the viewer is not installed: it is part of the Python package rerun-sdk"
        " (pip install rerun-sdk)"
    )


def start_viewer(
    arguments: Sequence[str], *, waste: Path | None = None
) -> subprocess.Popen[bytes]:
    """Start a viewer that outlives this process.

    Parameters
    ----------
    arguments : sequence of str
        As Rerun's command line takes them.
    waste : Path, optional
        Folder that is removed when the viewer has ended.

    Returns
    -------
    subprocess.Popen
        Ends with the viewer.
    """
    return _start("outlive", arguments, waste, subprocess.DEVNULL)


def start_server(arguments: Sequence[str]) -> subprocess.Popen[bytes]:
    """Start a viewer that ends with this process, however that ends; `stop_server` ends it."""
    return _start("end", arguments, None, subprocess.PIPE)


def _start(
    manner: str, arguments: Sequence[str], waste: Path | None, stdin: int
) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", __name__, manner, "" if waste is None else str(waste)]
    return subprocess.Popen(
        [*command, str(find_viewer()), *arguments],
        stdin=stdin,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        # Ctrl-C ends the rig, not the picture of what it has measured.
        start_new_session=True,
    )


def stop_server(server: subprocess.Popen[bytes]) -> None:
    """End what `start_server` started."""
    if server.stdin is not None:
        server.stdin.close()
    try:
        server.wait(2 * STOP_TIMEOUT)
    except subprocess.TimeoutExpired:
        server.kill()


def main(arguments: Sequence[str]) -> int:
    """Run a command; afterwards remove a folder.

    Parameters
    ----------
    arguments : sequence of str
        How ("outlive": until it ends; "end": as long as standard input is open), the folder or
        nothing, and the command.

    Returns
    -------
    int
        Its exit code.
    """
    manner, waste, *command = arguments
    try:
        viewer = subprocess.Popen(command, stdin=subprocess.DEVNULL)
        if manner == "end":
            threading.Thread(target=_end_with_input, args=(viewer,), daemon=True).start()
        return viewer.wait()
    finally:
        if waste:
            shutil.rmtree(waste, ignore_errors=True)


def _end_with_input(viewer: subprocess.Popen[bytes]) -> None:
    while os.read(0, 1):
        pass
    viewer.terminate()
    with contextlib.suppress(subprocess.TimeoutExpired):
        viewer.wait(STOP_TIMEOUT)
        return
    viewer.kill()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
