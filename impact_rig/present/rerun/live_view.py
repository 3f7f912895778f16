"""The live view: one Rerun recording that goes to a file and to viewers.

Rerun's own server in this process gives all it has to a window or a page of this host, at any
time. A viewer elsewhere gets what is logged from the start on, and must be there then. Rerun waits
for a viewer that takes no data: file and other viewers then wait, too, the rig does not.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from impact_rig.core.errors import DeviceError, FileError, ParameterError
from impact_rig.present.rerun import entities
from impact_rig.present.rerun.rerun_sdk import import_rerun
from impact_rig.present.rerun.view_log import ViewLog
from impact_rig.present.rerun.viewers import (
    LOOPBACK,
    WebPage,
    check_answering,
    check_screen,
    check_viewer_address,
    find_free_port,
    make_viewer_address,
    open_window,
)

if TYPE_CHECKING:
    import rerun as rr

SERVER_MEMORY = "512MiB"
"""What the server keeps for viewers that come late, our choice: 4000 hits."""
FLUSH_TIMEOUT = 0.5  # [s] in which file and viewers take what was logged
CLOSE_TIMEOUT = 5.0  # [s], below what process managers grant


@dataclass(frozen=True)
class ViewPlan:
    """Where the view goes: any of these, or several at once.

    Raises
    ------
    ParameterError
        If the view goes nowhere, or an address is not one.
    """

    output: str = ""  # path of an .rrd file, replaced if it exists; empty: none
    connect: str = ""  # rerun+http://HOST:9876/proxy of a viewer elsewhere; empty: none
    spawn: bool = False  # a window on this host
    web: bool = False  # a web page for this host

    def __post_init__(self) -> None:
        """Check what was asked for."""
        if not (self.output or self.connect or self.spawn or self.web):
            raise ParameterError(
                "nothing shows the view: set output to the path of an .rrd file, connect to the"
                " address of a viewer, or spawn or web to true"
            )
        if self.connect:
            check_viewer_address(self.connect)


class LiveView:
    """What is logged by `log` goes everywhere the plan says.

    A viewer that cannot be shown is an error if nothing else shows the view; else `notify` gets
    one sentence, and the rest is opened.

    Parameters
    ----------
    plan : ViewPlan
        Where to.
    announce : callable
        Gets one sentence with the address of the web page, or with the command for a window.
    notify : callable
        Gets one sentence for each viewer that cannot be shown.

    Raises
    ------
    FileError
        If the file cannot be written.
    DeviceError
        If no viewer can be shown, and nothing else was asked for.
    RigError
        If rerun-sdk is not installed.
    """

    def __init__(
        self,
        plan: ViewPlan,
        *,
        announce: Callable[[str], None],
        notify: Callable[[str], None],
    ) -> None:
        sdk = import_rerun()
        # `close` has a time limit; Rerun's own wait at exit for a stuck viewer has none.
        sdk.unregister_shutdown()
        self._page: WebPage | None = None
        plan = _leave_out_missing(plan, notify)
        port = find_free_port()
        server = make_viewer_address(port)
        sinks: list[Any] = []
        if plan.output:
            sinks.append(_make_file_sink(sdk, Path(plan.output)))
        if plan.connect:
            sinks.append(sdk.GrpcSink(plan.connect))
        if plan.spawn or plan.web:
            # No web site may have its visitors' browsers read the view.
            sinks.append(
                sdk.GrpcServerSink(
                    LOOPBACK, port, server_memory_limit=SERVER_MEMORY, cors_allow_origin=[]
                )
            )
        self._stream = make_stream(sdk, *sinks)
        self.log = ViewLog(self._stream)
        if plan.spawn:
            open_window("--connect", server)
            announce(f"another window: rerun --connect {server}")
        if plan.web:
            self._page = WebPage(server, [server])
            announce(f"the view is at {self._page.address}")

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


def _leave_out_missing(plan: ViewPlan, notify: Callable[[str], None]) -> ViewPlan:
    """Return a plan without the viewers that cannot be shown; an error if nothing is left."""
    failures: list[DeviceError] = []
    connect, spawn = plan.connect, plan.spawn
    try:
        if connect:
            check_answering(connect)
    except DeviceError as error:
        failures.append(error)
        connect = ""
    try:
        if spawn:
            check_screen()
    except DeviceError as error:
        failures.append(error)
        spawn = False
    if not (plan.output or plan.web or connect or spawn):
        raise failures[0]
    for failure in failures:
        notify(str(failure))
    return replace(plan, connect=connect, spawn=spawn)


def make_stream(sdk: Any, *sinks: Any) -> rr.RecordingStream:
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
