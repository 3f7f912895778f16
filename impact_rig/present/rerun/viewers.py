"""Viewers: their addresses, and Rerun's program on this host as a window or as a web page."""

from __future__ import annotations

import importlib.util
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote, urlsplit

from impact_rig.core.errors import DeviceError, ParameterError, RigError

LOOPBACK = "127.0.0.1"
"""Servers listen there: other hosts do not reach them."""
DEFAULT_PORT = 9876  # Rerun's
ANSWER_TIMEOUT = 1.0  # [s] in which a viewer accepts a connection
PAGE_TIMEOUT = 10.0  # [s] in which a web page is up, on a busy host
PAGE_PERIOD = 0.05  # [s] between two looks whether it is up
STOP_TIMEOUT = 3.0  # [s] in which a web page ends
SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")
"""Variables that name a screen on Linux."""


def check_viewer_address(address: str) -> tuple[str, int]:
    """Return host and port of a viewer's address.

    Raises
    ------
    ParameterError
        If the address does not read like ``rerun+http://HOST:9876/proxy``.
    """
    try:
        parts = urlsplit(address)
        port = parts.port or DEFAULT_PORT
    except ValueError:
        parts, port = urlsplit(""), 0
    known = parts.scheme in ("rerun", "rerun+http", "rerun+https")
    if not (known and parts.hostname and parts.path == "/proxy"):
        raise ParameterError(
            f"viewer address is {address!r}: it must read like {make_viewer_address(DEFAULT_PORT)}"
        )
    return parts.hostname or "", port


def check_answering(address: str) -> None:
    """Require a viewer that accepts a connection at an address.

    Raises
    ------
    ParameterError
        If the address is invalid.
    DeviceError
        If no viewer answers.
    """
    host, port = check_viewer_address(address)
    if not _is_answering(host, port):
        raise DeviceError(
            f"no viewer answers at {address}: start one there with rerun --port {port}"
        )


def check_screen() -> None:
    """Require a screen for a viewer's window.

    Raises
    ------
    DeviceError
        Without a screen.
    """
    if sys.platform == "linux" and not any(os.environ.get(name) for name in SCREENS):
        raise DeviceError(
            f"no screen for a viewer (neither {SCREENS[0]} nor {SCREENS[1]} is set): write the"
            " view to a file, serve it as a web page, or connect to a viewer elsewhere"
        )


def make_viewer_address(port: int) -> str:
    """Return the address of a viewer, or of a server for viewers, on this host."""
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


def find_free_port() -> int:
    """Return a port of this host on which no program listens."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def find_viewer() -> Path:
    """Return Rerun's program.

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


def open_window(*shown: str) -> subprocess.Popen[bytes]:
    """Open a window that shows files or a server; it may outlive this process.

    Raises
    ------
    DeviceError
        If there is no screen.
    RigError
        If the viewer is not installed.
    """
    check_screen()
    return _start([str(find_viewer()), "--bind", LOOPBACK, "--port", "auto", *shown])


class WebPage:
    """A page with a viewer, for browsers of this host, until it is closed or this process ends.

    Parameters
    ----------
    server : str
        Address of what the page shows.
    arguments : sequence of str
        Further ones for Rerun's command line: files, or the server.

    Raises
    ------
    DeviceError
        If the page does not come up.
    RigError
        If the viewer is not installed.
    """

    def __init__(self, server: str, arguments: Sequence[str]) -> None:
        port = find_free_port()
        self.address = f"http://{LOOPBACK}:{port}/?url={quote(server, safe='')}"
        command = [str(find_viewer()), "--serve-web", "--bind", LOOPBACK]
        command += ["--web-viewer-port", str(port), *arguments]
        if shutil.which("setpriv"):
            # So the page ends with this process even after kill -9.
            command = ["setpriv", "--pdeathsig", "TERM", *command]
        self._process = _start(command)
        deadline = time.monotonic() + PAGE_TIMEOUT
        while not _is_answering(LOOPBACK, port):
            if self._process.poll() is not None or time.monotonic() > deadline:
                self.close()
                raise DeviceError(f"the web page {self.address} cannot be served")
            time.sleep(PAGE_PERIOD)

    def wait(self) -> None:
        """Wait until the page has ended."""
        self._process.wait()

    def close(self) -> None:
        """End the page; an open browser keeps its contents."""
        self._process.terminate()
        try:
            self._process.wait(STOP_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def _start(command: Sequence[str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        # Ctrl-C ends the rig, and a window goes on showing what it has measured.
        start_new_session=True,
    )


def _is_answering(host: str, port: int) -> bool:
    try:
        socket.create_connection((host, port), timeout=ANSWER_TIMEOUT).close()
    except OSError:
        return False
    return True
