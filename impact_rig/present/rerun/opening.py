"""Opening of the view's destinations, and what is said when one cannot be opened."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from impact_rig.core.errors import DeviceError, FileError
from impact_rig.present.rerun import entities
from impact_rig.present.rerun.connection import ViewerConnection
from impact_rig.present.rerun.destination import DestinationPlan, Notice, StreamDestination
from impact_rig.present.rerun.relay import Relay
from impact_rig.present.rerun.rerun_sdk import import_rerun
from impact_rig.present.rerun.viewer_program import check_screen

if TYPE_CHECKING:
    import rerun as rr

Destination = StreamDestination | ViewerConnection
"""One place where the view goes; nothing of it waits for it."""
FILE_REFRESH_PERIOD = 10.0
"""Least time between two versions of a table or comparison in a file [s], our choice: of a file
only the last one is looked at, and each takes room."""
VIEWER_REFRESH_PERIOD = 1.0
"""The same in a viewer [s], our choice."""


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
        opened.append(
            ViewerConnection(
                plan.connect,
                lambda: make_stream(sdk, sdk.GrpcSink(plan.connect)),
                VIEWER_REFRESH_PERIOD,
                announce=announce,
                notify=notify,
            )
        )
    failures: list[DeviceError] = []
    has_window = plan.spawn
    try:
        if has_window:
            check_screen()
    except DeviceError as error:
        failures.append(error)
        has_window = False
    try:
        if has_window or plan.web:
            wanted = replace(plan, spawn=has_window)
            opened.append(
                Relay(
                    sdk,
                    make_stream(sdk),
                    wanted,
                    VIEWER_REFRESH_PERIOD,
                    announce=announce,
                    notify=notify,
                )
            )
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
