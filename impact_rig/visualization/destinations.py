"""Opening of the view's destinations, and what is said when one cannot be opened."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit
from uuid import uuid4

from impact_rig.core.errors import DeviceError, FileError, ParameterError, RigError
from impact_rig.visualization import entities
from impact_rig.visualization.rerun_sdk import import_rerun
from impact_rig.visualization.sink import Destination, Notice

if TYPE_CHECKING:
    import rerun as rr

LOOPBACK = "127.0.0.1"
"""The only interface that is listened on."""
DEFAULT_PORT = 9876
"""Rerun's own."""
CONNECT_TIMEOUT = 1.0
"""How long a viewer may take to accept a connection [s], our choice."""
FILE_REFRESH_PERIOD = 10.0
"""Least time between two versions of a table or comparison in a file [s], our choice: of a file
only the last one is looked at, and each takes room."""
VIEWER_REFRESH_PERIOD = 1.0
"""The same in a viewer [s], our choice."""
RELAY_MEMORY = "512MiB"
"""What is kept for a viewer of our own that is opened again, our choice: 4000 hits."""


def open_destinations(
    *, output: str = "", connect: str = "", spawn: bool = False, notify: Notice
) -> tuple[Destination, ...]:
    """Open everything that was asked for.

    A viewer that cannot be reached is an error if nothing else shows the view; else `notify` is
    told and the rest is opened.

    Parameters
    ----------
    output : str
        Path of an .rrd file to be written, replaced if it exists; empty: none.
    connect : str
        Address of a running viewer, ``rerun+http://HOST:9876/proxy``; empty: none.
    spawn : bool
        Open a viewer on this host. It is fed through a relay that listens on the loopback
        interface only, so it may be closed and opened again.
    notify : callable
        Told in one sentence what is lost, now or later.

    Returns
    -------
    tuple of Destination
        To be closed by the caller.

    Raises
    ------
    ParameterError
        If nothing was asked for, or the address is none.
    FileError
        If the file cannot be written.
    DeviceError
        If no viewer can be shown, and no file is written.
    RigError
        If rerun-sdk is not installed.
    """
    if not (output or connect or spawn):
        raise ParameterError(
            "nothing shows the view: set output to the path of an .rrd file, connect to the"
            " address of a running viewer, or spawn to true"
        )
    if connect:
        check_viewer_address(connect)
    sdk = import_rerun()
    # What is logged is closed by us; Rerun's own wait at exit for a stuck viewer has no end.
    sdk.unregister_shutdown()
    opened: list[Destination] = []
    openers: list[Callable[[], Destination]] = []
    if output:
        opened.append(_open_file(sdk, Path(output), notify))
    if connect:
        openers.append(lambda: _open_connection(sdk, connect, notify))
    if spawn:
        openers.append(lambda: _open_viewer(sdk, notify))
    failures: list[RigError] = []
    for opener in openers:
        try:
            opened.append(opener())
        except DeviceError as error:
            failures.append(error)
    if not opened:
        raise failures[0]
    for failure in failures:
        notify(str(failure))
    return tuple(opened)


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
            f"viewer address is {address!r}: it must read like"
            f" rerun+http://{LOOPBACK}:{DEFAULT_PORT}/proxy"
        )
    return parts.hostname or "", port


def _make_stream(sdk: Any, sink: Any) -> rr.RecordingStream:
    stream: rr.RecordingStream = sdk.RecordingStream(entities.APPLICATION, recording_id=uuid4())
    stream.set_sinks(sink)
    return stream


def _open_file(sdk: Any, path: Path, notify: Notice) -> Destination:
    if path.suffix != ".rrd":
        raise FileError(f"output is {str(path)!r}: it must end in .rrd")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # Tried first: Rerun would say why not in its own words, on another channel.
        path.open("ab").close()
        stream = _make_stream(sdk, sdk.FileSink(str(path)))
    except (OSError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"{path} cannot be written: {reason}") from error
    return Destination(str(path), stream, FILE_REFRESH_PERIOD, notify)


def _open_connection(sdk: Any, address: str, notify: Notice) -> Destination:
    host, port = check_viewer_address(address)
    try:
        socket.create_connection((host, port), timeout=CONNECT_TIMEOUT).close()
    except OSError as error:
        raise DeviceError(
            f"no viewer answers at {address}: start one there with"
            f" rerun --bind {LOOPBACK} --port {port}"
        ) from error
    stream = _make_stream(sdk, sdk.GrpcSink(address))
    return Destination(f"the viewer at {address}", stream, VIEWER_REFRESH_PERIOD, notify)


def _open_viewer(sdk: Any, notify: Notice) -> Destination:
    screens = ("DISPLAY", "WAYLAND_DISPLAY")
    if sys.platform == "linux" and not any(os.environ.get(name) for name in screens):
        raise DeviceError(
            "no screen for a viewer (neither DISPLAY nor WAYLAND_DISPLAY is set): write the view"
            " to a file by setting output, or connect to a viewer elsewhere"
        )
    relay = sdk.GrpcServerSink(LOOPBACK, _find_free_port(), server_memory_limit=RELAY_MEMORY)
    address = relay.uri
    stream = _make_stream(sdk, relay)
    command = ["--connect", address, "--bind", LOOPBACK, "--port", "auto"]
    viewer = subprocess.Popen(
        [sys.executable, "-m", "rerun", *command],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        # Ctrl-C ends the rig, not the picture of what it has measured.
        start_new_session=True,
    )

    def watch() -> None:
        code = viewer.wait()
        notify(f"the viewer has ended (exit code {code}): rerun {' '.join(command)} opens another")

    threading.Thread(target=watch, name="viewer", daemon=True).start()
    return Destination(f"the viewer fed by {address}", stream, VIEWER_REFRESH_PERIOD, notify)


def _find_free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])
