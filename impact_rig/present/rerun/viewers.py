"""Rerun: its module, its program on this computer as a window or as a web page, its addresses.

The module is imported when it is used: a rig without viewer does not need it.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType
from urllib.parse import quote, urlsplit

from impact_rig.core.given.errors import DeviceError, ParameterError, RigError

MINIMUM_VERSION = (0, 41)
"""Oldest tested rerun-sdk."""

LOG_VARIABLE = "RUST_LOG"
"""Variable for the logging of programs in Rust, as Rerun."""
LOOPBACK = "127.0.0.1"
"""Servers listen there: other computers do not reach them."""
DEFAULT_PORT = 9876  # Rerun's
ANSWER_TIMEOUT = 1.0  # [s] in which a viewer accepts a connection
PAGE_TIMEOUT = 10.0  # [s] in which a web page is up, on a busy computer
PAGE_PERIOD = 0.05  # [s] between two looks whether it is up
STOP_TIMEOUT = 3.0  # [s] in which a web page ends
SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")
"""Variables that name a screen on Linux."""


def import_rerun() -> ModuleType:
    """Return the module `rerun`, its blueprint module loaded.

    Raises
    ------
    RigError
        If rerun-sdk is not installed, or too old.
    """
    wanted = ".".join(map(str, MINIMUM_VERSION))
    try:
        with _keep_silent():
            import rerun
            import rerun.blueprint
    except ImportError as error:
        raise RigError(
            "the view needs the Python package rerun-sdk, which is not installed:"
            f" pip install 'rerun-sdk>={wanted}'"
        ) from error
    version = tuple(int(part) for part in rerun.__version__.split(".")[:2])
    if version < MINIMUM_VERSION:
        raise RigError(
            f"rerun-sdk {rerun.__version__} is too old for the view:"
            f" pip install 'rerun-sdk>={wanted}'"
        )
    return rerun


@contextlib.contextmanager
def _keep_silent() -> Iterator[None]:
    """Turn off Rerun's own logging, unless the environment sets it.

    Rerun reads the variable when it is imported. Its users report errors in a sentence.
    """
    if LOG_VARIABLE in os.environ or "rerun" in sys.modules:
        yield
        return
    os.environ[LOG_VARIABLE] = "off"
    try:
        yield
    finally:
        os.environ.pop(LOG_VARIABLE, None)


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


def find_missing_viewer(address: str) -> str | None:
    """Return why no viewer can be reached at an address; None: one answers.

    Raises
    ------
    ParameterError
        If the address is invalid.
    """
    host, port = check_viewer_address(address)
    if _is_answering(host, port):
        return None
    return f"no viewer answers at {address}: start one there with rerun --port {port}"


def find_missing_screen() -> str | None:
    """Return why no window can be shown; None: there is a screen."""
    if sys.platform != "linux" or any(os.environ.get(name) for name in SCREENS):
        return None
    return (
        f"no screen for a viewer (neither {SCREENS[0]} nor {SCREENS[1]} is set): write the"
        " view to a file, serve it as a web page, or connect to a viewer elsewhere"
    )


def make_viewer_address(port: int) -> str:
    """Return the address of a viewer, or of a server for viewers, on this computer."""
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


def find_free_port() -> int:
    """Return a port of this computer on which no program listens."""
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
    RigError
        If the viewer is not installed.
    """
    return _start([str(find_viewer()), "--bind", LOOPBACK, "--port", "auto", *shown])


class WebPage:
    """A page with a viewer, for browsers of this computer, until it or this process ends.

    Rerun's own `serve_web_viewer` would let every computer of the network in.

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
