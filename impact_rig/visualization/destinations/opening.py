"""Opening of the view's destinations, and what is said when one cannot be opened."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from impact_rig.core.errors import DeviceError, FileError, ParameterError
from impact_rig.visualization import entities
from impact_rig.visualization.destinations.addresses import (
    LOOPBACK,
    check_listen_address,
    check_viewer_address,
)
from impact_rig.visualization.destinations.connection import ViewerConnection
from impact_rig.visualization.destinations.destination import (
    Destination,
    Notice,
    StreamDestination,
)
from impact_rig.visualization.destinations.program import check_screen
from impact_rig.visualization.destinations.relay import Relay
from impact_rig.visualization.rerun_sdk import import_rerun

if TYPE_CHECKING:
    import rerun as rr

FILE_REFRESH_PERIOD = 10.0
"""Least time between two versions of a table or comparison in a file [s], our choice: of a file
only the last one is looked at, and each takes room."""
VIEWER_REFRESH_PERIOD = 1.0
"""The same in a viewer [s], our choice."""


@dataclass(frozen=True)
class DestinationPlan:
    """Where the view is to go: any of these, or several at once.

    Attributes
    ----------
    output : str
        Path of an .rrd file to be written, replaced if it exists; empty: none.
    connect : str
        Address of a viewer elsewhere, ``rerun+http://HOST:9876/proxy``; empty: none. It may come
        late, close and come back.
    spawn : bool
        Open a viewer on this host. It may be closed and opened again.
    web : bool
        Serve a web page with a viewer.
    listen : str
        IP address that relay and web page listen on.
    relay_port, web_port : int
        Of these; 0: any free one.

    Raises
    ------
    ParameterError
        If nothing was asked for, or an address is none.
    """

    output: str = ""
    connect: str = ""
    spawn: bool = False
    web: bool = False
    listen: str = LOOPBACK
    relay_port: int = 0
    web_port: int = 0

    def __post_init__(self) -> None:
        """Check what was asked for."""
        if not (self.output or self.connect or self.spawn or self.web):
            raise ParameterError(
                "nothing shows the view: set output to the path of an .rrd file, connect to the"
                " address of a viewer, or spawn or web to true"
            )
        if self.connect:
            check_viewer_address(self.connect)
        check_listen_address(self.listen)


def open_destinations(
    plan: DestinationPlan, *, announce: Notice, notify: Notice
) -> tuple[Destination, ...]:
    """Open everything that was asked for.

    What cannot be opened is an error if nothing else shows the view; else `notify` is told and
    the rest is opened.

    Parameters
    ----------
    plan : DestinationPlan
        Where to.
    announce : callable
        Told in one sentence where the web page is, and that a viewer has come.
    notify : callable
        Told in one sentence what is lost, now or later.

    Returns
    -------
    tuple of Destination
        To be closed by the caller.

    Raises
    ------
    FileError
        If the file cannot be written.
    DeviceError
        If no viewer can be shown, and nothing else was asked for.
    RigError
        If rerun-sdk is not installed.
    """
    sdk = import_rerun()
    # What is logged is closed by us; Rerun's own wait at exit for a stuck viewer has no end.
    sdk.unregister_shutdown()
    opened: list[Destination] = []
    if plan.output:
        opened.append(_open_file(sdk, Path(plan.output), notify))
    if plan.connect:
        opened.append(_open_connection(sdk, plan.connect, announce, notify))
    failures: list[DeviceError] = []
    has_window = plan.spawn
    try:
        if has_window:
            check_screen()
    except DeviceError as error:
        failures.append(error)
        has_window = False
    if has_window or plan.web:
        try:
            opened.append(_open_relay(sdk, plan, announce, notify, has_window=has_window))
        except DeviceError as error:
            failures.append(error)
    if not opened:
        raise failures[0]
    for failure in failures:
        notify(str(failure))
    return tuple(opened)


def make_stream(sdk: Any, *sinks: Any) -> rr.RecordingStream:
    """Return a recording stream of its own recording.

    Parameters
    ----------
    sdk : module
        `rerun`.
    *sinks
        Where it goes; none: still nowhere.
    """
    stream: rr.RecordingStream = sdk.RecordingStream(entities.APPLICATION, recording_id=uuid4())
    if sinks:
        stream.set_sinks(*sinks)
    return stream


def _open_file(sdk: Any, path: Path, notify: Notice) -> Destination:
    if path.suffix != ".rrd":
        raise FileError(f"output is {str(path)!r}: it must end in .rrd")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # Tried first: Rerun would say why not in its own words, on another channel.
        path.open("ab").close()
        # A footer's index would be kept in memory and grow with every hit.
        stream = make_stream(sdk, sdk.FileSink(str(path), write_footer=False))
    except (OSError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"{path} cannot be written: {reason}") from error
    return StreamDestination(str(path), stream, FILE_REFRESH_PERIOD, notify)


def _open_connection(sdk: Any, address: str, announce: Notice, notify: Notice) -> Destination:
    return ViewerConnection(
        address,
        lambda: make_stream(sdk, sdk.GrpcSink(address)),
        VIEWER_REFRESH_PERIOD,
        announce=announce,
        notify=notify,
    )


def _open_relay(
    sdk: Any, plan: DestinationPlan, announce: Notice, notify: Notice, *, has_window: bool
) -> Destination:
    return Relay(
        sdk,
        make_stream(sdk),
        listen=plan.listen,
        port=plan.relay_port,
        page_port=plan.web_port,
        has_window=has_window,
        has_page=plan.web,
        refresh_period=VIEWER_REFRESH_PERIOD,
        notify=notify,
        announce=announce,
    )
