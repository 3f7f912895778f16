"""Views as files: they are written, and shown by a viewer elsewhere."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from impact_rig.core.errors import DeviceError, FileError
from impact_rig.present.rerun.live_view import make_stream
from impact_rig.present.rerun.rerun_sdk import import_rerun
from impact_rig.present.rerun.view_log import ViewLog
from impact_rig.present.rerun.viewers import check_answering, find_viewer
from impact_rig.results.traced_campaign import TracedCampaign

SEND_TIMEOUT = 60.0
"""Time limit for a viewer to accept a file [s]: 25 MB over a slow network."""


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


def check_view(path: Path) -> None:
    """Require a file that Rerun can read.

    Raises
    ------
    FileError
        If it is not one.
    """
    _find_recording(path)


def send_view(path: Path, address: str) -> None:
    """Show all recordings of a file in a viewer elsewhere.

    Raises
    ------
    ParameterError
        If the address is invalid.
    DeviceError
        If no viewer answers there, or it does not take the file.
    FileError
        If it is not a file of Rerun.
    """
    check_answering(address)
    sdk = import_rerun()
    sdk.unregister_shutdown()
    # What carries the file must not be another recording beside those in it.
    application, recording = _find_recording(path)
    stream = sdk.RecordingStream(application, recording_id=recording, send_properties=False)
    stream.set_sinks(sdk.GrpcSink(address))
    try:
        stream.log_file_from_path(path)
        stream.flush(timeout_sec=SEND_TIMEOUT)
    except RuntimeError as error:
        raise DeviceError(f"the viewer at {address} does not take the view: {error}") from None
    # Waits for what still reads the file.
    stream.disconnect()


def write_view(path: Path, campaign: TracedCampaign) -> None:
    """Write a campaign into a file, replaced if it exists.

    Raises
    ------
    FileError
        If the file cannot be written.
    RigError
        If rerun-sdk is not installed.
    """
    sdk = import_rerun()
    # Rerun itself would say on standard error why it cannot write.
    try:
        path.open("ab").close()
        stream = make_stream(sdk, sdk.FileSink(str(path)))
        ViewLog(stream).log_campaign(campaign)
        stream.flush(timeout_sec=SEND_TIMEOUT)
        stream.disconnect()
    except (OSError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"{path} cannot be written: {reason}") from None


def _find_recording(path: Path) -> tuple[str, str]:
    """Return application and recording id of the first recording in a file."""
    import_rerun()
    from rerun.chunk import RrdReader

    try:
        found = RrdReader(str(path)).recordings()
    except (OSError, RuntimeError, ValueError) as error:
        raise FileError(f"{path} is not a view that Rerun can read: {error}") from None
    if not found:
        raise FileError(f"{path} holds no recording of Rerun")
    return found[0].application_id, found[0].recording_id
