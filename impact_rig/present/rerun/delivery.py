"""Where the view goes: live to a file and to viewers, afterwards as a file.

Rerun's server in this process serves windows and web pages of this computer, late ones too. A
viewer on another computer must run when the view opens. A viewer that takes no data delays the
file and the other viewers, but not the rig.
"""

from __future__ import annotations

import shutil
import subprocess
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from impact_rig.core.given.errors import DeviceError, FileError, ParameterError
from impact_rig.present.rerun import entities
from impact_rig.present.rerun.view_log import ViewLog
from impact_rig.present.rerun.viewers import (
    LOOPBACK,
    WebPage,
    find_free_port,
    find_missing_screen,
    find_missing_viewer,
    find_viewer,
    import_rerun,
    make_viewer_address,
    open_window,
)
from impact_rig.results.traces import TracedCampaign

if TYPE_CHECKING:
    import rerun as rr

SERVER_MEMORY = "512MiB"
"""Size of the server's memory for viewers that come late, our choice: 4000 hits."""
FLUSH_TIMEOUT = 0.5  # [s] in which file and viewers take what was logged
CLOSE_TIMEOUT = 5.0  # [s], below what process managers grant
WRITE_TIMEOUT = 60.0  # [s] in which a file takes a campaign, on a slow disk


class LiveView:
    """Sends what `log` logs to a file, to viewers, or to both.

    A viewer that cannot be shown is an error if nothing else shows the view; otherwise `notify`
    gets one sentence, and the rest is opened.

    Parameters
    ----------
    output : str
        Path of an .rrd file, replaced if it exists; empty: none.
    connect : str
        ``rerun+http://HOST:9876/proxy`` of a viewer elsewhere; empty: none.
    spawn : bool
        Open a window on this computer.
    web : bool
        Serve a web page for this computer.
    announce : callable
        Gets one sentence with the address of the web page, or with the command for a window.
    notify : callable
        Gets one sentence for each viewer that cannot be shown.

    Raises
    ------
    ParameterError
        If the view goes nowhere, or an address is not one.
    FileError
        If the file cannot be written.
    DeviceError
        If no viewer can be shown, and nothing else was asked for.
    RigError
        If rerun-sdk is not installed.
    """

    def __init__(
        self,
        *,
        output: str = "",
        connect: str = "",
        spawn: bool = False,
        web: bool = False,
        announce: Callable[[str], None],
        notify: Callable[[str], None],
    ) -> None:
        if not (output or connect or spawn or web):
            raise ParameterError(
                "nothing shows the view: set output to the path of an .rrd file, connect to the"
                " address of a viewer, or spawn or web to true"
            )
        sdk = import_rerun()
        # `close` has a time limit; Rerun's own wait at exit for a stuck viewer has none.
        sdk.unregister_shutdown()
        self._page: WebPage | None = None
        no_viewer = find_missing_viewer(connect) if connect else None
        no_screen = find_missing_screen() if spawn else None
        has_viewer, has_window = connect and not no_viewer, spawn and not no_screen
        failures = [failure for failure in (no_viewer, no_screen) if failure]
        if not (output or web or has_viewer or has_window):
            raise DeviceError(failures[0])
        for failure in failures:
            notify(failure)
        port = find_free_port()
        server = make_viewer_address(port)
        sinks: list[Any] = []
        if output:
            sinks.append(_make_file_sink(sdk, Path(output)))
        if has_viewer:
            sinks.append(sdk.GrpcSink(connect))
        if has_window or web:
            # No web site may have its visitors' browsers read the view.
            sinks.append(
                sdk.GrpcServerSink(
                    LOOPBACK, port, server_memory_limit=SERVER_MEMORY, cors_allow_origin=[]
                )
            )
        self._stream = _make_stream(sdk, *sinks)
        self.log = ViewLog(self._stream)
        if has_window:
            open_window("--connect", server)
            announce(f"another window: rerun --connect {server}")
        if web:
            self._page = WebPage(server, [server])
            announce(f"the view is at {self._page.address}")

    @property
    def page(self) -> str | None:
        """Address of the web page that it serves."""
        return self._page.address if self._page is not None else None

    def flush(self) -> bool:
        """Return whether file and viewers have taken everything that was logged."""
        try:
            self._stream.flush(timeout_sec=FLUSH_TIMEOUT)
        except RuntimeError:
            return False
        return True

    def close(self, timeout: float = CLOSE_TIMEOUT) -> None:
        """Close file and server, and stop waiting for a stuck viewer after `timeout` seconds."""
        # A daemon: with a viewer that is stuck, disconnect has no end.
        closing = threading.Thread(target=self._stream.disconnect, daemon=True)
        closing.start()
        closing.join(timeout)
        if self._page is not None:
            self._page.close()
            self._page = None


def _make_stream(sdk: Any, *sinks: Any) -> rr.RecordingStream:
    """Return a new recording that goes to sinks of `rerun`."""
    stream: rr.RecordingStream = sdk.RecordingStream(entities.APPLICATION, recording_id=uuid4())
    stream.set_sinks(*sinks)
    return stream


def _make_file_sink(sdk: Any, path: Path) -> Any:
    if path.suffix != ".rrd":
        raise FileError(f"output is {str(path)!r}: it must end in .rrd")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # Tried first: Rerun would say why not in its own words, on another channel.
        path.open("ab").close()
        # A footer's index would be kept in memory and grow with every hit.
        return sdk.FileSink(str(path), write_footer=False)
    except (OSError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"{path} cannot be written: {reason}") from error


def join_views(path: Path, parts: Sequence[Path]) -> None:
    """Write a file with all recordings of others.

    Raises
    ------
    FileError
        If one of them is not a view, or the file cannot be written.
    RigError
        If rerun-sdk is not installed.
    """
    if len(parts) == 1:
        shutil.copyfile(parts[0], path)
        return
    command = [str(find_viewer()), "rrd", "merge", "-o", str(path), *map(str, parts)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
        raise FileError(f"{path} cannot be written: {reason}")


def write_view(path: Path, campaign: TracedCampaign) -> None:
    """Write a campaign into a new file.

    Raises
    ------
    FileError
        If the file cannot be written.
    RigError
        If rerun-sdk is not installed.
    """
    sdk = import_rerun()
    sdk.unregister_shutdown()
    try:
        stream = _make_stream(sdk, sdk.FileSink(str(path)))
        ViewLog(stream).log_campaign(campaign)
        stream.flush(timeout_sec=WRITE_TIMEOUT)
        stream.disconnect()
    except (OSError, RuntimeError) as error:
        raise FileError(f"{path} cannot be written: {error}") from None
